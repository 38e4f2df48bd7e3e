# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Chromium, at the path that ``--browser`` gives; playwright drives it."""

import pytest

#: Software renders the pages: no GPU in CI.
ARGUMENTS = ('--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader')


@pytest.fixture(scope='module')
def browser(request):
    playwright = pytest.importorskip('playwright.sync_api')
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(
            executable_path=request.config.getoption('browser'), args=ARGUMENTS
        )
        yield running
        running.close()
