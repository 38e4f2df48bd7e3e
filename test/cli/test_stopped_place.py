# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The note beside a goal of where it was stopped."""

import pytest

from ur_cartesian_driver.cli.stopped_place import digest, read_place, write_place
from ur_cartesian_driver.motion.events import PathPlace

PLACE = PathPlace(point=3, fraction=0.1 + 0.2)


def test_a_place_is_read_as_it_was_written_until_nothing_is_left(tmp_path):
    goal = tmp_path / 'seam.yaml'
    goal.write_text('{}')
    assert write_place(goal, PLACE, digest(goal)) == tmp_path / 'seam.yaml.stopped'
    assert read_place(goal) == PLACE
    assert write_place(goal, None, digest(goal)) is None
    with pytest.raises(ValueError, match=r'seam\.yaml cannot be resumed: .*\.stopped is missing'):
        read_place(goal)


def test_another_goal_and_a_spoilt_note_are_refused(tmp_path):
    goal = tmp_path / 'seam.yaml'
    goal.write_text('{}')
    note = write_place(goal, PLACE, digest(goal))
    goal.write_text('{keep_open: true}')
    with pytest.raises(ValueError, match='the file has changed since the goal was stopped'):
        read_place(goal)
    for text in ('', '{point: 3}', '[', 'point: x\nfraction: 1.0\ngoal: y'):
        note.write_text(text)
        with pytest.raises(ValueError, match='does not say where a goal was stopped; remove it'):
            read_place(goal)
