# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Service calls beside motions: dashboard, TCP, payload, outputs, recovery."""
