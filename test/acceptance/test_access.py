# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Access to a driver: where it listens, who may connect, and how others are refused."""

import logging
import socket

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: Another computer, as far as addresses tell: all of 127.0.0.0/8 is here.
OTHER = '127.0.0.2'


def knock(port, host='127.0.0.1'):
    """Connect from the other address; return whether the connection stays open."""
    with socket.create_connection((host, port), timeout=5.0, source_address=(OTHER, 0)) as call:
        call.settimeout(0.3)
        try:
            return call.recv(1) != b''
        except TimeoutError:
            return True
        except ConnectionError:
            return False


@pytest.mark.ur_sim(frequency=125.0)
def test_only_the_robot_may_connect_and_only_from_its_address(driver, caplog):
    caplog.set_level(logging.WARNING, 'ur_cartesian_driver')
    for name, port in driver.status.ports.items():
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((OTHER, port), timeout=5.0)  # not on all networks
        assert not knock(port)
        wait_for(
            lambda name=name: (
                f'{name}: {OTHER} may not connect; add it to allowed_peers if '
                'it is the robot' in caplog.messages
            )
        )
    assert driver.status.state is ConnectionState.READY, 'the robot program is not disturbed'


@pytest.mark.ur_sim(frequency=125.0)
def test_other_addresses_may_connect_where_a_parameter_allows_them(make_driver):
    driver = make_driver(
        allowed_peers=('127.0.0.1', OTHER), bind_address='0.0.0.0', reverse_ip='127.0.0.1'
    )
    driver.wait_ready(30.0)
    port = driver.status.ports['script_sender_port']
    assert knock(port, OTHER)
    assert not knock(driver.status.ports['reverse_port']), 'the robot program holds that one'
