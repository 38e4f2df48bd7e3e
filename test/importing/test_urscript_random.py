# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Random programs whose points are known beforehand, and programs with faults in them."""

from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from random import Random

from broken_files import broken_texts, goal_or_sentence
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.importing import import_file

URX = Path(__file__).parent / 'files' / 'urx.script'


def rotation(vector):
    """Return the matrix of a rotation vector (Rodrigues' formula)."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def matrix(numbers):
    """Return the 4 x 4 matrix of the six numbers of a pose."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation(numbers[3:]), numbers[:3]
    return found


@dataclass
class RandomProgram:
    """A program, and the poses, speeds and blends that it leads to by matrices of ours."""

    random: Random
    lines: list[str] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    blends: list[float] = field(default_factory=list)

    def numbers(self, size=0.2):
        """Return the six numbers of a pose, as the program writes them."""
        draw = self.random.uniform
        return [round(draw(-size, size), 6) for _ in range(3)] + [
            round(draw(-pi, pi) / 2.0, 6) for _ in range(3)
        ]

    def write(self, pieces=12):
        """Write a program of so many pieces."""
        self.frame = self.numbers(0.4)
        self.lines += [
            'def main():',
            f'  frame = p{self.frame}',
            '  def go(x, y, z=0.05, speed=0.1):',
            '    movel(pose_trans(frame, p[x, y, z, 0, 0, x]), a=0.5, v=speed)',
            '  end',
            '  def over(a, b):',
            '    local middle = interpolate_pose(a, b, 0.5)',
            '    return pose_add(middle, p[0, 0, 0.1, 0, 0, 0])',
            '  end',
        ]
        for _ in range(pieces):
            self.random.choice(
                (self.line, self.loop, self.call, self.choice, self.nested, self.items, self.added)
            )()
        self.lines.append('end')
        return '\n'.join(self.lines) + '\n'

    def expect(self, pose, speed, blend=0.0):
        self.poses.append(pose)
        self.speeds.append(speed)
        self.blends.append(blend)

    def line(self):
        """Write a move to a pose of numbers."""
        numbers, speed = self.numbers(0.5), round(self.random.uniform(0.01, 0.4), 4)
        move = self.random.choice(('movel', 'movep'))
        self.lines.append(f'  {move}(p{numbers}, 1.2, {speed})')
        self.expect(matrix(numbers), speed)

    def loop(self):
        """Write a loop along a line of the frame, with blends."""
        count, (dx, dy, dz, *turn) = self.random.randint(1, 5), self.numbers(0.05)
        z = self.numbers(0.1)[2]
        blend = self.random.choice((0.0, 0.001))
        self.lines += [
            '  i = 0',
            f'  while i < {count}:',
            f'    movel(pose_trans(frame, p[{dx} * i, {dy} * i, {z} + {dz} * i, {turn[0]}, '
            f'{turn[1]}, {turn[2]}]), 0.5, 0.2, 0, {blend})',
            '    i = i + 1',
            '  end',
        ]
        for i in range(count):
            at = matrix([dx * i, dy * i, z + dz * i, *turn])
            self.expect(matrix(self.frame) @ at, 0.2, blend)

    def call(self):
        """Write a call with positional, named and left out arguments."""
        x, y, z = self.numbers(0.1)[:3]
        with_z, with_speed = self.random.random() < 0.5, self.random.random() < 0.5
        self.lines.append(f'  go({x}, y={y}{f", z={z}" * with_z}{", speed=0.3" * with_speed})')
        at = matrix([x, y, z if with_z else 0.05, 0.0, 0.0, x])
        self.expect(matrix(self.frame) @ at, 0.3 if with_speed else 0.1)

    def choice(self):
        """Write a branch of three."""
        k, numbers = self.random.randint(0, 5), [self.numbers(0.4) for _ in range(3)]
        self.lines += [
            f'  k = {k}',
            f'  if k % 3 == 0: movel(p{numbers[0]}, v=0.1)',
            f'  elif (k > 3) or not k != 1: movel(p{numbers[1]}, v=0.2)',
            f'  else: movel(p{numbers[2]}, v=0.3) end',
        ]
        taken = 0 if k % 3 == 0 else 1 if k > 3 or k == 1 else 2
        self.expect(matrix(numbers[taken]), (0.1, 0.2, 0.3)[taken])

    def nested(self):
        """Write a chain of poses relative to each other."""
        chain = [self.numbers(0.1) for _ in range(self.random.randint(1, 4))]
        self.lines.append('  here = frame')
        here = matrix(self.frame)
        for numbers in chain:
            inverse = self.random.random() < 0.3
            step = f'pose_inv(p{numbers})' if inverse else f'p{numbers}'
            self.lines.append(f'  here = pose_trans(here, {step})')
            here = here @ (np.linalg.inv(matrix(numbers)) if inverse else matrix(numbers))
        self.lines.append('  movel(here, 1.0, 0.15)')
        self.expect(here, 0.15)

    def items(self):
        """Write a list of poses that a loop goes through, every second one."""
        found = [self.numbers(0.3) for _ in range(self.random.randint(2, 6))]
        self.lines += [
            f'  points = [{", ".join(f"p{numbers}" for numbers in found)}]',
            '  j = 0',
            '  while j < length(points):',
            '    movel(points[j], v=0.05)',
            '    j = j + 2',
            '  end',
        ]
        for numbers in found[::2]:
            self.expect(matrix(numbers), 0.05)

    def added(self):
        """Write a pose between two others, and above."""
        a, b = self.numbers(0.3), self.numbers(0.3)
        b[3:] = a[3:]
        self.lines.append(f'  movel(over(p{a}, p{b}), v=0.08)')
        pose = matrix(a)
        pose[:3, 3] = 0.5 * (np.array(a[:3]) + np.array(b[:3])) + (0.0, 0.0, 0.1)
        self.expect(pose, 0.08)


