# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The ROS domain of the pytest plugin is private in every order of fixtures and rclpy.init()."""

import re
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

REFUSED = (
    r'rclpy runs in ROS domain {} and not in the private one, \d+, so the nodes of this test '
    r'could reach robots; let the fixture that calls rclpy\.init\(\) request private_ros_graph '
    r'and name no domain, or call rclpy\.shutdown\(\) before'
)
HEAD = """
import os
import pytest
import rclpy
from rclpy.utilities import get_default_context

def domain():
    return get_default_context().get_domain_id()
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Return a function that runs tests, and returns what pytest prints and its counts."""
    monkeypatch.setenv('ROS_DOMAIN_ID', '42')

    def run_tests(text, *options):
        (tmp_path / 'test_mine.py').write_text(HEAD + text)
        ended = subprocess.run(
            [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', *options, 'test_mine.py'],
            stdout=subprocess.PIPE,
            text=True,
            timeout=240,
            check=False,
            cwd=tmp_path,
        )
        counts = dict(
            (word, int(number))
            for number, word in re.findall(r'(\d+) (passed|failed|error)', ended.stdout)
        )
        return ended.stdout, counts

    return run_tests


def test_the_driver_is_refused_where_rclpy_runs_in_another_domain(run):
    """The refusal lasts as long as its reason: the fixture of the session stays good."""
    shown, counts = run("""
def test_that_leaves_rclpy_running():
    rclpy.init()
    assert domain() == 42

def test_before(cartesian_driver):
    pass

def test_that_ends_it():
    rclpy.shutdown()

def test_after(cartesian_driver, private_ros_graph):
    assert domain() == private_ros_graph != 42
    with pytest.raises(RuntimeError, match='once'):
        rclpy.init()
""")
    assert counts == {'passed': 3, 'error': 1}, shown
    assert re.search(REFUSED.format(42), shown)
    assert 'Traceback' not in shown


@pytest.mark.parametrize(
    ('requested', 'init', 'other'),
    [
        ('', 'rclpy.init()', 42),
        ('', 'rclpy.init(domain_id=7)', 7),
        ('private_ros_graph', 'rclpy.init(domain_id=7)', 7),
        ('private_ros_graph', 'rclpy.init()', None),
    ],
)
def test_a_fixture_that_calls_init_requests_the_private_graph(run, requested, init, other):
    shown, counts = run(f"""
@pytest.fixture(scope='session')
def ros({requested}):
    {init}
    yield
    rclpy.shutdown()

def test_mine(ros, private_ros_graph):
    assert domain() == private_ros_graph == int(os.environ['ROS_DOMAIN_ID'])
""")
    assert counts == ({'passed': 1} if other is None else {'failed': 1}), shown
    assert other is None or re.search(REFUSED.format(other), shown)


def test_the_lock_of_a_domain_is_no_file(run, tmp_path, monkeypatch):
    """A file in a folder of all users could be one that another user may not open."""
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    for domain in range(60, 101):
        (tmp_path / f'ur_cartesian_driver_test_domain_{domain}').mkdir()
    shown, counts = run("""
def test_mine(private_ros_graph):
    assert 60 <= private_ros_graph <= 100
""")
    assert counts == {'passed': 1}, shown


def test_a_marker_whose_argument_has_no_name_fails_its_test(run):
    shown, counts = run("""
@pytest.mark.ur_sim('ur10e')
def test_sim(ur_sim):
    pass

@pytest.mark.ur_sim(model='ur10e')
def test_named(ur_sim):
    assert ur_sim.config.model == 'ur10e'
""")
    assert counts == {'passed': 1, 'error': 1}, shown
    assert (
        "the marker ur_sim has the argument 'ur10e' without a name; write "
        '@pytest.mark.ur_sim(NAME=VALUE)'
    ) in shown


def test_two_workers_have_two_domains(run, tmp_path):
    pytest.importorskip('xdist')
    shown, counts = run(
        """
from pathlib import Path
import threading

def test_mine(private_ros_graph, worker_id):
    rclpy.init()
    Path(f'domain_{worker_id}').write_text(str(domain()))
    rclpy.shutdown()
    for _ in range(1000):  # the other worker, so that both hold their domain
        if len(list(Path().glob('domain_*'))) == 2:
            return
        threading.Event().wait(0.05)
""",
        *('-n', '2', '--dist', 'each'),
    )
    assert counts == {'passed': 2}, shown
    domains = [int(file.read_text()) for file in tmp_path.glob('domain_*')]
    assert len({*domains, 42}) == 3
