# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The number of cases of a random test, and their seed.

`make test` draws a tenth of the cases from a fixed seed, so that a red run stays red. `make
random` draws all; RANDOM_SEED=N draws others.
"""

import os
from random import Random

SHARE = float(os.environ.get('RANDOM_SHARE', '0.1'))
SEED = int(os.environ.get('RANDOM_SEED', '1'))


def cases(whole: int) -> int:
    """Return the number of cases in this run, of the number in a whole run; at least one."""
    return max(1, round(SHARE * whole))


def random_of(*name: object) -> Random:
    """Return the generator of one case: the same in every run with this seed."""
    return Random(f'{SEED} {" ".join(map(str, name))}')
