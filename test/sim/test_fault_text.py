# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults in words: what each text means, and what is said of one that means nothing."""

from __future__ import annotations

import pytest

from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.fault_text import parse_fault
from ur_cartesian_driver.sim.faults import (
    Action,
    After,
    Crossing,
    Delay,
    Deviation,
    Drop,
    Event,
    ForeignMotion,
    Garbage,
    HalfOpen,
    Silence,
    Slider,
    Throttle,
    Travelled,
)


@pytest.mark.parametrize(
    ('text', 'fault'),
    [
        ('protective_stop at 2 s', Event(action=Action.PROTECTIVE_STOP, when=After(2.0))),
        ('protective_stop at 0.35 m', Event(action=Action.PROTECTIVE_STOP, when=Travelled(0.35))),
        (
            'emergency_stop at z = -0.3 m',
            Event(action=Action.EMERGENCY_STOP, when=Crossing('z', -0.3)),
        ),
        ('stop', Event(action=Action.STOP)),
        ('unlock at 7s', Event(action=Action.UNLOCK, when=After(7.0))),
        ('play at x=.5', Event(action=Action.PLAY, when=Crossing('x', 0.5))),
        ('slider 0.3 at 1 s', Slider(fraction=0.3, when=After(1.0))),
        ('foreign_motion z 0.05 at 1 s', ForeignMotion(axis='z', distance=0.05, when=After(1.0))),
        (
            'offset pose x 0.002 at 1 s for 2 s',
            Deviation(
                quantity='pose',
                axis='x',
                shape='offset',
                amount=0.002,
                when=After(1.0),
                duration=2.0,
            ),
        ),
        (
            'ramp twist rz -1e-3',
            Deviation(quantity='twist', axis='rz', shape='ramp', amount=-1e-3),
        ),
        (
            'noise acceleration y 0.1 at 0.2 m',
            Deviation(
                quantity='acceleration', axis='y', shape='noise', amount=0.1, when=Travelled(0.2)
            ),
        ),
        ('drop rtde at 5 s', Drop(interface='rtde', when=After(5.0))),
        ('drop rtde at 5 s for 2 s', Drop(interface='rtde', when=After(5.0), duration=2.0)),
        ('half_open primary', HalfOpen(interface='primary')),
        ('silence dashboard for 1.5 s', Silence(interface='dashboard', duration=1.5)),
        ('delay sockets 0.1 s', Delay(interface='sockets', seconds=0.1)),
        (
            'throttle primary 1000 at 1 s',
            Throttle(interface='primary', rate=1000.0, when=After(1.0)),
        ),
        ('garbage rtde', Garbage(interface='rtde')),
        ('garbage rtde 8 at 1 s', Garbage(interface='rtde', size=8, when=After(1.0))),
    ],
)
def test_a_fault_can_be_written_in_words(text, fault):
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ('text', 'word', 'expected'),
    [
        ('', 'the end', 'protective_stop'),
        ('protectivestop at 2 s', 'protectivestop', 'protective_stop'),
        ('protective_stop in 2 s', 'in', "'at'"),
        ('protective_stop at 2', 'the end', 's, m'),
        ('protective_stop at 2 h', 'h', 's, m'),
        ('protective_stop at noon', 'noon', 'a time'),
        ('protective_stop at -2 s', '-2', 'no negative'),
        ('protective_stop at z 3', '3', "'='"),
        ('protective_stop for 2 s', 'for', "'at'"),
        ('slider fast', 'fast', 'slider'),
        ('offset x 0.1', 'x', 'pose, twist, acceleration'),
        ('offset pose w 0.1', 'w', 'x, y, z'),
        ('offset pose x at 2 s', 'at', 'an amount'),
        ('drop', 'the end', 'an interface'),
        ('drop rtde for 2 m', 'm', "'s'"),
        ('delay rtde soon', 'soon', 'a time'),
        ('drop rtde at 2 s & stop', '&', "'for'"),
    ],
)
def test_a_word_that_is_not_understood_is_named(text, word, expected):
    with pytest.raises(ValueError, match='not understood') as raised:
        parse_fault(text)
    assert f'at {word!r}; ' in str(raised.value)
    assert expected in str(raised.value)
    assert str(raised.value).count('\n') == 0


@pytest.mark.parametrize(
    'text', ['slider 1.5', 'delay rtde 0', 'throttle rtde -1', 'garbage rtde 0']
)
def test_an_impossible_amount_is_refused(text):
    with pytest.raises(ValueError, match='cannot'):
        parse_fault(text)


def test_an_unknown_interface_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"'rdte'.*sockets.*rtde.*primary.*dashboard"):
        SimulatedRobot(SimulatorConfig(faults=['drop rdte']))
