# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Identification of servoj: how an arm follows its set-points, and how it brakes when they stay away.

:mod:`~.servo_filter` finds the filter of one joint in one motion, :func:`~.servo_laws.servo_laws`
what all motions of all recordings say.
"""
