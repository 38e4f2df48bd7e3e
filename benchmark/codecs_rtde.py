# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to pack and unpack an RTDE package, and to convert it to a robot state."""

from __future__ import annotations

from collections.abc import Iterator
import struct

from figures import Figure, seconds_each

from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.robot.rtde.state_decoding import robot_state_from_rtde, STATE_FIELDS

NAME = 'RTDE, per package of the driver'


def run(quick: bool) -> Iterator[Figure]:
    """Measure with the driver's own recipe."""
    budget = 0.1 if quick else 0.5
    recipe = Recipe(STATE_FIELDS, [OUTPUT_TYPES[name] for name in STATE_FIELDS])
    values = recipe.zeros()
    frame = recipe.pack(values)
    payload = frame[3:]
    plain = struct.Struct(f'>{len(payload) // 8}d')
    numbers = plain.unpack(payload[: plain.size])
    for name, function, baseline, than in (
        (
            'pack',
            lambda: recipe.pack(values),
            lambda: plain.pack(*numbers),
            'struct.pack of as many bytes',
        ),
        (
            'unpack',
            lambda: recipe.unpack(payload),
            lambda: plain.unpack(payload[: plain.size]),
            'struct.unpack of as many bytes',
        ),
        (
            'values to RobotState',
            lambda: robot_state_from_rtde(values),
            lambda: recipe.unpack(payload),
            'unpack',
        ),
    ):
        yield Figure(
            benchmark=NAME,
            name=name,
            value=1e6 * seconds_each(function, budget),
            unit='us',
            baseline=1e6 * seconds_each(baseline, budget),
            than=than,
            note=f'{len(frame)} bytes',
        )
