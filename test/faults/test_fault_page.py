# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page about faults is generated from the tested table."""

import importlib.util

from checkout import CHECKOUT, needs_checkout

SCRIPT = CHECKOUT / 'scripts' / 'make_faults.py'

pytestmark = needs_checkout


def test_the_page_about_faults_is_that_of_the_table():
    spec = importlib.util.spec_from_file_location('make_faults', SCRIPT)
    make_faults = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make_faults)
    assert make_faults.PAGE.read_text(encoding='utf-8') == make_faults.page(), (
        'run python scripts/make_faults.py'
    )
