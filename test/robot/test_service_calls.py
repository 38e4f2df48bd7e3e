# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A call that exists can be sent: others are refused when they are made."""

from hypothesis import given
from hypothesis import strategies as st

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.pose import normalize, Pose
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol import dashboard
import ur_cartesian_driver.protocol.program.script_command as script_command
from ur_cartesian_driver.protocol.rtde.rtde_fields import INPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.robot.services import rtde_input_writer, service_calls

any_number = st.floats() | st.floats(-2.0, 2.0)
three = st.tuples(*[any_number] * 3)
four = st.tuples(*[any_number] * 4)


def made(call, /, **values):
    """Return a call, None if it is refused."""
    try:
        return call(**values)
    except LocalProtocolError:
        return None


def frame(writing):
    """Return the package that a robot would get."""
    types = [INPUT_TYPES[name] for name in writing.inputs]
    return Recipe(tuple(writing.inputs), types).pack_named(writing.inputs)


@given(three, four | st.just((0.0, 0.0, 0.0, 1.0)))
def test_a_tcp_can_be_sent_or_is_refused(position, quaternion):
    call = made(service_calls.SetTcpCall, T_flange_tcp=Pose(position, quaternion))
    if call is not None:
        pose = Pose(position, normalize(quaternion))
        script_command.encode(script_command.SetTcpOffsetCommand(offset=pose.rotation_vector()))


@given(
    any_number | st.floats(0.0, 100.0),
    three,
    st.lists(any_number | st.floats(0.0, 133.0), max_size=7),
    any_number | st.floats(0.0, 30.0),
)
def test_a_payload_can_be_sent_or_is_refused(mass, cog, inertia, time):
    values = {'mass': mass, 'cog': cog, 'inertia': tuple(inertia), 'transition_time': time}
    call = made(service_calls.SetPayloadCall, **values)
    if call is not None:
        values['inertia'] = call.inertia or (0.0,) * 6
        script_command.encode(script_command.SetTargetPayloadCommand(**values))


@given(three)
def test_a_gravity_can_be_sent_or_is_refused(gravity):
    call = made(service_calls.SetGravityCall, gravity=gravity)
    if call is not None:
        script_command.encode(script_command.SetGravityCommand(gravity=call.gravity))


@given(
    st.sampled_from(OutputKind),
    st.integers(-3, 300),
    any_number | st.sampled_from((0.0, 1.0)),
    st.sampled_from(AnalogDomain),
)
def test_an_output_can_be_sent_or_is_refused(kind, pin, value, domain):
    call = made(service_calls.SetOutputCall, kind=kind, pin=pin, value=value, domain=domain)
    if call is not None:
        frame(rtde_input_writer.output_write(call))


@given(any_number)
def test_a_slider_can_be_sent_or_is_refused(fraction):
    call = made(service_calls.SetSpeedSliderCall, fraction=fraction)
    assert (call is not None) == (0.0 <= fraction <= 1.0)
    if call is not None:
        frame(rtde_input_writer.speed_slider_write(call))


@given(st.text() | st.just('x' * 2000))
def test_a_text_stays_one_line_or_is_refused(text):
    for call in (
        made(service_calls.DashboardCall, command='load', argument=text),
        made(service_calls.DashboardLineCall, line=text),
    ):
        if isinstance(call, service_calls.DashboardCall):
            sent = dashboard.DashboardRequest(name=call.command, argument=call.argument).encode()
            assert sent.count(b'\n') == 1
        elif call is not None:
            assert dashboard.encode_line(call.line).count(b'\n') == 1
