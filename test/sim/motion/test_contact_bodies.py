# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Planes and boxes push back by their law; texts that name none are refused by a sentence."""

import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody
from ur_cartesian_driver.sim.simulator_config import HOME, SimulatorConfig

STILL = (0.0, 0.0, 0.0)


def test_a_plane_pushes_along_its_normal_where_the_tool_is_behind_it():
    table = ContactBody.parse('plane 0 0 0.1 0 0 2 stiffness=1000')
    assert table.force((0.3, 0.2, 0.101), STILL) == STILL
    assert table.force((0.3, 0.2, 0.09), STILL) == pytest.approx((0.0, 0.0, 10.0))


def test_a_box_pushes_out_of_the_face_that_the_tool_has_passed():
    box = ContactBody.parse('box 0.5 0 0.1 0.2 0.4 0.2')
    assert box.force((0.39, 0.0, 0.1), STILL) == STILL
    assert box.force((0.401, 0.0, 0.1), STILL) == pytest.approx((-20.0, 0.0, 0.0))
    assert box.force((0.5, 0.199, 0.1), STILL) == pytest.approx((0.0, 20.0, 0.0))
    assert box.force((0.5, 0.0, 0.199), STILL) == pytest.approx((0.0, 0.0, 20.0))


def test_damping_adds_to_the_pressure_and_never_pulls():
    table = ContactBody.parse('plane 0 0 0 0 0 1 stiffness=1000 damping=100')
    assert table.force((0.0, 0.0, -0.01), (0.0, 0.0, -0.05)) == pytest.approx((0.0, 0.0, 15.0))
    assert table.force((0.0, 0.0, -0.01), (0.0, 0.0, 0.2)) == STILL


def test_friction_is_against_the_motion_along_the_surface():
    table = ContactBody.parse('plane 0 0 0 0 0 1 stiffness=1000 friction=0.5')
    assert table.force((0.0, 0.0, -0.01), (0.1, 0.0, 0.0)) == pytest.approx((-5.0, 0.0, 10.0))
    assert table.force((0.0, 0.0, -0.01), (0.0, 5e-4, 0.0)) == pytest.approx((0.0, -2.5, 10.0))


@pytest.mark.parametrize(
    'change',
    [
        'zero_ftsensor()',
        'set_payload(1, [0, 0, 0.1])',
        'set_payload_mass(1)',
        'set_payload_cog([0, 0, 0.1])',
        'set_target_payload(1, [0, 0, 0.1])',
    ],
)
@pytest.mark.parametrize(('model', 'zeroes'), [('ur5e', True), ('ur5', False)])
def test_a_new_payload_zeroes_the_force_sensor_of_arms_that_have_one(
    make_bench, change, model, zeroes
):
    # The script manual of 5.x says so of each function.
    height = Arm(robot_model(model)).forward(HOME).position[2]
    log = make_bench(model=model, contacts=[f'plane 0 0 {height - 0.005} 0 0 1']).run(f"""
        target = get_target_tcp_pose()
        target[2] = target[2] - 0.007
        movel(target)
        sleep(0.1)
        textmsg(force() > 10)
        {change}
        textmsg(force() < 0.1)""")
    assert log == ['True', str(zeroes or change == 'zero_ftsensor()')]


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('', 'is not "plane x y z nx ny nz" or "box x y z dx dy dz"'),
        ('ball 0 0 0 1 1 1', 'is not "plane'),
        ('plane 0 0 0 0 0', 'is not "plane'),
        ('plane 0 0 0 0 0 up', 'is not "plane'),
        ('plane 0 0 0 0 0 1 colour=1', 'is not "plane'),
        ('plane 0 0 0 0 0 nan', 'has a number that is not possible'),
        ('plane 0 0 0 0 0 1 friction=-1', 'has a number that is not possible'),
        ('plane 0 0 0 0 0 1 stiffness=1e9', 'stiffness of "plane'),
        ('plane 0 0 0 0 0 0', 'the normal of'),
        ('box 0 0 0 1 0 1', 'the edges of'),
    ],
)
def test_a_text_that_names_no_body_is_refused(text, problem):
    with pytest.raises(ValueError, match='contact: ') as refusal:
        SimulatorConfig(contacts=[text])
    assert problem in str(refusal.value)
