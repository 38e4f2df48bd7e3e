# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The number of cases of a random test, and their seed.

`make test` draws a tenth of them from a fixed seed, so that a red run is red again. `make random`
draws all; RANDOM_SEED=N draws others.
"""

import os
from random import Random

SHARE = float(os.environ.get('RANDOM_SHARE', '0.1'))
SEED = int(os.environ.get('RANDOM_SEED', '1'))


def cases(whole: int) -> int:
    """Return how many of the cases of a whole run are drawn in this one; one at least."""
    return max(1, round(SHARE * whole))


def random_of(*name: object) -> Random:
    """Return the generator of one case: the same in every run with this seed."""
    return Random(f'{SEED} {" ".join(map(str, name))}')
