# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.state.effective_speed import EffectiveSpeed, RISE_AFTER_PAUSE
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState

PLAYING, PAUSED, RESUMING = RuntimeState.PLAYING, RuntimeState.PAUSED, RuntimeState.RESUMING
CYCLE = 0.002


def speeds(packets):
    """Return the effective speed of (scaling, slider, state), one each cycle."""
    speed = EffectiveSpeed()
    return [speed.update(60.0 + CYCLE * i, *packet) for i, packet in enumerate(packets)]


@pytest.mark.parametrize(
    ('scaling', 'slider', 'expected'),
    [
        pytest.param(1.0, 0.5, 0.5, id='slider'),
        pytest.param(0.5, 1.0, 0.5, id='a limit of the arm'),
        pytest.param(0.5, 0.5, 0.25, id='both'),
        pytest.param(0.0, 0.29, 0.0, id='at rest'),
    ],
)
def test_the_effective_speed_is_the_product(scaling, slider, expected):
    assert speeds([(scaling, slider, PLAYING)]) == [expected]


@pytest.mark.parametrize('state', [PAUSED, RESUMING, RuntimeState.STOPPED])
def test_nothing_runs_where_the_program_does_not_whatever_the_scaling_is(state):
    """A CB3 was seen to report a scaling of 1 while STOPPED."""
    assert speeds([(1.0, 1.0, PLAYING), (1.0, 1.0, state)]) == [1.0, 0.0]


@pytest.mark.parametrize('held', [[PAUSED], [PAUSED, RESUMING], [RESUMING]])
@pytest.mark.parametrize('slider', [1.0, 0.5])
def test_after_a_pause_it_rises_to_the_product(held, slider):
    found = speeds([(1.0, slider, state) for state in (PLAYING, *held, *[PLAYING] * 110)])
    found = found[len(held) :]
    rise = RISE_AFTER_PAUSE * CYCLE
    assert found == pytest.approx([min(slider, rise * i) for i in range(len(found))])
    assert found[-1] == slider


def test_a_slider_that_moves_needs_no_ramp():
    assert speeds([(1.0, slider, PLAYING) for slider in (1.0, 0.2, 0.8)]) == [1.0, 0.2, 0.8]


@given(
    st.lists(
        st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.sampled_from(RuntimeState)),
        max_size=30,
    )
)
def test_it_never_exceeds_the_product(packets):
    for (scaling, slider, _), speed in zip(packets, speeds(packets), strict=True):
        assert 0.0 <= speed <= scaling * slider
