# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""On the virtual clock the same inputs give the same bytes, whatever the program does."""

from hypothesis import given, Phase, settings
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.protocol.rtde.rtde_client import HandshakeDone, RtdeClientCodec
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession

OUTPUTS = (
    'timestamp',
    'target_q',
    'actual_q',
    'actual_qd',
    'target_qdd',
    'actual_TCP_pose',
    'actual_TCP_speed',
    'speed_scaling',
    'runtime_state',
    'output_double_register_24',
)

numbers = st.floats(-0.1, 0.1)
ways = st.tuples(*[numbers] * 6).map(lambda way: f'[{", ".join(f"{x:.4f}" for x in way)}]')
radii = st.sampled_from(['', ', r=0.01'])
lines = st.one_of(
    st.builds('movej(home + {0}{1})'.format, ways, radii),
    st.builds('movel(get_forward_kin(home + {0}){1})'.format, ways, radii),
    st.builds('movep(get_forward_kin(home + {0}), v=0.4{1})'.format, ways, radii),
    st.builds('speedj(10 * {0}, 2.0, 0.1)'.format, ways),
    st.builds('speedl({0}, 0.5, 0.1)'.format, ways),
    st.builds('servoj(home + 0.1 * {0}, t=0.1)'.format, ways),
    st.just('write_output_float_register(24, random())'),
    st.sampled_from(['stopj(2.0)', 'sleep(0.01)', 'set_tcp(p[0, 0, 0.1, 0, 0, 0])']),
)
sliders = st.lists(st.tuples(st.integers(1, 400), st.floats(0.1, 1.0)), max_size=3)


def packets(body, changes, cycles=400):
    """Return the bytes that an RTDE client reads while a program runs."""
    controller = assemble(SimulatorConfig()).controller
    session = RtdeSession(controller, set())
    client = RtdeClientCodec(OUTPUTS, ['speed_slider_mask', 'speed_slider_fraction'])
    data, ready = client.start(), []
    while not ready:
        ready = [e for e in client.feed(session.feed(data)) if isinstance(e, HandshakeDone)]
        data = client.data_to_send()
    program = ''.join(f'  {line}\n' for line in ('home = get_target_joint_positions()', *body))
    controller.programs.submit(f'def any():\n{program}end\n')
    slider, sent = dict(changes), b''
    for cycle in range(cycles):
        if cycle in slider:
            session.feed(ready[0].inputs.pack([1, slider[cycle]]))
        controller.step()
        sent += b''.join(session.packages())
    return sent, list(controller.messages.log)


@pytest.mark.slow
@settings(max_examples=10, deadline=None, phases=[Phase.generate])
@given(st.lists(lines, min_size=1, max_size=6), sliders)
def test_same_program_and_inputs_give_the_same_bytes(body, changes):
    first, log = packets(body, changes)
    assert (first, log) == packets(body, changes)
    assert len(first) % 400 == 0


def test_another_slider_gives_other_bytes():
    body = ['movej(home + [0.1, 0, 0, 0, 0, 0])']
    assert packets(body, []) != packets(body, [(10, 0.5)])
