# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Keep the ROS graphs of tests apart: from the network, and from each other."""

import os

import pytest

#: Domains that no user is likely to be on; 0 to 101 are allowed everywhere.
_FIRST_DOMAIN = 60


@pytest.fixture(scope='session', autouse=True)
def private_graph(tmp_path_factory):
    """Give each worker of pytest-xdist a domain of its own, on this computer only."""
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        patch.setenv('ROS_DOMAIN_ID', str(_FIRST_DOMAIN + worker % 40))
        patch.setenv('ROS_LOG_DIR', str(tmp_path_factory.mktemp('ros_log')))
        yield
