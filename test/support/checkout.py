# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The checkout with these tests; tests of an installed package have none."""

from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]

#: Marks tests that read documents, examples or scripts: a package installs none of them.
needs_checkout = pytest.mark.skipif(
    not (CHECKOUT / 'doc').is_dir(), reason='only a checkout has this'
)
