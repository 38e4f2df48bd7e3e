# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Writes the safe values of outputs if the robot program is paused or gone.

Each kind of output is written separately: if another client holds the inputs of one kind, the
other kinds are still set.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from dataclasses import replace
from math import isclose
from typing import Any

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.events import OutputsSecured
from ur_cartesian_driver.motion.goal.goal import SafeOutput
from ur_cartesian_driver.motion.goal.output_names import output_name
from ur_cartesian_driver.robot.services.rtde_input_writer import (
    joint_write,
    value_before,
    write_and_compare,
)
from ur_cartesian_driver.robot.services.service_calls import SetOutputCall

#: Longest time for the outputs of one kind, with all attempts; a goal that ends waits for it [s].
#: Pause before another attempt [s]: the inputs of a closed connection are not free at once.
WRITE_TIMEOUT, RETRY_PERIOD = 0.25, 0.02


async def write_outputs(
    host: str, port: int, outputs: Iterable[SafeOutput], before: dict[str, Any]
) -> OutputsSecured:
    """
    Write the values of outputs.

    :param before: filled with the RTDE outputs reported before the first attempt; pass it to
        later attempts.
    :return: the outputs that have changed, with their old values, and the failures.
    """
    by_kind: dict[int, list[SafeOutput]] = {}
    for output in outputs:
        by_kind.setdefault(output.output, []).append(output)
    results = await asyncio.gather(
        *(_write(host, port, group, before) for group in by_kind.values())
    )
    return OutputsSecured(
        changed=tuple(output for changed, _ in results for output in changed),
        failure=' '.join(failure for _, failure in results if failure),
    )


async def _write(
    host: str, port: int, outputs: list[SafeOutput], before: dict[str, Any]
) -> tuple[list[SafeOutput], str]:
    """Write outputs of one kind; return the changed ones with their old values, or a failure."""
    calls = [
        SetOutputCall(kind=o.output, pin=o.pin, value=o.value, domain=o.domain) for o in outputs
    ]
    write, reason = joint_write(calls), f'the robot did not answer within {WRITE_TIMEOUT:g} s'
    try:
        async with asyncio.timeout(WRITE_TIMEOUT):
            while True:
                try:
                    done = await write_and_compare(host, port, write, before)
                    break
                except (OSError, DriverError) as error:
                    reason = str(error).rstrip('.')
                    await asyncio.sleep(RETRY_PERIOD)
    except TimeoutError:
        done = False
    if not done:
        names = ' and '.join(output_name(output.output, output.pin) for output in outputs)
        return [], f'The {names} may not have been set: {reason}.'
    old_calls = [value_before(call, before) for call in calls]
    return [
        replace(output, value=old.value, domain=old.domain)
        for output, call, old in zip(outputs, calls, old_calls, strict=True)
        if old.domain is not call.domain or not isclose(old.value, call.value, abs_tol=0.02)
    ], ''
