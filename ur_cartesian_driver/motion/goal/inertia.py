# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The inertia of a payload, as in ``set_target_payload`` of the script manual."""

from __future__ import annotations

from collections.abc import Sequence

#: Largest moment or product of inertia that the controller accepts [kg m^2].
MAX_INERTIA = 133.0
#: Longest time in which the controller changes to a payload [s]; a longer one must be a mistake.
MAX_TRANSITION_TIME = 30.0

COMPONENTS = ('xx', 'yy', 'zz', 'xy', 'xz', 'yz')
_MOMENTS = 3


def inertia_problem(inertia: Sequence[float]) -> str:
    """
    Return the fault of an inertia [kg m^2], as a clause; '' = none.

    :param inertia: empty, or moments and products of inertia in the order of :data:`COMPONENTS`.
    """
    if len(inertia) not in (0, len(COMPONENTS)):
        return f'has {len(inertia)} numbers, not {len(COMPONENTS)} ({", ".join(COMPONENTS)})'
    for i, (component, value) in enumerate(zip(COMPONENTS, inertia, strict=False)):
        low = 0.0 if i < _MOMENTS else -MAX_INERTIA
        if not low <= value <= MAX_INERTIA:  # NaN fails, too
            return f'has {component} = {value:g} kg m^2, outside {low:g} to {MAX_INERTIA:g}'
    return ''
