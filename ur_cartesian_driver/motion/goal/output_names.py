# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The outputs of a robot: their names and ranges, and the parameter ``safe_outputs``."""

from __future__ import annotations

from collections.abc import Sequence

from ur_cartesian_driver.motion.goal.goal import OutputKind, PulseTrain, SafeOutput
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain

#: For each kind of output: its name in error messages and reports, and the number of its pins.
OUTPUTS = {
    OutputKind.STANDARD_DIGITAL: ('standard digital output', 8),
    OutputKind.CONFIGURABLE_DIGITAL: ('configurable digital output', 8),
    OutputKind.TOOL_DIGITAL: ('tool digital output', 2),
    OutputKind.STANDARD_ANALOG: ('standard analog output', 2),
}


def output_name(kind: OutputKind, pin: int) -> str:
    """Return the name of an output for error messages, such as ``standard digital output 2``."""
    return f'{OUTPUTS[kind][0]} {pin}'


def output_text(kind: OutputKind, pin: int) -> str:
    """Return an output as files and parameters name it, such as ``standard_digital 2``."""
    return f'{kind.name.lower()} {pin}'


def parse_output(text: str) -> tuple[OutputKind, int]:
    """
    Return kind and pin of a text such as ``standard_digital 2``.

    :raises ValueError: the text has another form, or the robot has no such output.
    """
    try:
        kind_name, pin_text = text.split()
        kind, pin = OutputKind[kind_name.upper()], int(pin_text)
    except (KeyError, ValueError):
        raise ValueError(
            f'output is {text!r:.60}, but must be "kind pin", where kind is one of '
            f'{", ".join(kind.name.lower() for kind in OutputKind)}'
        ) from None
    if (fault := output_fault(kind, pin, 0.0)) is not None:
        raise ValueError(f'output is {text!r:.60}: its {fault[0]} {fault[1]}; {fault[2]}')
    return kind, pin


def output_fault(kind: OutputKind, pin: int, value: float) -> tuple[str, str, str] | None:
    """Return the wrong argument's name, its fault and a remedy; None if nothing is wrong."""
    name, pins = OUTPUTS[kind]
    if not 0 <= pin < pins:
        return 'pin', f'is {pin}, but there are {name}s 0 to {pins - 1}', 'name one of these'
    is_analog = kind is OutputKind.STANDARD_ANALOG
    if not 0.0 <= value <= 1.0 or (not is_analog and value not in (0.0, 1.0)):  # or NaN
        takes = '0 to 1, the fraction of its range' if is_analog else '0 (off) or 1 (on)'
        return 'value', f'is {value:g}; a {name} takes {takes}', ''
    return None


def pulse_outputs(trains: Sequence[PulseTrain]) -> tuple[tuple[OutputKind, int], ...]:
    """Return the outputs of pulse trains, each once; the robot program numbers them likewise."""
    return tuple(dict.fromkeys((train.output, train.pin) for train in trains))


def repeated_output(outputs: Sequence[SafeOutput]) -> int | None:
    """Return the index of the first output that is named before it, too; None if all differ."""
    named = [(output.output, output.pin) for output in outputs]
    return next((i for i, one in enumerate(named) if one in named[:i]), None)


def parse_safe_outputs(texts: tuple[str, ...]) -> tuple[SafeOutput, ...]:
    """
    Read the parameter ``safe_outputs``; empty texts are skipped.

    :raises ValueError: a text cannot be read, or two name the same output.
    """
    outputs = tuple(_parse(text) for text in texts if text.strip())
    twice = repeated_output(outputs)
    if twice is not None:
        name = output_name(outputs[twice].output, outputs[twice].pin)
        raise ValueError(f'safe_outputs: {name} is named twice; name it once.')
    return outputs


def _parse(text: str) -> SafeOutput:
    """Read ``kind pin value [current | voltage] [restore]``."""
    words = text.lower().split()
    restore = words[-1] == 'restore'
    kind_name, *numbers = words[: len(words) - restore] or ['']
    domain = AnalogDomain.CURRENT
    if kind_name == OutputKind.STANDARD_ANALOG.name.lower() and len(numbers) == 3:
        domain_name = numbers.pop()
        if domain_name not in ('current', 'voltage'):
            raise ValueError(
                f'safe_outputs: "{text}" drives "{domain_name}"; write current or voltage.'
            )
        domain = AnalogDomain[domain_name.upper()]
    try:
        kind = OutputKind[kind_name.upper()]
        pin_text, value_text = numbers
        pin, value = int(pin_text), float(value_text)
    except (KeyError, ValueError):
        raise ValueError(
            f'safe_outputs: "{text}" cannot be read; write "kind pin value [current | voltage] '
            '[restore]", where kind is one of '
            f'{", ".join(kind.name.lower() for kind in OutputKind)}.'
        ) from None
    if (fault := output_fault(kind, pin, value)) is not None:
        field, wrong, _ = fault
        raise ValueError(f'safe_outputs: the {field} of "{text}" {wrong}.')
    return SafeOutput(output=kind, pin=pin, value=value, domain=domain, restore=restore)
