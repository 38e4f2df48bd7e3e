# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Two drivers for one robot: the first one keeps it, the second one is refused."""

import socket

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.goal.goal import Goal, OutputKind, Waypoint
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]


@pytest.mark.ur_sim(frequency=125.0)
def test_a_second_driver_is_refused_and_the_first_goes_on(driver, make_driver, home, ur_sim):
    motion = driver.start(driver.plan(Goal(waypoints=(Waypoint(pose=home(y=0.1), time=2.0),))))
    second = make_driver()
    wait_for(lambda: second.status.state is ConnectionState.CONNECTED)
    wait_for(lambda: "possibly another driver's" in second.status.message)
    second.resend_robot_program()
    answer = second.recover()
    assert not answer.ok
    assert 'Another program runs on the robot' in answer.text
    assert motion.result(10.0).succeeded
    assert second.status.state is ConnectionState.CONNECTED
    assert ur_sim.state().runtime_state.name == 'PLAYING'
    driver.close()  # the robot is free
    wait_for(lambda: ur_sim.state().runtime_state.name == 'STOPPED')
    second.resend_robot_program()
    second.wait_ready(30.0)


@pytest.mark.ur_sim(frequency=125.0)
def test_a_port_that_another_driver_listens_on_is_named(driver, make_driver):
    for name, port in driver.status.ports.items():
        second = make_driver(**{name: port})
        wait_for(lambda second=second, name=name: name in second.status.message)
        assert second.status.message == (
            f'No connection to the robot: cannot listen on 127.0.0.1 port {port} (address already '
            f'in use): another driver may use it; set {name} to a free port or to 0.'
        )
        second.close()


@pytest.mark.ur_sim(frequency=125.0)
def test_an_address_that_is_not_ours_is_named_with_its_parameter(make_driver):
    driver = make_driver(bind_address='192.0.2.1')  # RFC 5737: nobody's
    wait_for(lambda: 'cannot listen on 192.0.2.1' in driver.status.message)
    assert driver.status.message.endswith('set bind_address to an address of this computer.')


@pytest.mark.ur_sim(frequency=125.0)
def test_inputs_that_another_client_holds_are_named(driver, ur_sim):
    client = RtdeClientCodec(
        ['timestamp'], inputs=('standard_digital_output_mask', 'standard_digital_output')
    )
    with socket.create_connection(('127.0.0.1', ur_sim.ports.rtde)) as other:
        other.sendall(client.start())
        while not client.feed(other.recv(65536)):
            other.sendall(client.data_to_send())
        answer = driver.set_digital_output(OutputKind.STANDARD_DIGITAL, 1, True)
    assert not answer.ok
    assert 'standard_digital_output' in answer.text
    assert 'another client' in answer.text
