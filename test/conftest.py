# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings for all tests."""

import gc
from importlib.util import find_spec
import socket

from hypothesis import settings
import pytest

# A machine that does something else for a moment is no defect.
settings.register_profile('any machine', deadline=None)
settings.load_profile('any machine')


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """
    Let the garbage collector leave alone what was there before the first test.

    Thousands of collected tests and all modules stay until the end. Each full collection went
    through all of them, which took a third of the time of tests that compute.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture
def closed_port():
    """Return a port that refuses connections; nobody else can open it meanwhile."""
    with socket.socket() as bound:
        bound.bind(('127.0.0.1', 0))
        yield bound.getsockname()[1]


@pytest.fixture
def free_port():
    """Return a port that nobody has opened; the kernel gives it to nobody else soon."""
    with socket.create_server(('127.0.0.1', 0)) as listener:
        port = listener.getsockname()[1]
    return port


def pytest_addoption(parser):
    parser.addoption(
        '--no-skips',
        action='store_true',
        help='count what is skipped as failed: `make test` runs where all is installed',
    )
    parser.addoption(
        '--overlap',
        action='store_true',
        help='let every other worker of -n run tests that compute while the others wait',
    )
    parser.addoption(
        '--no-computing',
        action='store_true',
        help='leave out the tests that only compute; what waits, for clocks and sockets, runs',
    )
    parser.addoption(
        '--browser',
        metavar='CHROMIUM',
        help='the browser for the tests of pages, which are left out without it',
    )


def pytest_configure(config):
    plugins = config.pluginmanager
    if config.getoption('--overlap') and hasattr(config, 'workerinput'):
        from overlap import LowPriority

        plugins.register(LowPriority())
    if all(map(plugins.hasplugin, ('rerunfailures', 'xdist'))) and not config.option.usepdb:
        from standstill import Standstill

        plugins.register(Standstill())


def pytest_ignore_collect(collection_path, config):
    """Leave out the folders of tests that need what most environments do not have."""
    missing = {
        'browser': not config.getoption('--browser'),
        'simulator_alone': find_spec('ur_controller_sim') is None,
    }
    return True if collection_path.is_dir() and missing.get(collection_path.name) else None


def pytest_collection_modifyitems(config, items):
    if config.getoption('--no-computing'):
        from overlap import rank

        config.hook.pytest_deselected(items=[item for item in items if rank(item.nodeid) >= 0])
        items[:] = [item for item in items if rank(item.nodeid) < 0]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    if not config.getoption('--overlap'):
        return None
    from overlap import Overlap

    return Overlap(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    return _without_skip((yield), item.config)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    return _without_skip((yield), collector.config)


def _without_skip(report, config):
    """Turn a skip into a failure where none is expected; a known failure is no skip."""
    if report.skipped and not hasattr(report, 'wasxfail') and config.getoption('--no-skips'):
        _, _, reason = report.longrepr
        report.outcome = 'failed'
        report.longrepr = f'{reason}: but --no-skips says that nothing may be skipped here.'
    return report
