# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A scheduler in which computing tests fill the time while others wait for a clock.

With ``--overlap``, every other worker of pytest-xdist runs tests that only compute. It runs them
at a low priority, so that a test with sockets and deadlines has a processor when it needs one. The
remaining workers help, at the same priority, when no test with deadlines is left.
"""

from bisect import bisect_left
import os

import pytest
from xdist.scheduler import LoadScheduling

#: Tests that read no clock, by the rules for their packages or in virtual time; long ones first.
COMPUTING = (
    'test/acceptance/test_random_outputs.py',
    'test/acceptance/test_pre_flight.py',
    'test/faults/',
    'test/acceptance/test_announced_speeds.py',
    'test/acceptance/test_append.py',
    'test/acceptance/test_contact_watch.py',
    'test/acceptance/test_dwells.py',
    'test/acceptance/test_event_chains.py',
    'test/acceptance/test_feed_override.py',
    'test/acceptance/test_flips.py',
    'test/acceptance/test_foreign_programs.py',
    'test/acceptance/test_free_axis_seams.py',
    'test/acceptance/test_gcode_programs.py',
    'test/acceptance/test_hand_back.py',
    'test/acceptance/test_held_part_seams.py',
    'test/acceptance/test_held_parts_disturbed.py',
    'test/acceptance/test_held_parts_on_the_robot.py',
    'test/acceptance/test_input_waits.py',
    'test/acceptance/test_io_commands.py',
    'test/acceptance/test_joint_trajectories.py',
    'test/acceptance/test_live_sessions.py',
    'test/acceptance/test_motion_versions.py',
    'test/acceptance/test_outputs_by_place.py',
    'test/acceptance/test_path_offsets.py',
    'test/acceptance/test_played_on_the_pendant.py',
    'test/acceptance/test_presses.py',
    'test/acceptance/test_prints_with_rounded_corners.py',
    'test/acceptance/test_proportional_outputs.py',
    'test/acceptance/test_pulses.py',
    'test/acceptance/test_replaced_tails.py',
    'test/acceptance/test_resumed_goals.py',
    'test/acceptance/test_rounded_corners.py',
    'test/acceptance/test_run_script.py',
    'test/acceptance/test_safe_outputs.py',
    'test/acceptance/test_saved_programs.py',
    'test/acceptance/test_script_calls.py',
    'test/acceptance/test_servo_drives_the_guide.py',
    'test/acceptance/test_servo_events.py',
    'test/acceptance/test_servo_experiments.py',
    'test/acceptance/test_servo_goal.py',
    'test/acceptance/test_speed_slider_in_virtual_time.py',
    'test/acceptance/test_spline.py',
    'test/acceptance/test_stall.py',
    'test/acceptance/test_tolerances_in_virtual_time.py',
    'test/acceptance/test_twins.py',
    'test/acceptance/test_waiting_in_virtual_time.py',
    'test/driver/test_recorded_motion.py',
    'test/identification/',
    'test/sim/motion/',
    'test/importing/',
    'test/path/',
    'test/planning/',
    'test/preview/',
    'test/program/',
    'test/execution/',
    'test/kinematics/',
    'test/motion/',
    'test/protocol/',
    'test/urscript/',
)
LOW_PRIORITY = 10
#: Number of tests that a worker knows in advance: it runs a test once it knows the next one.
AHEAD = 4


def is_for_computing(worker: str) -> bool:
    """Return whether a worker, by its name, is for tests that compute."""
    return int(worker.removeprefix('gw')) % 2 == 1


def rank(test: str) -> int:
    """Return the place of a test's path among the computing ones; -1 = it waits for a clock."""
    return next((i for i, path in enumerate(COMPUTING) if test.startswith(path)), -1)


class LowPriority:
    """A plugin that gives a worker a low priority from its first computing test on."""

    def __init__(self) -> None:
        self.is_low = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Lower the priority for good: the scheduler hands out tests that wait first."""
        if not self.is_low and rank(nodeid) >= 0:
            os.nice(LOW_PRIORITY)
            self.is_low = True


class Overlap(LoadScheduling):
    """Gives each worker tests of its kind."""

    collection: list[str] | None

    def schedule(self):
        """Begin, or go on after the number of workers has changed."""
        if self.collection is None:
            if not self._check_nodes_have_same_collection():
                return
            self.collection = next(iter(self.node2collection.values()))
            self.pending[:] = sorted(range(len(self.collection)), key=self._rank)
        for node in self.nodes:
            self.check_schedule(node)

    def check_schedule(self, node, duration=0.0):
        """Give a worker more to do, or send it home if nothing is left for it."""
        if node.shutting_down:
            return
        first = 0
        if is_for_computing(node.gateway.id):
            first = bisect_left(self.pending, 0, key=self._rank)
        if first == len(self.pending):
            node.shutdown()
            return
        last = first + AHEAD - len(self.node2pending[node])
        tests = self.pending[first:last]
        if tests:
            del self.pending[first:last]
            self.node2pending[node].extend(tests)
            node.send_runtest_some(tests)

    def _rank(self, test):
        return rank(self.collection[test])
