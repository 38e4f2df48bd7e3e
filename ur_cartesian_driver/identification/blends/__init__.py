# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Identification of blends: the curves by which a controller joins two moves without a stop.

:mod:`~.blend_corners` finds the straight stretches of a chain of moves and where they meet,
:mod:`~.blend_fit` the law of the curve between two of them, and
:func:`~.blend_laws.blend_laws` what all blends of all recordings say.
"""
