# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian cell`` lists the bodies of a file, and finds those that touch the resting arm."""

import numpy as np
import pytest
import yaml

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.sim import SimulatorConfig

JOINTS = (0.3, -1.4, 1.3, -1.2, -1.5, 0.2)
WORDS = ('--joints', ','.join(map(str, JOINTS)))


@pytest.fixture
def tip():
    """Where pinocchio has the point 0.2 m before the flange of a UR5e."""
    pinocchio = pytest.importorskip('pinocchio')
    model = pinocchio.buildModelFromXML(robot_description(Arm(MODELS['ur5e'])))
    data = model.createData()
    pinocchio.framesForwardKinematics(
        model, data, pinocchio.integrate(model, pinocchio.neutral(model), np.array(JOINTS))
    )
    base, tool = (data.oMf[model.getFrameId(name)] for name in ('base', 'tool0'))
    return (base.inverse() * tool).act(np.array([0.0, 0.0, 0.2]))


@pytest.fixture
def write(tmp_path):
    """Write a cell with a probe of 30 mm at the tip, and a ball of 50 mm; return its file."""

    def write(ball, **more):
        file = tmp_path / 'cell.yaml'
        bodies = {
            'probe': {'frame': 'tool0', 'sphere': 0.03, 'position': [0.0, 0.0, 0.2]},
            'ball': {'sphere': 0.05, 'position': np.asarray(ball).tolist(), **more},
        }
        file.write_text(yaml.safe_dump({'cell': 1, 'bodies': bodies}))
        return str(file)

    return write


@pytest.mark.parametrize(
    ('offset', 'clearance', 'says'),
    [
        (0.1, 0.03, 'are 20.0 mm apart, and the clearance is 30 mm'),
        (0.05, 0.0, 'overlap by 30.0 mm'),
    ],
)
def test_check_finds_what_touches_and_the_lines_that_allow_it(
    offset, clearance, says, write, tip, capsys
):
    file = write(np.add(tip, (0.0, 0.0, -offset)), clearance=clearance)
    assert main(['cell', 'check', file, *WORDS]) == 1
    found = capsys.readouterr().out
    assert f'ball and probe {says}' in found or f'probe and ball {says}' in found
    assert found.startswith('ur5e, joints 0.3 -1.4 1.3 -1.2 -1.5 0.2 rad\n')
    with open(file, 'a') as text:
        text.write(found[found.index('may_touch:') :])
    assert main(['cell', 'check', file, *WORDS]) == 0
    assert 'nothing touches' in capsys.readouterr().out


def test_check_names_the_closest_pair_if_nothing_touches(write, tip, capsys):
    file = write(np.add(tip, (0.0, 0.0, -0.1)), clearance=0.01)
    assert main(['cell', 'check', file, *WORDS]) == 0
    found = capsys.readouterr().out
    assert 'closest fixed body: probe and ball are 20.0 mm apart (clearance 10 mm)' in found
    assert main(['cell', 'check', file, *WORDS, '--model', 'ur10e']) == 0
    assert '20.0 mm apart' not in capsys.readouterr().out


def test_check_takes_joints_and_tcp_of_a_robot(ur_sim, write, tip, capsys):
    words = ['--robot-ip', '127.0.0.1', '--rtde-port', str(ur_sim.ports.rtde)]
    assert main(['cell', 'check', write(np.add(tip, (0.0, 0.0, 3.0))), *words]) == 0
    joints = ' '.join(f'{value:.4g}' for value in ur_sim.config.q)
    assert capsys.readouterr().out.startswith(f'ur5e, joints {joints} rad\n')


def test_show_lists_bodies_sizes_and_what_is_odd(tmp_path, capsys):
    (tmp_path / 'part.obj').write_text('v 0 0 0\nv 10 0 0\nv 0 20 0\nf 1 2 3\n')
    file = tmp_path / 'cell.yaml'
    file.write_text(
        'cell: 1\nclearance: 0.02\nbodies:\n  table: {plane: {}}\n'
        '  torch:\n    frame: tool0\n    clearance: 0.001\n    shapes:\n'
        '    - {cylinder: {radius: 0.02, length: 0.3}, position: [0, 0, 0.15]}\n'
        '    - {box: [0.1, 0.2, 0.3], position: [0.5, 0, 0], rpy: [0, 0, 1.5707963267948966]}\n'
        '  part: {mesh: part.obj}\nmay_touch: [[torch, table]]\n'
    )
    assert main(['cell', 'show', str(file)]) == 0
    head, table, torch, part, *others = capsys.readouterr().out.splitlines()
    assert head.split() == ['name', 'frame', 'shapes', 'size', '[mm]', 'clearance', '[mm]']
    assert table.split() == ['table', 'base', 'plane', 'no', 'end', '20']
    assert torch.split() == 'torch tool0 cylinder, box 620 x 100 x 450 1'.split()
    assert part.split() == 'part base mesh of 1 triangles 10000 x 20000 x 0 20'.split()
    assert others[0] == 'may touch: table and torch'
    assert any('millimetres' in line for line in others)
    assert any('not closed' in line for line in others)


@pytest.mark.slow
def test_both_draw_the_cell(write, tip, tmp_path, capsys):
    pytest.importorskip('viser')
    file, page = write(np.add(tip, (0.0, 0.0, -0.05))), tmp_path / 'cell.html'
    assert main(['cell', 'show', file, *WORDS, '--html', str(page)]) == 0
    shown = page.read_text()
    assert 'probe' in shown
    assert main(['cell', 'check', file, *WORDS, '--html', str(page)]) == 1
    assert 'overlap by 30.0 mm' in page.read_text()
    assert f'page: {page}' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('cell: 1\nbodies:\n  a: {sphere: -1}\n', 'cell.yaml'),
        ('- 1\n', 'cell.yaml'),
    ],
)
def test_a_file_that_is_no_cell_is_refused_in_one_sentence(text, says, tmp_path, capsys):
    file = tmp_path / 'cell.yaml'
    file.write_text(text)
    for what in ('show', 'check'):
        assert main(['cell', what, str(file)]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert says in line
    assert main(['cell', 'show', str(tmp_path / 'none.yaml')]) == 1
    assert 'none.yaml' in capsys.readouterr().err


def test_without_joints_the_arm_is_where_the_simulator_starts(tmp_path, capsys):
    file = tmp_path / 'cell.yaml'
    file.write_text('cell: 1\nbodies:\n  ball: {sphere: 0.1, position: [2, 2, 2]}\n')
    assert main(['cell', 'check', str(file)]) == 0
    joints = ' '.join(f'{value:.4g}' for value in SimulatorConfig().q)
    assert joints in capsys.readouterr().out
