# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults in words: the meaning of each text, and the sentence for one that has none."""

from __future__ import annotations

import pytest

from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.faults.fault_parser import parse_fault
from ur_cartesian_driver.sim.faults.fault_values import (
    AfterDistance,
    AfterTime,
    DelayFault,
    DeviationFault,
    DropFault,
    EventFault,
    FaultEvent,
    ForeignMotionFault,
    GarbageFault,
    HalfOpenFault,
    PlaneCrossing,
    SilenceFault,
    SpeedSliderFault,
    ThrottleFault,
)


@pytest.mark.parametrize(
    ('text', 'fault'),
    [
        (
            'protective_stop at 2 s',
            EventFault(action=FaultEvent.PROTECTIVE_STOP, trigger=AfterTime(2.0)),
        ),
        (
            'protective_stop at 0.35 m',
            EventFault(action=FaultEvent.PROTECTIVE_STOP, trigger=AfterDistance(0.35)),
        ),
        (
            'emergency_stop at z = -0.3 m',
            EventFault(action=FaultEvent.EMERGENCY_STOP, trigger=PlaneCrossing('z', -0.3)),
        ),
        ('stop', EventFault(action=FaultEvent.STOP)),
        ('unlock at 7s', EventFault(action=FaultEvent.UNLOCK, trigger=AfterTime(7.0))),
        ('play at x=.5', EventFault(action=FaultEvent.PLAY, trigger=PlaneCrossing('x', 0.5))),
        ('slider 0.3 at 1 s', SpeedSliderFault(fraction=0.3, trigger=AfterTime(1.0))),
        (
            'foreign_motion z 0.05 at 1 s',
            ForeignMotionFault(axis='z', distance=0.05, trigger=AfterTime(1.0)),
        ),
        (
            'offset pose x 0.002 at 1 s for 2 s',
            DeviationFault(
                quantity='pose',
                axis='x',
                shape='offset',
                amount=0.002,
                trigger=AfterTime(1.0),
                duration=2.0,
            ),
        ),
        (
            'ramp twist rz -1e-3',
            DeviationFault(quantity='twist', axis='rz', shape='ramp', amount=-1e-3),
        ),
        (
            'noise acceleration y 0.1 at 0.2 m',
            DeviationFault(
                quantity='acceleration',
                axis='y',
                shape='noise',
                amount=0.1,
                trigger=AfterDistance(0.2),
            ),
        ),
        ('drop rtde at 5 s', DropFault(interface='rtde', trigger=AfterTime(5.0))),
        (
            'drop rtde at 5 s for 2 s',
            DropFault(interface='rtde', trigger=AfterTime(5.0), duration=2.0),
        ),
        ('half_open primary', HalfOpenFault(interface='primary')),
        ('silence dashboard for 1.5 s', SilenceFault(interface='dashboard', duration=1.5)),
        ('delay sockets 0.1 s', DelayFault(interface='sockets', seconds=0.1)),
        (
            'throttle primary 1000 at 1 s',
            ThrottleFault(interface='primary', rate=1000.0, trigger=AfterTime(1.0)),
        ),
        ('garbage rtde', GarbageFault(interface='rtde')),
        ('garbage rtde 8 at 1 s', GarbageFault(interface='rtde', size=8, trigger=AfterTime(1.0))),
        (
            'silence rtde for 2 s at 1 s',
            SilenceFault(interface='rtde', trigger=AfterTime(1.0), duration=2.0),
        ),
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
        ('protective_stop at -2 s', '-2', 'at least 0'),
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
        ('drop at 2 s', 'at', 'an interface'),
        ('drop rtde at 1 s for -2 s', '-2', 'greater than 0'),
        ('drop rtde for 2 s at 1 s at 3 s', 'at', 'expected the end'),
        ('garbage rtde 10.9', '10.9', 'a whole number'),
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
    with pytest.raises(ValueError, match='; use '):
        parse_fault(text)


def test_one_wrong_fault_sets_none_of_those_with_it():
    robot = SimulatedRobot()
    with pytest.raises(ValueError, match='nowhere'):
        robot.inject('silence rtde at 5 s', 'drop nowhere at 1 s')
    assert not robot._faults.active


def test_an_unknown_interface_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"'rdte'.*sockets.*rtde.*primary.*dashboard"):
        SimulatedRobot(SimulatorConfig(faults=['drop rdte']))
