# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Teaching against the simulated robot: its arm is put elsewhere between two keys."""

import pytest
from waiting import wait_for

from ur_cartesian_driver.cli.teach_command import guide, Lesson
from ur_cartesian_driver.importing import import_file, ImportOptions
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.path import Path
from ur_cartesian_driver.sim.simulator_config import HOME

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.ur_sim(frequency=125.0)]


def at(turn, lift):
    first, second, *others = HOME
    return (first + turn, second + lift, *others)


@pytest.fixture
def taught(make_driver, ur_sim):
    """Return a driver, and a function that teaches by pairs of a place and a key."""
    driver = make_driver(allow_freedrive=True)
    driver.wait_ready(30.0)

    def lead(lesson, steps):
        said = []

        def keys():
            for q, key in steps:
                assert driver.is_freedrive_active
                if q is not None:
                    ur_sim.call(lambda controller, q=q: controller.motion.teleport(q))
                    wait_for(lambda q=q: driver.state.target_q == q, 10.0)
                if isinstance(key, BaseException):
                    raise key
                yield key

        try:
            guide(driver, lesson, keys(), said.append)
        finally:
            assert not driver.is_freedrive_active
        return said

    return driver, lead


def test_points_are_taken_by_their_types_and_undone(taught, tmp_path):
    driver, lead = taught
    lesson = Lesson(Path().at(speed=0.1))
    places = [at(0.1 * i, 0.05 * (i % 2)) for i in range(6)]
    said = lead(
        lesson,
        [
            (places[0], ''),
            (None, ''),  # nowhere to go
            (places[1], 'l'),
            (places[2], 'x'),
            (None, 'a'),
            (places[3], ''),
            (places[4], 'p'),
            (places[5], 'j'),
            (None, 'u'),
            (None, 'q'),
            (None, 'j'),
        ],
    )
    types = [segment.type for segment in lesson.path.goal().segments]
    assert types == [
        SegmentType.JOINT,
        SegmentType.LINEAR,
        SegmentType.CIRCULAR,
        SegmentType.PROCESS,
    ]
    arm = driver.arm
    for pose, q in zip(lesson.path.poses, [places[i] for i in (0, 1, 3, 4)], strict=True):
        assert pose.distance_to(arm.forward(q)) < 1e-4
    assert [text for text in said if text.startswith('not taken: ')]
    assert said[-1] == 'undone; 4 points left'
    file = tmp_path / 'path.yaml'
    lesson.path.save(file)
    assert driver.plan(Path.load(file)).segments


def test_an_interrupt_holds_the_arm_and_keeps_the_points(taught):
    _, lead = taught
    lesson = Lesson(Path())
    with pytest.raises(KeyboardInterrupt):
        lead(lesson, [(at(0.1, 0.0), ''), (None, KeyboardInterrupt())])
    assert len(lesson.path) == 1


def test_a_recorded_freedrive_becomes_a_path(make_driver, ur_sim, tmp_path):
    driver = make_driver(allow_freedrive=True, record_directory=str(tmp_path))
    driver.wait_ready(30.0)

    def keys():
        for i in range(20):
            q = at(0.01 * i, 0.0)
            ur_sim.call(lambda controller, q=q: controller.motion.teleport(q))
            wait_for(lambda q=q: driver.state.target_q == q, 10.0)
        yield 'q'

    guide(driver, Lesson(Path()), keys(), str)
    driver.close()  # the recording is a file then
    (file,) = tmp_path.glob('*.npz')
    found = import_file(file, ImportOptions(simplify=1e-3)).goal
    assert 2 <= len(found.waypoints) <= 4
    end = Path.from_goal(found).end
    assert end.distance_to(driver.arm.forward(at(0.19, 0.0))) < 2e-3
