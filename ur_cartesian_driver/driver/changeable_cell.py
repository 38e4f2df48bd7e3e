# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The cell of a driver; the owner and running goals change it.

A change replaces the planning options of the driver as a whole, so that a plan never sees half a
change. A separate thread checks the rest of a running motion in the new cell; the robot loop never
waits for that check.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
import logging
import threading

from ur_cartesian_driver.driver.callbacks import run_callback
from ur_cartesian_driver.driver.motion_handle import ActiveMotion, MotionHandle
from ur_cartesian_driver.driver.running_motions import RunningMotions
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, DEFAULT_CLEARANCE
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.goal.goal import PartChange
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.cell_stretches import attached, changed, released
from ur_cartesian_driver.planning.preflight.path_left import PathLeft, spline_of
from ur_cartesian_driver.planning.request.point_events.part_changes import check_part_changes


class ChangeableCell(ABC):
    """The part of a driver that keeps its cell."""

    options: PlanningOptions
    _log: logging.Logger
    _running: RunningMotions
    #: Guards the replacement of the options, and the attributes below; set by the driver.
    _cell_lock: threading.Lock
    _cell_listeners: list[Callable[[Cell], None]]
    #: Number of changes so far. If it has grown during a check of the running motion, the check
    #: starts again.
    _cell_changes = 0
    _is_checking = False

    @property
    @abstractmethod
    def arm(self) -> Arm:
        """The arm's kinematics."""

    @property
    @abstractmethod
    def state(self) -> RobotState | None:
        """The newest robot state."""

    @abstractmethod
    def _end_session_for(self, motion: MotionHandle, by: str) -> None:
        """End a motion if it is a live session; ``by``: what preempts it, as a noun phrase."""

    @property
    def cell(self) -> Cell:
        """The present bodies of the cell, including bodies that the tool carries."""
        return self.options.cell

    def add_cell_listener(self, callback: Callable[[Cell], None]) -> None:
        """Call back with each new cell, in the thread that has changed it."""
        self._cell_listeners.append(callback)

    def change_cell(
        self,
        bodies: Cell | Iterable[CellBody] = (),
        *,
        remove: Iterable[str] = (),
        attach: Iterable[str] = (),
        release: Iterable[str] = (),
        may_touch: Iterable[frozenset[str]] = (),
    ) -> Cell:
        """
        Change the bodies of the cell; make all changes, or none.

        If the rest of a running goal would now touch a body, the goal soon ends as COLLISION. A
        live session ends as PREEMPTED; the next target begins another session.

        :param bodies: bodies to add; they replace bodies of the same names. A ``Cell``
            brings its clearance for these bodies and its pairs that may touch.
        :param remove: names of bodies to remove, before all other changes.
        :param attach: names of bodies that the tool picks up at their present poses.
        :param release: names of bodies that the tool leaves at their present poses.
        :param may_touch: pairs of names that may touch from now on.
        :returns: the new cell.
        :raises InvalidGoal: a change cannot be made; the text says why.
        :raises RobotNotReady: the robot does not report where the tool is.
        """
        with self._cell_lock:
            cell = self.options.cell
            for name in _names('remove', remove):
                cell = _made('remove', cell.without, name)
            cell = _with_bodies(cell, bodies)
            if may_touch:
                pairs = cell.may_touch | frozenset(map(frozenset, may_touch))
                cell = _made('may_touch', partial(replace, cell, may_touch=pairs))
            for what, make, names in (
                ('attach', attached, attach),
                ('release', released, release),
            ):
                for name in _names(what, names):
                    state = self._state_with_tool()
                    where = self.arm, state.actual_q, state.T_flange_tcp
                    cell = _made(what, make, cell, name, *where)
            self.options = replace(self.options, cell=cell)
        self._check_running_soon()
        self._tell_listeners(cell)
        return cell

    def _tell_listeners(self, cell: Cell) -> None:
        for callback in self._cell_listeners:
            run_callback(callback, cell, self._log)

    def _state_with_tool(self) -> RobotState:
        state = self.state
        if state is None:
            raise RobotNotReady(
                'The robot does not report its state, so it is not known where the tool is.'
            )
        return state

    # ---- changes by goals ---------------------------------------------------------------------

    def _take_part_change(self, change: PartChange, q: Joints, T_flange_tcp: Pose) -> None:
        """Attach or release a body; ``q``: the joints at the point of the change [rad]."""
        with self._cell_lock:
            try:
                cell = changed(self.options.cell, change, self.arm, q, T_flange_tcp)
            except ValueError as error:  # the cell has been changed meanwhile
                self._log.warning(
                    'The cell stays as it is at point %d of the goal: %s.', change.waypoint, error
                )
                return
            self.options = replace(self.options, cell=cell)
        self._tell_listeners(cell)

    # ---- plans and motions in another cell ----------------------------------------------------

    def _check_cell_of(self, plan: Plan, planned_in: Cell | None) -> Cell:
        """
        Return the present cell; check the plan in it first, if it was made in another one.

        :param planned_in: the cell of the plan; None = unknown.
        :raises GoalRefused: the plan would touch a body, or changes bodies that do not exist.
        """
        options = self.options
        if planned_in == options.cell:
            return options.cell
        if options.cell or plan.goal.part_changes:
            check_part_changes(plan.goal, options.cell)
            try:
                PathLeft.of(plan, spline_of(plan)).check(
                    self.arm, options, plan.start, plan.goal.part_changes
                )
            except GoalRefused as error:
                raise error.reworded(f'The cell is not that of the plan: {error}') from None
        return options.cell

    def _check_running_soon(self) -> None:
        """Start a thread that checks the rest of the running motion, unless one does already."""
        with self._cell_lock:
            self._cell_changes += 1
            if self._is_checking or not self._running.active:
                return
            self._is_checking = True
        threading.Thread(target=self._check_running, name='cell check', daemon=True).start()

    def _check_running(self) -> None:
        while True:
            with self._cell_lock:
                changes = self._cell_changes
            for active in self._running.active:
                self._end_session_for(active.motion, 'a session in the changed cell')
                if reason := self._touches(active):
                    active.motion.stop_before_collision(reason)
            with self._cell_lock:
                if changes == self._cell_changes:
                    self._is_checking = False
                    return

    def _touches(self, active: ActiveMotion) -> str:
        """Return the reason why a motion must end in the present cell, as a clause; '' = none."""
        try:
            if active.path is not None:
                active.path.check(self.arm, lambda: self.options)
        except GoalRefused as error:
            return f'the cell has changed, and the rest of the path would touch: {error}'
        except Exception as error:  # a motion that cannot be checked must not go on
            self._log.exception('checking a motion in the changed cell failed')
            return (
                'the cell has changed, and the rest of the path cannot be checked '
                f'({type(error).__name__}: {error})'
            )
        return ''


