# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``/diagnostics``: the state of the driver, for rqt_robot_monitor and for logs."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ur_cartesian_driver.driver import ConnectionState, Driver

#: Level of each state of the connection.
LEVELS = {
    ConnectionState.DISCONNECTED: DiagnosticStatus.ERROR,
    ConnectionState.CONNECTING: DiagnosticStatus.WARN,
    ConnectionState.CONNECTED: DiagnosticStatus.WARN,
    ConnectionState.READY: DiagnosticStatus.OK,
    ConnectionState.EXECUTING: DiagnosticStatus.OK,
    ConnectionState.STOPPED: DiagnosticStatus.ERROR,
    ConnectionState.REFUSED: DiagnosticStatus.ERROR,
}


def diagnostics_message(driver: Driver, node_name: str, stamp: Time) -> DiagnosticArray:
    """Return the state of the connection, its longest gaps, and the next step for the user."""
    status, state, gaps = driver.status, driver.state, driver.gaps
    values = {
        'connection': status.state.name,
        'last error': status.last_error,
        'robot mode': 'UNKNOWN' if state is None else state.robot_mode.name,
        'safety mode': 'UNKNOWN' if state is None else state.safety_mode.name,
        'program': 'UNKNOWN' if state is None else state.runtime_state.name,
        'robot program connected': str(status.program_running),
        'robot program made by this driver': str(status.program_is_own),
        'motion version': str(status.motion_version or 'UNKNOWN'),
        'speed scaling': '' if state is None else f'{state.effective_speed:.3f}',
        'robot address': driver.config.robot_ip,
        'robot model': status.robot_model,
        'serial number': status.serial_number,
        'software': status.polyscope_version,
        'calibration known': str(status.calibration_known),
        'timeout sent to the robot program [s]': f'{driver.config.robot_receive_timeout:g}',
        'longest gap between keepalives sent [s]': f'{gaps.keepalives:.4f}',
        'longest gap between robot reports [s]': f'{gaps.reports:.4f}',
        'largest age of a robot report [s]': f'{gaps.state_age:.4f}',
    }
    message = DiagnosticArray(
        status=[
            DiagnosticStatus(
                level=LEVELS[status.state],
                name=f'{node_name}: robot',
                message=status.message or status.state.name,
                hardware_id=status.serial_number or driver.config.robot_ip,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        ]
    )
    message.header.stamp = stamp
    return message
