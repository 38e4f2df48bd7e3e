# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pages of motions in a real browser that has no network.

Only with ``--browser PATH``: the path of Chromium, which playwright drives.
"""

from io import BytesIO
import os
import subprocess
import sys

from checkout import CHECKOUT
from example_goals import PRELUDE_ARGUMENTS
from matplotlib.image import imread
import numpy as np
import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.path import Path as ArmPath

pytest.importorskip('playwright.sync_api')

EXAMPLES = tracked_files(CHECKOUT, 'config/examples/*.yaml')
#: Right of the text, above the time bar.
SIZE = {'width': 640, 'height': 360}
VIEW = {'x': 290, 'y': 0, 'width': 350, 'height': 310}


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

    def open(self, url):
        self.page.goto(url)
        self.page.wait_for_selector('canvas')
        self.page.wait_for_selector('.mantine-Slider-track')

    def at(self, part):
        """Move the time bar to a part of its length, and return the picture of the scene."""
        self.page.locator('button:has(svg)').first.focus()
        box = self.page.locator('.mantine-Slider-track').bounding_box()
        x, y = box['x'] + part * box['width'], box['y'] + 0.5 * box['height']
        for _ in range(20):  # a page that is still loading misses a click
            self.page.mouse.click(x, y)
            self.page.wait_for_timeout(200)
            if abs(self.time_bar() - part) < 0.02:
                break
        assert self.time_bar() == pytest.approx(part, abs=0.02)
        return self.picture()

    def time_bar(self):
        """Return the part of its length to which the time bar is moved."""
        low, now, high = (
            float(self.page.locator('[role=slider]').first.get_attribute(f'aria-value{name}'))
            for name in ('min', 'now', 'max')
        )
        return (now - low) / (high - low)

    def picture(self):
        """Return the scene when it is drawn: (h, w, 3), 0 to 1."""
        self.page.wait_for_timeout(400)
        return imread(BytesIO(self.page.screenshot(clip=VIEW)), format='png')[:, :, :3]

    def wait_for_text(self, text):
        self.page.wait_for_function(
            'text => document.body.innerText.includes(text)', arg=text, timeout=20e3
        )


@pytest.fixture
def tab(browser):
    opened = Tab(browser)
    yield opened
    opened.page.close()


@pytest.mark.parametrize('example', EXAMPLES, ids=lambda path: path.stem)
def test_the_page_of_an_example_plays_without_a_network(example, tab, tmp_path):
    file = tmp_path / 'page.html'
    assert main(['show', str(example), '-o', str(file), *PRELUDE_ARGUMENTS]) == 0
    assert file.stat().st_size < 4e6
    tab.open(file.as_uri())
    assert 'tightest margin' in tab.page.locator('aside').inner_text()
    early, late = tab.at(0.1), tab.at(0.6)
    assert early.std() > 0.02
    assert np.abs(early - late).mean() > 1e-4
    assert tab.problems == []
    assert [url for url in tab.requests if not url.startswith(('file:', 'data:', 'blob:'))] == []


def test_the_links_choose_what_the_colours_say(tab, tmp_path):
    file = tmp_path / 'page.html'
    assert main(['show', 'seam', '-o', str(file)]) == 0
    tab.open(file.as_uri())
    by_type = tab.at(0.0)
    with tab.page.expect_navigation(wait_until='load'):
        tab.page.get_by_text('by speed').click()
    tab.page.wait_for_selector('.mantine-Slider-track')
    assert np.abs(by_type - tab.at(0.0)).max() > 0.2
    assert tab.problems == []


def test_a_refused_goal_shows_where(tab, tmp_path):
    file = tmp_path / 'page.html'
    assert main(['show', 'square', '--ur-type', 'ur3e', '-o', str(file)]) == 1
    assert red_pixels(tab, file) > 4
    assert 'Refused' in tab.page.locator('aside').inner_text()


def test_a_refusal_in_a_cell_shows_link_and_post_in_red(tab, tmp_path):
    cell, file = tmp_path / 'cell.yaml', tmp_path / 'page.html'
    cell.write_text(
        'cell: 1\nbodies:\n'
        '  post: {cylinder: {radius: 0.04, length: 0.5}, position: [-0.45, 0.1, 0.25]}\n'
    )
    assert main(['show', 'seam', '-p', f'cell_file:={cell}', '-o', str(file)]) == 1
    assert red_pixels(tab, file) > 1000
    assert 'post' in tab.page.locator('aside').inner_text()
    assert tab.problems == []


def red_pixels(tab, file):
    """Open a page and return how much of its scene is red."""
    tab.page.goto(file.as_uri())
    tab.page.wait_for_selector('canvas')
    tab.page.wait_for_timeout(1000)
    picture = tab.picture()
    return (picture[:, :, 0] - np.maximum(picture[:, :, 1], picture[:, :, 2]) > 0.35).sum()


@pytest.fixture
def driver(ur_sim):
    config = DriverConfig(
        robot_ip='127.0.0.1',
        ur_type=ur_sim.config.model,
        headless_mode=True,
        rtde_port=ur_sim.ports.rtde,
        primary_port=ur_sim.ports.primary,
        dashboard_port=ur_sim.ports.dashboard,
        reverse_port=0,
        script_sender_port=0,
        trajectory_port=0,
        script_command_port=0,
        # The browser takes the processors, for longer than 0.2 s at a time.
        robot_receive_timeout=5.0,
        max_state_age=0.0,
    )
    with Driver(config) as opened:
        opened.wait_ready(30.0)
        yield opened


@pytest.fixture
def path_and_page(driver, ur_sim, tmp_path):
    """A path that the arm has before it, and the page that follows the arm."""
    path = ArmPath(driver.state.actual_tcp_pose).at(speed=0.2, acceleration=1.0).by(dy=0.3)
    file = tmp_path / 'path.yaml'
    path.save(file)
    process = subprocess.Popen(
        [
            *(sys.executable, '-m', 'ur_cartesian_driver.cli', 'show', str(file)),
            *('--live', '127.0.0.1', '--rtde-port', str(ur_sim.ports.rtde)),
        ],
        env={**os.environ, 'BROWSER': 'true'},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield path, process.stdout.readline().removeprefix('page: ').strip()
    finally:
        process.terminate()
        process.communicate(timeout=30.0)


def test_the_live_page_follows_a_goal(path_and_page, driver, tab):
    path, url = path_and_page
    tab.page.goto(url)
    tab.page.wait_for_selector('canvas')
    tab.wait_for_text('from the planned path')
    before = tab.picture()
    driver.execute(path).raise_for_error()
    y = 1e3 * driver.state.actual_tcp_pose.position[1]
    tab.wait_for_text(f' {y:.1f} ')
    after = tab.picture()
    assert before.std() > 0.02
    assert np.abs(before - after).mean() > 1e-3
    rows = dict(
        row.split('\t') for row in tab.page.inner_text('table').splitlines() if '\t' in row
    )
    assert float(rows['from the planned path'].removesuffix(' mm')) < 1.0
    assert rows['points begun'] == '1'
    assert tab.problems == []
