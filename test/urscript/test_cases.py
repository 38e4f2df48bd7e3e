# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The language by example: every program in `cases` states its own results.

In a comment, usually on the line that does it: `# expect: text` for each `textmsg`, in order;
`# expect error: text` for the runtime exception that ends the program, raised on this very line;
`# expect compile error: line:column text` for a program that cannot start.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any

import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.urscript import (
    CompileError,
    core_builtins,
    parse,
    RemoteObject,
    RuntimeException,
    ScriptInterpreter,
    to_text,
)

CASES = tracked_files(Path(__file__).parent / 'cases', '**/*.script')
EXPECT = re.compile(r'# expect(?P<kind>| error| compile error): ?(?P<text>.*)')
FRAME = 0.002  # [s]
MAX_FRAMES = 1000


@dataclass
class Outcome:
    """Output and errors of a program."""

    output: list[str] = field(default_factory=list)
    error: tuple[int, str] | None = None
    compile_error: str | None = None


class Remote(RemoteObject):
    """Answers each call with the call as text."""

    def __init__(self, name: str) -> None:
        self._name = name

    def call(self, method: str, arguments: Any) -> Any:
        if method == 'wait':
            return self._wait(*arguments)
        return f'{self._name}.{method}{to_text(list(arguments))}'

    @staticmethod
    def _wait(frames: int) -> Generator[None, None, int]:
        for _ in range(frames):
            yield
        return frames


def standard_builtins(output: list[str]) -> dict[str, Any]:
    """The core functions, and just enough of a controller to see what happens."""

    def textmsg(s1: Any, s2: Any = '') -> None:
        output.append(to_text(s1) + to_text(s2))

    def sync() -> Generator[None, None, None]:
        yield

    def sleep(t: Any) -> Generator[None, None, None]:
        for _ in range(round(t / FRAME)):
            yield

    def fail(text: str) -> None:
        raise RuntimeException(text)

    def fail_later() -> Generator[None, None, None]:
        yield
        raise RuntimeException('gave up')

    def crash() -> None:
        raise KeyError('key')

    def spoil(items: list[Any]) -> None:
        items[0] = 'spoilt'

    functions = (textmsg, sync, sleep, fail, fail_later, crash, spoil)
    return {
        **core_builtins(),
        **{function.__name__: function for function in functions},
        'connect': Remote,
    }


def run(text: str) -> Outcome:
    outcome = Outcome()
    try:
        machine = ScriptInterpreter(parse(text), standard_builtins(outcome.output))
    except CompileError as error:
        outcome.compile_error = f'{error.line}:{error.column} {error.text}'
        return outcome
    for _ in range(MAX_FRAMES):
        machine.step()
    assert not machine.running, 'the program does not end'
    if machine.error is not None:
        outcome.error = machine.error.line, machine.error.text
    return outcome


def expectations(text: str) -> Outcome:
    wanted = Outcome()
    for number, line in enumerate(text.splitlines(), 1):
        if found := EXPECT.search(line):
            if found['kind'] == ' error':
                wanted.error = number, found['text']
            elif found['kind']:
                wanted.compile_error = found['text']
            else:
                wanted.output.append(found['text'])
    return wanted


@pytest.mark.parametrize('path', CASES, ids=lambda path: f'{path.parent.name}/{path.stem}')
def test_program_does_what_its_comments_say(path: Path) -> None:
    text = path.read_text()
    assert run(text) == expectations(text)


def test_every_program_expects_something() -> None:
    silent = [path for path in CASES if expectations(path.read_text()) == Outcome()]
    assert not silent
    assert len(CASES) > 240
