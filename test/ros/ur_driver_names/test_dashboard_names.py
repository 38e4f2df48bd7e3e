# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The dashboard client's services, called as the UR driver's integration tests call them."""

import pytest

pytestmark = pytest.mark.slow


def test_the_arm_starts_as_in_the_integration_tests(ur):
    ur.start_robot()
    assert ur.io('resend_robot_program').success
