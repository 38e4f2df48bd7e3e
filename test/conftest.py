# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests."""

from hypothesis import settings

# A machine that does something else for a moment is no defect.
settings.register_profile('any machine', deadline=None)
settings.load_profile('any machine')
