# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The search of the documentation site finds the right page first, without a network."""

from checkout import CHECKOUT
import pytest

SITE = CHECKOUT / 'build' / 'site'
#: What a newcomer types, and the pages of which one has to come first.
FIRST = {
    'blend': ['blends'],
    'glue valve': ['outputs'],
    'posture': ['postures'],
    'speed slider': ['speed_slider'],
    'protective stop': ['recovery'],
    'TCP': ['frames'],
    'weld': ['tutorial_seam'],
    'External Control': ['external_control'],
    'G-code': ['tutorial_file', 'importing'],
    'MoveIt': ['coming_from/moveit', 'moveit'],
}


@pytest.fixture(scope='module')
def tab(browser):
    assert (SITE / 'search.html').is_file(), 'run "make docs" first'
    page = browser.new_page()
    requests = []
    page.on('request', lambda request: requests.append(request.url))
    yield page
    assert [url for url in requests if not url.startswith('file:')] == []


@pytest.mark.parametrize('words', FIRST)
def test_the_first_result_is_the_right_page(tab, words):
    tab.goto(f'{(SITE / "search.html").as_uri()}?q={words.replace(" ", "+")}')
    tab.wait_for_selector('#search-results li a')
    tab.wait_for_function("document.querySelector('.search-summary')?.innerText.includes('found')")
    results = tab.eval_on_selector_all(
        '#search-results li > a', 'links => links.map(link => link.getAttribute("href"))'
    )
    pages = [result.split('.html')[0] for result in results[:5]]
    assert pages[0] in FIRST[words], pages
