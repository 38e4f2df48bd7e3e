# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pages of motions in a real browser that has no network.

Only with ``--browser PATH``: the path of Chromium, which playwright drives.
"""

from io import BytesIO
from pathlib import Path

from matplotlib.image import imread
import numpy as np
import pytest

from ur_cartesian_driver.cli import main

playwright = pytest.importorskip('playwright.sync_api')

EXAMPLES = sorted(Path(__file__).parents[2].glob('config/examples/*.yaml'))
#: Software renders the page: no GPU in CI.
ARGUMENTS = ('--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader')
#: Right of the text, above the time bar.
SIZE = {'width': 640, 'height': 360}
VIEW = {'x': 290, 'y': 0, 'width': 350, 'height': 310}


@pytest.fixture(scope='module')
def browser(request):
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(
            executable_path=request.config.getoption('browser'), args=ARGUMENTS
        )
        yield running
        running.close()


class Tab:
    """A page in the browser, with what went wrong on it."""

    def __init__(self, browser):
        self.page = browser.new_page(viewport=SIZE)
        self.problems, self.requests = [], []
        self.page.on('pageerror', lambda error: self.problems.append(str(error)))
        self.page.on('console', self._on_console)
        self.page.on('request', lambda request: self.requests.append(request.url))

    def _on_console(self, message):
        if message.type == 'error':
            self.problems.append(message.text)

    def open(self, file):
        self.page.goto(file.as_uri())
        self.page.wait_for_selector('canvas')
        self.page.wait_for_selector('.mantine-Slider-track')

    def at(self, part):
        """Move the time bar to a part of its length, and return the picture of the scene."""
        self.page.locator('button:has(svg)').first.focus()
        box = self.page.locator('.mantine-Slider-track').bounding_box()
        x, y = box['x'] + part * box['width'], box['y'] + 0.5 * box['height']
        self.page.mouse.click(x, y)
        self.page.wait_for_timeout(400)
        return imread(BytesIO(self.page.screenshot(clip=VIEW)), format='png')[:, :, :3]


@pytest.fixture
def tab(browser):
    opened = Tab(browser)
    yield opened
    opened.page.close()


@pytest.mark.parametrize('example', EXAMPLES, ids=lambda path: path.stem)
def test_the_page_of_an_example_plays_without_a_network(example, tab, tmp_path):
    file = tmp_path / 'page.html'
    assert main(['show', str(example), '-o', str(file)]) == 0
    assert file.stat().st_size < 4e6
    tab.open(file)
    assert 'tightest margin' in tab.page.locator('aside').inner_text()
    early, late = tab.at(0.1), tab.at(0.6)
    assert early.std() > 0.02
    assert np.abs(early - late).mean() > 1e-4
    assert tab.problems == []
    assert [url for url in tab.requests if not url.startswith(('file:', 'data:', 'blob:'))] == []


def test_the_links_choose_what_the_colours_say(tab, tmp_path):
    file = tmp_path / 'page.html'
    assert main(['show', 'seam', '-o', str(file)]) == 0
    tab.open(file)
    by_type = tab.at(0.0)
    with tab.page.expect_navigation(wait_until='load'):
        tab.page.get_by_text('by speed').click()
    tab.page.wait_for_selector('.mantine-Slider-track')
    assert np.abs(by_type - tab.at(0.0)).max() > 0.2
    assert tab.problems == []


def test_a_refused_goal_shows_where(tab, tmp_path):
    file = tmp_path / 'page.html'
    assert main(['show', 'square', '--ur-type', 'ur3e', '-o', str(file)]) == 1
    tab.page.goto(file.as_uri())
    tab.page.wait_for_selector('canvas')
    tab.page.wait_for_timeout(1500)
    picture = imread(BytesIO(tab.page.screenshot(clip=VIEW)), format='png')
    red = picture[:, :, 0] - np.maximum(picture[:, :, 1], picture[:, :, 2]) > 0.35
    assert red.sum() > 4
    assert 'Refused' in tab.page.locator('aside').inner_text()
