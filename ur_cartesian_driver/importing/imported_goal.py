# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Makes the goal from the points of a file: scale, orientations, speeds, blends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from ur_cartesian_driver.importing.import_options import ImportOptions, ToolOrientation
from ur_cartesian_driver.importing.imported_path import (
    BrokenFile,
    COLUMNS,
    ImportedPath,
    ImportNote,
    ImportNotes,
    MAX_DISTANCE,
    SAME_POINT,
    SAME_TURN,
    TYPES_WITH_SPEED,
)
from ur_cartesian_driver.importing.path_times import with_times
from ur_cartesian_driver.importing.simplification import simplify
from ur_cartesian_driver.motion.geometry.arrays import Floats, Int64s
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    cross_rows,
    distance_rows,
    keep_hemisphere,
    normalized_rows,
    transform_rows,
)
from ur_cartesian_driver.motion.goal.goal import CORNER_DEVIATION, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import (
    GoalTable,
    rows_where,
    SegmentRows,
    WaypointRows,
)

#: Orientation of a tool that points straight down, with its x along y of the frame.
_DOWN = (sqrt(0.5), sqrt(0.5), 0.0, 0.0)
#: Largest fraction of a line that one blend uses.
_BLEND_SHARE = 0.45
#: Shortest time [s] of a blend of an arc or a process: a blend that is passed within one cycle
#: would be refused, and the longest cycle is 8 ms. Assumed speed [m/s] of a segment without one.
_MIN_BLEND_TIME, _UNKNOWN_SPEED = 0.01, 0.25
_MIN_BLEND = 1e-4
#: Smallest height [m] of an arc: instead of a flatter arc the robot moves in a straight line.
_MIN_ARC_HEIGHT = 1e-5
#: The types of motions whose corners can be rounded.
_ROUNDED_TYPES = (
    SegmentType.AUTO,
    SegmentType.LINEAR,
    SegmentType.PROCESS,
    SegmentType.CIRCULAR,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedGoal:
    """A goal, and remarks on everything in the file that the goal lacks."""

    goal: GoalTable
    remarks: tuple[ImportNote, ...]
    #: (n,) lines of the file from which the points come; 0 = an option added the point.
    lines: Int64s


def goal_of_path(path: ImportedPath, options: ImportOptions, remarks: ImportNotes) -> ImportedGoal:
    """
    Return the goal of a path, with the options applied.

    :raises BrokenFile: a point is too far away to be right, or lacks the normal that the options
        require, or has a normal of length 0.
    """
    path = _rounded(_scaled(path, options.scale), options, remarks)
    path = replace(path, quaternions=_orientations(path, options, remarks))
    path, rests = _without_repeated(path, remarks)
    path = with_times(path, rests, options, remarks)
    path = _without_flat_arcs(path, remarks)
    if options.simplify:
        before = len(path)
        path = simplify(path, options.simplify, path.quaternions)
        if len(path) < before:
            arcs = int((path.types == SegmentType.CIRCULAR).sum())
            remarks.add(
                0,
                f'{before} points became {len(path)}, of which {arcs} end arcs',
                f'simplify, nowhere farther than {1e3 * options.simplify:g} mm away',
            )
    path = _lifted(path, options, remarks)
    poses = np.hstack((path.positions, path.quaternions))
    keep_hemisphere(poses)
    has_via = ~np.isnan(path.vias[:, 0])
    vias = np.hstack((np.where(has_via[:, None], path.vias, 0.0), path.quaternions))
    if options.origin != IDENTITY:
        poses, vias = transform_rows(options.origin, poses), transform_rows(options.origin, vias)
    speeds, accelerations = _speeds(path, options), _accelerations(path, options)
    times = np.nan_to_num(path.times)
    if times.any():
        for what, values in (('speeds', speeds), ('accelerations', accelerations)):
            if values.any():
                remarks.add(0, f'the {what} of the points', 'their times are kept')
                values[:] = 0.0
    corner = _common_corner(path, options)
    segments = replace(
        SegmentRows.plain(len(path)),
        types=path.types,
        blend_radii=_blends(path, options, speeds, remarks),
        corner_deviations=np.where(path.corners != corner, np.nan_to_num(path.corners), 0.0),
        dwells=np.nan_to_num(path.dwells),
        velocities=speeds,
        accelerations=accelerations,
        vias=vias,
        has_via=has_via,
        arc_modes=path.arc_modes,
    )
    still = np.zeros((len(path), 6))
    goal = GoalTable(
        waypoints=WaypointRows(
            times=times,
            poses=poses,
            twists=still,
            accelerations=still,
            jerks=still,
            postures=path.postures,
        ),
        segments=segments,
        frame_id=options.frame or path.frame,
        controlled_frame=options.tool,
        corner_deviation=corner,
        io_commands=path.outputs,
        input_waits=path.waits,
    )
    return ImportedGoal(goal=goal, remarks=remarks.result(), lines=path.lines)


def _scaled(path: ImportedPath, scale: float) -> ImportedPath:
    if scale != 1.0:
        path = replace(
            path,
            positions=path.positions * scale,
            vias=path.vias * scale,
            blends=path.blends * scale,
            corners=path.corners * scale,
        )
    far = np.abs(path.positions).max(axis=1) > MAX_DISTANCE
    if far.any() or not np.isfinite(path.positions).all():
        row = int(np.argmax(far))
        raise BrokenFile(
            int(path.lines[row]),
            f'the point {_position(path.positions[row])} m is farther than {MAX_DISTANCE:g} m '
            'from the origin; check the unit, or give a scale',
        )
    return path


def _rounded(path: ImportedPath, options: ImportOptions, remarks: ImportNotes) -> ImportedPath:
    """
    Return the path with a corner at every point if any is rounded, else with no corners.

    :raises BrokenFile: a corner is rounded, but a motion is neither a line nor an arc.
    """
    corners, lines = path.corners.copy(), path.lines
    if options.blend:
        for row in rows_where(corners >= 0.0):
            remarks.add(int(lines[row]), 'a corner', 'the option blend takes its place')
        corners[:] = np.nan
    least, most = CORNER_DEVIATION.low, CORNER_DEVIATION.high
    rest = 'the option corner takes its place' if options.corner else 'the arm stops there'
    for row in rows_where((corners > 0.0) & (corners < least)):
        what = f'a corner of {1e3 * corners[row]:.3g} mm'
        remarks.add(int(lines[row]), what, f'less than {1e3 * least:g} mm, {rest}')
        corners[row] = np.nan
    for row in rows_where(corners > most):
        what = f'a corner of {1e3 * corners[row]:.4g} mm'
        remarks.add(int(lines[row]), what, f'made smaller, {1e3 * most:g} mm')
        corners[row] = most
    corners = np.where(np.isnan(corners), options.corner, corners)
    if not (corners > 0.0).any():
        return replace(path, corners=np.full(len(path), np.nan))
    for row in rows_where(~np.isin(path.types, _ROUNDED_TYPES))[:1]:
        raise BrokenFile(
            int(lines[row]),
            f'the motion is {SegmentType(path.types[row]).name}, and only lines and arcs have '
            'rounded corners; give a blend in place of corner',
        )
    for row in rows_where(path.blends > 0.0):
        remarks.add(int(lines[row]), 'blend', 'its corner is rounded in its place')
    return replace(path, corners=corners)


def _common_corner(path: ImportedPath, options: ImportOptions) -> float:
    """
    Return the corner deviation of the whole goal [m]; 0 if the arm stops at any point.

    With a common corner deviation, no point of a goal could demand a stop.
    """
    return options.corner if (path.corners > 0.0).all() else 0.0


def _position(values: Floats) -> str:
    return '(' + ', '.join(f'{value:.6g}' for value in values.tolist()) + ')'


def _orientations(path: ImportedPath, options: ImportOptions, remarks: ImportNotes) -> Floats:
    """Return the orientations of the tool (n, 4)."""
    found = np.tile(np.array(_DOWN), (len(path), 1))
    wanted = options.orientation
    if wanted is ToolOrientation.DOWN:
        if not np.isnan(path.quaternions).all():
            remarks.add(0, 'orientations of the file', 'the tool is to point down')
        return found
    normals = ~np.isnan(path.normals[:, 0])
    if wanted is ToolOrientation.NORMALS and not normals.all():
        row = int(np.argmin(normals))
        raise BrokenFile(
            int(path.lines[row]), 'the point has no normal, from which its orientation is to come'
        )
    if normals.any():
        found[normals] = _against(path.normals[normals], path.lines[normals])
    if wanted is ToolOrientation.FILE:
        given = ~np.isnan(path.quaternions[:, 0])
        found[given] = normalized_rows(path.quaternions[given])
        if not (given | normals).any():
            remarks.add(0, 'no orientations in the file', 'the tool points down')
        elif not (given | normals).all():
            for line in path.lines[~(given | normals)].tolist():
                remarks.add(line, 'no orientation', 'the tool points down there')
    return found


def _against(normals: Floats, lines: Int64s) -> Floats:
    """Return orientations with z against the normals, and x nearest to y (or x) of the frame."""
    lengths = np.linalg.norm(normals, axis=1)
    if not (lengths > 1e-6).all():
        raise BrokenFile(int(lines[int(np.argmin(lengths))]), 'the normal is zero')
    ez = -normals / lengths[:, None]
    # If z is near the frame's y, x would jump at the slightest turn of the surface, so the frame's
    # x is the reference then.
    reference = np.where((np.abs(ez[:, 1]) > 0.95)[:, None], (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    ex = reference - np.einsum('ij,ij->i', reference, ez)[:, None] * ez
    ex = ex / np.linalg.norm(ex, axis=1)[:, None]
    ey = cross_rows(ez, ex)
    return _quaternions_of_axes(ex, ey, ez)


def _quaternions_of_axes(ex: Floats, ey: Floats, ez: Floats) -> Floats:
    """Return the unit quaternions (n, 4) of frames, each computed from its largest component."""
    squares = np.stack(
        (
            1.0 + ex[:, 0] - ey[:, 1] - ez[:, 2],
            1.0 - ex[:, 0] + ey[:, 1] - ez[:, 2],
            1.0 - ex[:, 0] - ey[:, 1] + ez[:, 2],
            1.0 + ex[:, 0] + ey[:, 1] + ez[:, 2],
        ),
        axis=1,
    )
    xy, xz, yz = ey[:, 0] + ex[:, 1], ez[:, 0] + ex[:, 2], ez[:, 1] + ey[:, 2]
    xw, yw, zw = ey[:, 2] - ez[:, 1], ez[:, 0] - ex[:, 2], ex[:, 1] - ey[:, 0]
    x2, y2, z2, w2 = squares.T
    rows = np.array(
        [[x2, xy, xz, xw], [xy, y2, yz, yw], [xz, yz, z2, zw], [xw, yw, zw, w2]]
    )  # (k, component, n)
    best = squares.argmax(axis=1)
    return normalized_rows(rows[best, :, np.arange(len(best))])


def _without_repeated(path: ImportedPath, remarks: ImportNotes) -> tuple[ImportedPath, Floats]:
    """
    Leave out points that repeat the one before: the robot has no motion to them.

    :returns: the path, and the times (n,) [s] for which the tool rests at its points.
    """
    still = (distance_rows(path.positions[1:], path.positions[:-1]) < SAME_POINT) & (
        angle_rows(path.quaternions[1:], path.quaternions[:-1]) < SAME_TURN
    )
    # The ends of arcs are kept, and the points at which the joints turn or the arm rests.
    still &= path.types[1:] != SegmentType.CIRCULAR
    for row in rows_where(still):
        posture = path.postures.get(row + 1)
        still[row] = posture is None or posture == path.postures.get(row)
    still &= ~path.rests[1:]
    rests = np.zeros(len(path))
    if not still.any():
        return path, rests
    # In a slow drift each point is near the previous one, so compare it with the last kept point.
    rows, last = [0], 0
    for row in range(1, len(path)):
        if still[row - 1] and _is_same(path, row, last):
            remarks.add(int(path.lines[row]), 'a point', 'it is where the one before is')
            rests[last] = path.times[row] - path.times[last]
        else:
            rows.append(row)
            last = row
    kept = np.array(rows, dtype=np.int64)
    return path.take(kept), rests[kept]


def _is_same(path: ImportedPath, row: int, other: int) -> bool:
    pair = slice(row, row + 1), slice(other, other + 1)
    return bool(
        distance_rows(path.positions[pair[0]], path.positions[pair[1]])[0] < SAME_POINT
        and angle_rows(path.quaternions[pair[0]], path.quaternions[pair[1]])[0] < SAME_TURN
    )


def _without_flat_arcs(path: ImportedPath, remarks: ImportNotes) -> ImportedPath:
    """Turn each arc that is too flat for the robot, or leads to the first point, into a line."""
    arcs = path.types == SegmentType.CIRCULAR
    if not arcs.any():
        return path
    flat = np.zeros(len(path), dtype=bool)
    flat[0] = arcs[0]
    start, via, end = path.positions[:-1], path.vias[1:], path.positions[1:]
    chord = end - start
    length = np.linalg.norm(chord, axis=1)
    height = np.linalg.norm(cross_rows(via - start, chord), axis=1) / np.maximum(length, 1e-12)
    flat[1:] = arcs[1:] & (height < _MIN_ARC_HEIGHT)
    if not flat.any():
        return path
    for line in path.lines[flat].tolist():
        remarks.add(line, 'an arc', 'it is lower than 0.01 mm, so it is a line')
    return replace(
        path,
        types=np.where(flat, SegmentType.LINEAR, path.types),
        vias=np.where(flat[:, None], np.nan, path.vias),
    )


def _lifted(path: ImportedPath, options: ImportOptions, remarks: ImportNotes) -> ImportedPath:
    """Retract the tool from the surface before a contour that begins elsewhere."""
    rows = [row for row in rows_where(path.lifts) if row]
    if not rows:
        return path
    if not options.lift:
        for row in rows:
            remarks.add(
                int(path.lines[row]), 'a contour begins elsewhere', 'straight to it, without lift'
            )
        return path
    # The row of such a contour becomes three: up from the previous point, across, and down to
    # the row's point.
    count = np.ones(len(path), dtype=np.int64)
    count[rows] = 3
    order = np.repeat(np.arange(len(path)), count)
    first = np.cumsum(count) - count  # the first copy of each row
    raised = np.zeros(len(order), dtype=bool)
    positions = path.positions[order]
    last = first + count - 1
    # Outputs at a point are switched at its last copy: the tool is down again, or not up yet.
    outputs = tuple(replace(o, waypoint=int(last[o.waypoint])) for o in path.outputs)
    waits = tuple(replace(w, waypoint=int(last[w.waypoint])) for w in path.waits)
    lifted = path.quaternions[order]
    for row in rows:
        up = int(first[row])
        positions[up], lifted[up] = path.positions[row - 1], path.quaternions[row - 1]
        raised[[up, up + 1]] = True
    x, y, z, w = lifted.T
    axis = np.stack((2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)), axis=1)
    positions = np.where(raised[:, None], positions - options.lift * axis, positions)
    columns = {name: getattr(path, name)[order] for name in COLUMNS}
    columns |= {
        'times': np.full(len(order), np.nan),
        'dwells': np.where(np.isin(np.arange(len(order)), last), columns['dwells'], np.nan),
        'lines': np.where(raised, 0, columns['lines']),
        'positions': positions,
        'quaternions': lifted,
    }
    return replace(
        path,
        **columns,
        postures={int(last[row]): posture for row, posture in path.postures.items()},
        outputs=outputs,
        waits=waits,
    )


def _speeds(path: ImportedPath, options: ImportOptions) -> Floats:
    """Return the speeds (n,) [m/s]; 0 = the driver chooses the speed."""
    found = _given(path, options.speed, path.speeds)
    travel = np.nan if options.travel_speed is None else options.travel_speed
    return np.nan_to_num(np.where(path.travels, travel, found))


def _accelerations(path: ImportedPath, options: ImportOptions) -> Floats:
    return np.nan_to_num(_given(path, options.acceleration, path.accelerations))


def _given(path: ImportedPath, option: float | None, of_file: Floats) -> Floats:
    """Return the rates of the file, replaced by an option on lines and arcs."""
    if option is None:
        return of_file
    plain = np.isin(path.types, TYPES_WITH_SPEED)
    return np.where(plain, option, of_file)


def _blends(
    path: ImportedPath, options: ImportOptions, speeds: Floats, remarks: ImportNotes
) -> Floats:
    """Return blend radii (n,) that fit between the points [m]; 0 = none fits, the arm stops."""
    if path.is_rounded:
        if stops := int((path.corners[:-1] == 0.0).sum()):
            why = 'the file says so' if options.corner else 'give a corner if it should not'
            remarks.add(0, f'the arm stops at {stops} inner points', why)
        return np.zeros(len(path))
    radii = np.where(np.isnan(path.blends), options.blend, path.blends)
    radii[path.rests] = 0.0
    radii[-1] = 0.0
    if len(path) < 2:
        return radii
    lengths = distance_rows(path.positions[1:], path.positions[:-1])
    fits = radii.copy()
    fits[1:] = np.minimum(fits[1:], _BLEND_SHARE * lengths)
    fits[:-1] = np.minimum(fits[:-1], _BLEND_SHARE * lengths)
    # The first line begins at the arm's unknown position, so its length limits no blend.
    special = np.isin(path.types, (SegmentType.CIRCULAR, SegmentType.PROCESS))
    special[:-1] |= special[1:]
    rates = np.where(speeds > 0.0, speeds, _UNKNOWN_SPEED)
    least = np.where(special, np.maximum(_MIN_BLEND, _MIN_BLEND_TIME * rates), _MIN_BLEND)
    fits[fits < least] = 0.0
    for row in rows_where((fits < radii) & (fits > 0.0)):
        remarks.add(int(path.lines[row]), 'blend', 'made smaller, its lines are short')
    for row in rows_where((radii > 0.0) & (fits == 0.0)):
        remarks.add(int(path.lines[row]), 'blend', 'none fits, the arm stops there')
    stops = int((fits[:-1] == 0.0).sum())
    if stops and not options.blend and np.isnan(path.blends).any():
        why = 'the file says so' if options.corner else 'give a blend or a corner if it should not'
        remarks.add(0, f'the arm stops at {stops} inner points', why)
    return fits
