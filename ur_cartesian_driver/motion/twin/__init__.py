# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The laws by which a controller moves its arm, as assumed, and as measured on one arm.

:mod:`~.laws` is the table of laws, with the values that are assumed for any arm. A
:class:`~.twin.Twin` holds what was measured on one arm; :mod:`~.twin_file` reads and writes it as
``twin.yaml``.
"""
