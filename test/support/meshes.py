# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Tests that need the meshes of a robot, which the extra ``collision`` brings."""

import pytest

from ur_cartesian_driver.kinematics.collision_meshes import missing_meshes


def need_meshes(*models: str) -> None:
    """
    Skip the test, with a reason, if meshes are missing.

    ``make test`` installs them and lets no test be skipped.
    """
    for model in models:
        if missing := missing_meshes(model):
            pytest.skip(missing)
