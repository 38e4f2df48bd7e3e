# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Identification of the laws of motion of an arm from recordings of it.

:func:`~.identify.identify` is the door: recordings in, estimates with intervals out.
:mod:`~.live_run` makes recordings: it runs the motions of :mod:`~.law_experiments` on a robot.
``doc/identify.md`` says how each law is estimated.
"""
