# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Record every motion in its own file, written while the motion runs.

Packets are 2 ms apart, and a disk may take longer than that at any time. So a packet is copied
into a preallocated buffer (a few microseconds), and a separate thread writes full buffers. The
number of buffers is fixed: if the disk is too slow, rows are lost (the recording counts them), but
the motion is not delayed and memory does not grow. A recording that cannot be written ends with a
warning; the motion goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from datetime import datetime, UTC
import json
from math import inf, nan
from pathlib import Path
from queue import Empty, SimpleQueue
import threading
from time import sleep
from typing import Any, TYPE_CHECKING

import numpy as np

from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.recordings import recording_format as disk
from ur_cartesian_driver.driver.recordings.recording_folder import RecordingFolder
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.goal.output_names import output_text
from ur_cartesian_driver.motion.plan.plan import Plan, ReferencePath
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rtde_state import RobotState

if TYPE_CHECKING:
    from ur_cartesian_driver.planning.options import PlanningOptions

#: Rows of a buffer; number of buffers; longest time until a buffer is written [s]: a killed
#: process loses the rows of at most this time.
BUFFER_ROWS, BUFFER_COUNT, FLUSH_PERIOD = 256, 8, 0.5
#: At most this many jobs wait for the disk; further events and pieces of the plan are dropped.
MAX_PENDING_JOBS = 1000
#: Pause of the finisher after each small part of a file [s]: if a thread never pauses, the other
#: threads wait 5 ms and more for the interpreter.
YIELD_PAUSE = 0.0002
#: Largest number of segments and slow stretches with a line in the recorded report.
MAX_RECORDED_LINES = 1000
MEGABYTE = 1_000_000


def plan_metadata(plan: Plan, options: PlanningOptions) -> str:
    """Return the metadata that only the planning process has, as JSON: report and options."""
    return json.dumps(
        {
            'report': plan.short_report(MAX_RECORDED_LINES),
            'frame_id': plan.goal.frame_id,
            'controlled_frame': plan.goal.controlled_frame,
            'planning': _parameters(options),
        },
        default=str,
    )


def motion_metadata(
    job: MotionJob,
    *,
    robot: Mapping[str, str | int],
    parameters: DriverConfig,
    plan_metadata_json: str = '',
    mode: str = '',
) -> dict[str, Any]:
    """
    Return the metadata of a motion that begins now.

    :param robot: the robot's model, PolyScope version, motion version and serial number.
    :param parameters: the configuration of the driver.
    :param plan_metadata_json: the result of :func:`plan_metadata`; '' = there is none.
    :param mode: the kind of a motion without a plan; '' = the motion has a plan.
    """
    known = json.loads(plan_metadata_json) if plan_metadata_json else {}
    planning = known.pop('planning', {})
    return {
        'format': disk.FORMAT,
        'created': datetime.now(UTC).isoformat(timespec='milliseconds'),
        'robot': dict(robot),
        'execution': mode or job.execution.name,
        'points': 0 if mode else int(job.reference.point[-1]) + 1,
        'duration': job.duration,
        'due': job.due,
        'keep_open': job.keep_open,
        'T_base_frame': job.T_base_frame.row(),
        'moving_frame': _moving_frame(job),
        'T_flange_tcp': (job.T_flange_tcp or job.T_flange_active).row(),
        'T_tcp_controlled': job.T_tcp_controlled.row(),
        'path_tolerance': asdict(job.path_tolerance),
        'goal_tolerance': asdict(job.goal_tolerance),
        'pulse_outputs': [output_text(*output) for output in job.pulse_outputs],
        **known,
        'parameters': {**_parameters(parameters), **planning},
        'outcome': None,
        'rows_left_out': 0,
        'trouble': '',
    }


def _moving_frame(job: MotionJob) -> dict[str, Any] | None:
    """Return the frame on the part and the fixed tool, if the frame of the path moves."""
    frame = job.moving_frame
    if frame is None:
        return None
    return {
        'T_flange_frame': frame.T_flange_frame.row(),
        'T_base_tool': frame.T_base_tool.row(),
    }


