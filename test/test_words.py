# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Names follow one pattern, and no name stands for two things.

doc/glossary.md says which word stands for what.
"""

from collections.abc import Callable, Iterator
import functools
import io
import keyword
from pathlib import Path
import re
import tokenize

from tracked_files import tracked_files

import ur_cartesian_driver

TESTS = Path(__file__).resolve().parent
CHECKOUT = TESTS.parent
PACKAGE = Path(ur_cartesian_driver.__file__).parent
GENERATED = ('action', 'msg', 'srv')

#: Bounds are MAX_ and MIN_, waiting times ..._TIMEOUT; so these are other words for the same.
OTHER_PREFIXES = ('MOST_', 'LEAST_', 'LARGEST_', 'SMALLEST_')
OTHER_SUFFIXES = ('PATIENCE',)

#: Everyday words, as parts of names of the package: no term of the field.
WORDS_GONE = {'borne', 'nobody', 'room', 'rooms', 'spoken', 'told', 'way', 'ways'}

#: Names that two things in the package may have, with the reason.
SHARED_NAMES: dict[str, str] = {}


def own_modules(folder: Path) -> list[Path]:
    """Return the modules below a folder, without those that the build generates."""
    return [
        path
        for path in tracked_files(folder, '**/*.py')
        if not (folder == PACKAGE and path.relative_to(folder).parts[0] in GENERATED)
    ]


def all_modules() -> list[Path]:
    beside = [CHECKOUT / name for name in ('benchmark', 'scripts')]
    return [path for folder in (PACKAGE, TESTS, *beside) for path in own_modules(folder)]


def identifiers(source: str) -> set[str]:
    """Return all names of a module: classes, functions, parameters, attributes, modules."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    names = {token.string for token in tokens if token.type == tokenize.NAME}
    return {name for name in names if not keyword.iskeyword(name)}


@functools.cache
def breaks_the_pattern(name: str) -> bool:
    """Tell whether a bound or a waiting time is named otherwise than all others."""
    bare = name.lstrip('_')
    return bare.startswith(OTHER_PREFIXES) or bare.endswith(OTHER_SUFFIXES)


@functools.cache
def everyday_words(name: str) -> set[str]:
    parts = re.findall(r'[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])', name)
    return {part.lower() for part in parts} & WORDS_GONE


def names_where(condition: Callable[[str], object], path: Path) -> list[str]:
    """Return the names of a module, its own included, for which a condition holds."""
    source = path.read_text()
    # Most modules do not even have such a word in a comment, and tokens take their time.
    if not any(map(condition, {path.stem, *re.findall(r'[^\W\d]\w*', source)})):
        return []
    return sorted(filter(condition, {path.stem, *identifiers(source)}))


def shared(named: Iterator[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names that occur more than once, with their places."""
    places: dict[str, list[str]] = {}
    for name, place in named:
        places.setdefault(name, []).append(place)
    return {
        name: found
        for name, found in places.items()
        if len(found) > 1 and name not in SHARED_NAMES
    }


def classes() -> Iterator[tuple[str, str]]:
    for path in own_modules(PACKAGE):
        for name in re.findall(r'^ *class (\w+)[(:]', path.read_text(), re.MULTILINE):
            yield name, str(path.relative_to(PACKAGE))


def module_names(folder: Path) -> Iterator[tuple[str, str]]:
    for path in own_modules(folder):
        if path.stem not in ('__init__', '__main__', 'conftest'):
            yield path.stem, str(path.relative_to(folder))


def test_names_that_break_the_pattern_are_recognised():
    source = 'def seize(MOST_JOBS, *, patience=JOIN_PATIENCE):\n    return x.LeastOne + _LEAST_X\n'
    assert {name for name in identifiers(source) if breaks_the_pattern(name)} == {
        'MOST_JOBS',
        'JOIN_PATIENCE',
        '_LEAST_X',
    }
    assert everyday_words('_PathWay_2') == everyday_words('UNDER_WAY') == {'way'}
    assert everyday_words('waypoint') == everyday_words('Always') == set()


def test_bounds_and_waiting_times_are_named_alike():
    found = {str(path): names_where(breaks_the_pattern, path) for path in all_modules()}
    assert {path: names for path, names in found.items() if names} == {}


def test_no_name_of_the_package_has_an_everyday_word_in_place_of_a_term():
    found = {str(path): names_where(everyday_words, path) for path in own_modules(PACKAGE)}
    assert {path: names for path, names in found.items() if names} == {}


def test_no_class_of_the_package_shares_its_name_with_another_one():
    assert shared(classes()) == {}


def test_no_module_of_the_package_shares_its_name_with_another_one():
    assert shared(module_names(PACKAGE)) == {}


def test_no_test_module_shares_its_name_with_another_one():
    assert shared(module_names(TESTS)) == {}