@pytest.mark.random
def test_random_programs_lead_where_they_are_meant_to(tmp_path):
    points, worst, file = 0, 0.0, tmp_path / 'random.script'
    count = cases(2_000)
    for case in range(count):
        program = RandomProgram(random_of('urscript', case))
        file.write_text(program.write())
        goal = import_file(file).goal
        poses = np.array(goal.waypoints.poses)
        expected = np.array(program.poses)
        assert len(poses) == len(expected), case
        worst = max(worst, np.abs(poses[:, :3] - expected[:, :3, 3]).max())
        for (x, y, z, w), pose in zip(poses[:, 3:].tolist(), expected, strict=True):
            turned = rotation(2.0 * np.arctan2(np.hypot(np.hypot(x, y), z), w) * unit([x, y, z]))
            assert np.abs(turned - pose[:3, :3]).max() < 1e-9, case
        assert goal.segments.velocities.tolist() == program.speeds
        fits = goal.segments.blend_radii[:-1] > 0.0
        assert (fits <= (np.array(program.blends)[:-1] > 0.0)).all()
        points += len(poses)
    assert worst < 1e-9
    assert points > 12 * count


def unit(vector):
    length = np.linalg.norm(vector)
    return np.asarray(vector) / length if length else np.zeros(3)


#: Programs with all kinds of statements, for faults.
PROGRAMS = (
    """# begin: URCap Installation Node
def saved():
  set_standard_analog_input_domain(0, 1)
  set_tcp(p[0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
  steps = 0.0
  thread Step_Counter():
    while (True):
      steps = steps + 1.0
      sync()
    end
  end
  run Step_Counter()
  global Waypoint_1_p=p[.3, -.3, .4, 0, 3.14, 0]
  global Waypoint_1_q=[-0.5, -1.7, -1.9, -1.1, 1.57, 0.03]
  while (True):
    $ 1 "Robot Program"
    $ 3 "Waypoint_1" "breakAfter"
    movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q), a=1.396, v=1.047)
    while (get_standard_digital_in(0) == False):
      sync()
    end
    set_tool_digital_out(0, True)
    sleep(0.5)
    movel(pose_trans(Waypoint_1_p, p[0, 0, 0.1, 0, 0, 0]), a=1.2, v=0.25, r=0.01)
    movec(pose_add(get_actual_tcp_pose(), p[0.05, 0.05, 0, 0, 0, 0]), Waypoint_1_p, v=0.1)
  end
end
""",
    """def pallet():
  start = p[0.2, -0.4, 0.2, 0, 3.14159, 0]
  offsets = [[0.0, 0.05], [0.06, 0.1]]
  part = struct(height=0.03, name="box")
  row = 0
  while row < 3:
    target = pose_trans(start, p[row * offsets[0, 1], offsets[1, 0], part.height, 0, 0, 0])
    if row == 1 and not part.name == "":
      movej(pose_add(target, p[0, 0, 0.1, 0, 0, 0]), t=2)
    elif row > 1:
      set_standard_analog_out(0, 0.5)
    else:
      textmsg("row ", to_str(row))
    end
    movep(target, a=1.2, v=0.25, r=0.005)
    switch row:
      case 0:
        optimovel(target, 0.3, 0.3)
      default:
        stopl(1.0)
    end
    row = row + 1
  end
  halt
end
pallet()
""",
    """def at(x, y, z=0.1):
  return pose_trans(frame, p[x, y, z, 0, 0, d2r(10)])
end
global frame = p[0.3, -0.3, 0.1, 0, 3.14159, 0]
movel(at(0, 0), 0.5, 0.1)
movel(at(0.1, y=0.1), 0.5, 0.1)
""",
)


@pytest.mark.random
def test_broken_programs_become_a_goal_or_a_sentence(tmp_path, monkeypatch):
    # A hang would be one of the test: the bounds are a hundredth of the real ones.
    module = 'ur_cartesian_driver.importing.script.urscript_file'
    monkeypatch.setattr(f'{module}.MAX_CYCLES', 1_000)
    monkeypatch.setattr(f'{module}.MAX_NODES', 100_000)
    files, count = (*PROGRAMS, URX.read_text()), cases(10_000)
    goals = sentences = 0
    for text in broken_texts(files, count, random_of('broken urscript')):
        found = goal_or_sentence(tmp_path / 'broken.script', text)
        goals += not isinstance(found, str)
        sentences += isinstance(found, str)
    assert goals + sentences == count
    assert min(goals, sentences) > count // 40