class Recorder:
    """Collects states and events on one thread, and writes them on another."""

    def __init__(self, directory: str, max_size: float, warn: Callable[[str], None]) -> None:
        """
        Keep the settings; no file is made before :meth:`start`.

        :param directory: directory of the files; empty = nothing is recorded.
        :param max_size: largest size of all files together [MB]; the oldest files are removed.
        :param warn: called with the sentence of each warning, on a thread of the recorder.
        """
        self._directory, self._max_size, self._warn = directory, max_size * MEGABYTE, warn
        self._last_warning = ''
        #: Writes the folder of a motion while the motion runs; None = not started yet.
        self._writer: _Worker | None = None
        #: Slowly makes one file from the folder after the motion; None = not started yet.
        self._finisher: _Worker | None = None
        self._is_closing = False
        #: The folder of the running motion; apart from ``lost_rows`` and ``is_plan_whole``,
        #: only the writer uses it.
        self._folder: RecordingFolder | None = None
        # Buffers for rows: the buffer being filled, the bytes used in it, and the free buffers.
        self._buffer, self._used = bytearray(), 0
        self._free_buffers: SimpleQueue[bytearray] = SimpleQueue()
        #: Start of the motion by the controller's clock [s]. From then on: time of the newest
        #: packet, and time at which the buffer must be written [s].
        self._start_time = self._time = self._flush_due = 0.0
        self._digital, self._analog = -1, (nan, nan)
        #: The previous goal's count of begun points, while the robot still reports it.
        self._stale_points_begun: int | None = None

    @property
    def is_recording(self) -> bool:
        """Return whether a motion is being recorded."""
        return self._folder is not None

    # ---- states and events ---------------------------------------------------------------------

    def start(self, job: MotionJob, metadata: dict[str, Any], state: RobotState) -> None:
        """
        Begin the recording of a motion.

        :param metadata: the metadata, see :func:`motion_metadata`.
        :param state: the newest packet, whose time becomes time 0.
        """
        if not self._directory:
            return
        if self._writer is None:
            self._start_workers()
        self._folder = folder = RecordingFolder(
            Path(self._directory).expanduser(), metadata, self._max_size, self._warn_once
        )
        self._start_time, self._time = state.timestamp, 0.0
        self._flush_due, self._used = FLUSH_PERIOD, 0
        self._stale_points_begun = state.points_begun
        self._submit(folder, folder.open, always=True)
        if metadata['points']:
            self.add_plan(job.reference, -inf)
        count = metadata['points']
        points = f'{count} point{"" if count == 1 else "s"}'
        self.add_event('start', f'{metadata["execution"]}, {points}')
        self.add_state(state)

    def add_plan(self, reference: ReferencePath, since: float) -> None:
        """
        Record the planned path, or a piece that replaces its end.

        :param since: start of the piece [s].
        """
        if (folder := self._folder) is None:
            return
        rows = np.empty(len(reference.time), dtype=disk.PLANNED_DTYPE)
        rows['time'], rows['pose'] = reference.time, reference.poses
        rows['point'] = reference.point
        if not self._submit(folder, lambda: folder.write_plan(rows, since)):
            folder.is_plan_whole = False

    def add_state(
        self, state: RobotState, waypoint: int = -1, buffered: float = nan, lag: float = nan
    ) -> None:
        """
        Record a packet.

        :param waypoint: the point of the goal to which the arm moves.
        :param buffered: motion time that the robot has received and not yet run [s].
        :param lag: the time by which the arm lags the newest set-point [s]; NaN = unknown.
        """
        if (folder := self._folder) is None:
            return
        points_begun = state.points_begun
        if points_begun == self._stale_points_begun:
            points_begun = 0
        else:
            self._stale_points_begun = None
        self._time = time = state.timestamp - self._start_time
        disk.EXECUTED_STRUCT.pack_into(
            self._buffer,
            self._used,
            time,
            *state.actual_tcp_pose.row(),
            *state.target_tcp_pose.row(),
            *state.actual_tcp_twist,
            *state.target_tcp_twist,
            *state.actual_q,
            *state.target_q,
            *state.actual_qd,
            *state.target_qd,
            *state.actual_tcp_wrench,
            lag,
            buffered,
            state.speed_scaling,
            state.target_speed_fraction,
            *self._analog,
            self._digital,
            state.pulse_counts,
            points_begun,
            waypoint,
            state.robot_mode,
            state.safety_mode,
            state.runtime_state,
        )
        self._used += disk.EXECUTED_STRUCT.size
        if self._used == len(self._buffer) or time >= self._flush_due:
            self._flush(folder)

    def add_signals(self, signals: Signals) -> None:
        """Keep the newest outputs for the next recorded packets."""
        out = signals.outputs
        flags = (*out.standard, *out.configurable, *out.tool)
        self._digital = sum(1 << i for i, flag in enumerate(flags) if flag)
        self._analog = (signals.analog_outputs[0].value, signals.analog_outputs[1].value)

    def add_event(self, kind: str, text: str) -> None:
        """Record an event that no column shows."""
        if (folder := self._folder) is not None:
            event = self._time, kind, text
            self._submit(folder, lambda: folder.write_event(event))

    def end(self, outcome: Outcome) -> None:
        """End the recording; other threads then make its file."""
        if (folder := self._folder) is None:
            return
        self._flush(folder)
        self.add_event('end', f'{outcome.code.name}: {outcome.text}')
        self._folder = None
        known = {
            'code': outcome.code.value,
            'name': outcome.code.name,
            'text': outcome.text,
            'report': outcome.report,
        }
        self._submit(folder, lambda: folder.close(known), always=True)
        if (writer := self._writer) is not None and (finisher := self._finisher) is not None:
            writer.submit(
                lambda: finisher.submit(
                    lambda: folder.run_guarded(lambda: folder.finish(self._yield_cpu))
                )
            )

    def close(self, timeout: float) -> None:
        """Wait for each worker up to ``timeout`` [s]; an unfinished recording stays a folder."""
        if (folder := self._folder) is not None:
            self._flush(folder)
            self._folder = None
            self._submit(folder, folder.abandon, always=True)
        self._is_closing = True
        if self._writer is not None and self._finisher is not None:
            self._writer.end(timeout)
            self._finisher.end(timeout)
        self._writer = self._finisher = None

    # ---- inside -------------------------------------------------------------------------------

    def _flush(self, folder: RecordingFolder) -> None:
        """Have the filled rows written, and go on in another buffer."""
        # write() keeps this queue: a writer that outlives close() must not put its buffer into
        # the queue of the next recording.
        buffer, used, free_buffers = self._buffer, self._used, self._free_buffers
        self._used, self._flush_due = 0, self._time + FLUSH_PERIOD
        try:
            self._buffer = free_buffers.get_nowait()
        except Empty:  # all buffers wait for the disk: these rows are lost
            folder.lost_rows += used // disk.EXECUTED_STRUCT.size
            return

        def write() -> None:
            folder.run_guarded(lambda: folder.write_rows(memoryview(buffer)[:used]))
            free_buffers.put(buffer)

        if self._writer is not None:
            self._writer.submit(write)  # at most one waiting job for each buffer

    def _submit(
        self, folder: RecordingFolder, work: Callable[[], None], *, always: bool = False
    ) -> bool:
        """Give the writer a job, unless too many jobs wait; return whether it took the job."""
        writer = self._writer
        if writer is None or (writer.jobs.qsize() >= MAX_PENDING_JOBS and not always):
            return False
        writer.submit(lambda: folder.run_guarded(work))
        return True

    def _start_workers(self) -> None:
        size = BUFFER_ROWS * disk.EXECUTED_STRUCT.size
        self._buffer, self._free_buffers = bytearray(size), SimpleQueue()
        for _ in range(BUFFER_COUNT - 1):
            self._free_buffers.put(bytearray(size))
        self._is_closing = False
        self._writer, self._finisher = _Worker('recorder'), _Worker('recorder, finishing')

    def _yield_cpu(self) -> None:
        """Yield the interpreter to the robot loop, which may be waiting for it."""
        if not self._is_closing:
            sleep(YIELD_PAUSE)

    def _warn_once(self, sentence: str) -> None:
        """Warn, unless the last warning was the same."""
        if sentence != self._last_warning:
            self._last_warning = sentence
            self._warn(sentence)


class _Worker:
    """A thread that does one job after the other; it does not keep the process alive."""

    def __init__(self, name: str) -> None:
        self.jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Callable[[], None]) -> None:
        """Queue a job."""
        self.jobs.put(job)

    def end(self, timeout: float) -> None:
        """Wait until all jobs are done, at most for ``timeout`` [s]."""
        self.jobs.put(None)
        self._thread.join(timeout)

    def _work(self) -> None:
        while (job := self.jobs.get()) is not None:
            job()


def _parameters(options: DriverConfig | PlanningOptions) -> dict[str, Any]:
    """Return the fields of a dataclass that JSON can hold."""
    return {
        f.name: value
        for f in fields(options)
        if isinstance(value := getattr(options, f.name), bool | int | float | str | tuple)
    }