def _with_bodies(cell: Cell, bodies: Cell | Iterable[CellBody]) -> Cell:
    """
    Return a cell with bodies added; they replace bodies of the same names.

    :raises InvalidGoal: an item is no body.
    """
    given = list(bodies.bodies if isinstance(bodies, Cell) else bodies)
    for body in given:
        if not isinstance(body, CellBody):
            raise InvalidGoal('bodies', f'contains {body!r:.60}, which is no CellBody')
    if not isinstance(bodies, Cell):
        return cell.with_bodies(given)
    if bodies.clearance != DEFAULT_CLEARANCE:
        given = [replace(body, clearance=bodies.clearance_of(body)) for body in given]
    cell = cell.with_bodies(given)
    return replace(cell, may_touch=cell.may_touch | bodies.may_touch)


def _names(what: str, names: Iterable[str]) -> list[str]:
    """
    Return names in a list; a single text counts as one name.

    :raises InvalidGoal: a name is no text.
    """
    given = [names] if isinstance(names, str) else list(names)
    for name in given:
        if not isinstance(name, str):
            raise InvalidGoal(what, f'contains {name!r:.60}, which is no name of a body')
    return given


def _made(what: str, make: Callable[..., Cell], *arguments: object) -> Cell:
    """
    Return the cell that ``make`` returns; ``what`` names the change in the error.

    :raises InvalidGoal: the change cannot be made.
    """
    try:
        return make(*arguments)
    except ValueError as error:
        raise InvalidGoal(what, f'is not possible: {str(error).rstrip(".")}') from None
