# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Synthetic recordings: a motion along a line with two points, the arm 1 mm beside it."""

import json
import os

import numpy as np

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.driver.recordings.recorder import motion_metadata, Recorder
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.io_signals import (
    AnalogChannel,
    AnalogDomain,
    DigitalChannels,
    Signals,
)
from ur_cartesian_driver.motion.state.rtde_state import RobotState

DONE = Outcome(code=ErrorCode.SUCCESSFUL, text='Done.', report=('a line',))
START = 100.0
PERIOD = 0.002
SPEED = 0.1


def path(first, last, point):
    """Return a straight piece of the plan along x at SPEED [m/s], from one x [m] to another."""
    poses = np.zeros((2, 7))
    poses[:, 0], poses[:, 6] = (first, last), 1.0
    return ReferencePath(
        poses=poses,
        point=np.array([point, point], dtype=np.int32),
        time=np.array([first, last]) / SPEED,
    )


JOB = MotionJob(
    points=2,
    duration=4.0,
    reference=ReferencePath(
        **{
            name: np.concatenate(
                [getattr(piece, name) for piece in (path(0.0, 0.2, 0), path(0.2, 0.4, 1))]
            )
            for name in ('poses', 'point', 'time')
        }
    ),
)
METADATA = motion_metadata(
    JOB,
    robot={'model': 'ur5e'},
    parameters=DriverConfig(),
    plan_metadata_json=json.dumps({'report': ['point 0: there'], 'planning': {'x': 1}}),
)


def packet(i, begun=0, **others):
    """Return the i-th packet on the plan; the arm is 1 mm beside its target."""
    x = SPEED * i * PERIOD
    return RobotState(
        timestamp=START + i * PERIOD,
        actual_q=(0.1 * i, 0, 0, 0, 0, 1),
        target_q=(0.2 * i,) * 6,
        actual_tcp_pose=Pose((x, 0.001, 0.0)),
        target_tcp_pose=Pose((x, 0.0, 0.0)),
        actual_tcp_twist=(SPEED, 0, 0, 0, 0, 0),
        target_tcp_twist=(SPEED, 0, 0, 0, 0, 0),
        points_begun=begun,
        **others,
    )


def outputs(bits):
    none = AnalogChannel(domain=AnalogDomain.CURRENT, value=0.004)
    return Signals(
        inputs=DigitalChannels.from_bits(0),
        outputs=DigitalChannels.from_bits(bits),
        analog_inputs=(none, none),
        analog_outputs=(none, none),
        tool_analog_inputs=(none, none),
    )


class Warnings(list):
    """Collects warnings."""

    def __call__(self, text):
        self.append(text)


def wait_for_writer(recorder):
    """Wait for the writer: packets come much faster here than from a robot."""
    while recorder._directory and recorder._free_buffers.empty():
        os.sched_yield()


def record(
    directory,
    packets,
    *,
    metadata=METADATA,
    outcome=DONE,
    max_size=100.0,
    between=lambda recorder, i: None,
    where=lambda i: (0, 0.0),
):
    """Record packets, and the actions between them; return the warnings."""
    warnings = Warnings()
    recorder = Recorder(str(directory), max_size, warnings)
    for i, state in enumerate(packets):
        if i == 0:
            recorder.start(JOB, dict(metadata), state)
        else:
            wait_for_writer(recorder)
            recorder.add_state(state, *where(i))
        between(recorder, i)
    if outcome is not None:
        recorder.end(outcome)
    recorder.close(10.0)
    return warnings


def only_file(directory):
    (file,) = directory.iterdir()
    return file
