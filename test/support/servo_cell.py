# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The guide's sample program on a simulated controller, driven by our servo side over RTDE only.

Controller and driver take turns cycle by cycle through the bytes of RTDE, with a delay that a
test may vary; so a run needs no real time, and can be repeated exactly.
"""

from collections import deque
from pathlib import Path

from ur_cartesian_driver.execution.servo.servo_clock import ServoClock
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings, ServoStream
from ur_cartesian_driver.motion.state.effective_speed import EffectiveSpeed
from ur_cartesian_driver.protocol.program import registers
from ur_cartesian_driver.protocol.rtde.rtde_client import (
    DataReceived,
    HandshakeDone,
    RtdeClientCodec,
)
from ur_cartesian_driver.robot.rtde.register_connection import feedback_from_rtde, SERVO_FIELDS
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession
from ur_cartesian_driver.sim.programs.script_upload import UploadDecoder

GUIDE = Path(__file__).parents[1] / 'acceptance' / 'programs' / 'servoj_guide.script'
CYCLE = 0.002
SETTINGS = ServoSettings()


class OpenLoopClock(ServoClock):
    """A clock with the rate 1, whatever the robot does with the set-points."""

    def advance(self, passed, speed, in_flight):
        super().advance(passed, 1.0, self.target)


class OpenLoopStream(ServoStream):
    """Set-points as fast as the packets of the robot, to show the effect of the feedback."""

    def __init__(self, source, settings):
        super().__init__(source, settings)
        self._fill_target = 0.0

    def _make_clock(self, step):
        clock = super()._make_clock(step)
        return OpenLoopClock(step=step, target=clock.target, max_lag=clock.max_lag)


class GuideCell:
    """A UR5e that runs the guide's sample or another program, and a client of RTDE."""

    def __init__(self, program=GUIDE):
        self.controller = assemble(SimulatorConfig()).controller
        self._session = RtdeSession(self.controller, set())
        self._client = RtdeClientCodec(SERVO_FIELDS, registers.SERVO_INPUTS)
        data, ready = self._client.start(), []
        while not ready:
            ready = [
                event
                for event in self._client.feed(self._session.feed(data))
                if isinstance(event, HandshakeDone)
            ]
            data = self._client.data_to_send()
        self._inputs = ready[0].inputs
        self._effective_speed = EffectiveSpeed()
        self._inbox, self._outbox = deque(), deque()
        #: The joints of the arm in each cycle.
        self.joints = []
        (text,) = UploadDecoder().feed(program.read_bytes())
        self.controller.programs.submit(text.text)

    @property
    def q(self):
        return self.controller.motion.q

    @property
    def log(self):
        return list(self.controller.messages.log)

    def cycle(self, take, *, delay=0):
        """
        Run a cycle: the robot's, then its packets, then the set-points from ``take(feedback)``.

        :param delay: the number of packets that stay on the wire after the cycle.
        """
        self.controller.step()
        self.joints.append(self.q)
        for event in self._client.feed(b''.join(self._session.packages())):
            if isinstance(event, DataReceived):
                self._inbox.append(feedback_from_rtde(event.values, self._effective_speed))
        while len(self._inbox) > delay:
            feedback = self._inbox.popleft()
            row = take(feedback)
            if row is not None:
                self._session.feed(self._inputs.pack(list(row)))

    @property
    def time(self):
        return self.controller.time
