# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Files of a format that are cut, mixed or changed in single characters, and their import."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
import re

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportedGoal, ImportOptions

#: Characters with a meaning in one format or another, and some without a meaning in any.
_CHARACTERS = '0123456789.,;:-+eE \t\n"\'()[]{}#%=/*_<>&|!xyzGMNFSTO\0\x0c\x85\u2028\u00b0\u20ac'
_WORD = re.compile(r'[A-Za-z_]\w*|[-+]?\d+\.?\d*')
#: Matches the place that a sentence names.
_PLACE = re.compile(r'^(line|row|packet|point|entity) \w+: ')
#: Matches faults of a whole file, which have no line.
_WHOLE_FILE = re.compile(
    r'^(there is no point|the file is empty|the file is no recording|the file is damaged|'
    r'this is a binary file|the file begins as|'
    r'the drawing does not say|it is nested too deeply)'
)


def broken(files: Sequence[str], random: Random, together: int = 1) -> str:
    """
    Return one of the files with one to four faults.

    :param together: the number of lines that are moved or left out together.
    """
    text = random.choice(files)
    for _ in range(random.randint(1, 4)):
        if not text:
            break
        at = random.randrange(len(text))
        fault = random.randrange(9)
        if fault == 0:  # cut off
            text = text[:at]
        elif fault == 1:  # the middle is missing
            text = text[:at] + text[min(len(text), at + random.randint(1, 80)) :]
        elif fault == 2:  # the tail of another file
            other = random.choice(files)
            text = text[:at] + other[random.randrange(len(other)) :]
        elif fault in (3, 4):  # a line at another place, or missing
            lines = text.split('\n')
            at, to = (together * random.randrange(len(lines) // together + 1) for _ in '12')
            moved = lines[at : at + together] if fault == 3 else []
            lines[to : to + (0 if moved else together)] = moved
            text = '\n'.join(lines)
        elif fault < 7:  # another word or number
            here, there = (list(_WORD.finditer(each)) for each in (text, random.choice(files)))
            if here and there:
                begin, end = random.choice(here).span()
                text = text[:begin] + random.choice(there)[0] + text[end:]
        else:  # a character
            text = text[:at] + random.choice(_CHARACTERS) + text[at + random.randint(0, 1) :]
    return text


def broken_texts(
    files: Sequence[str], count: int, random: Random, together: int = 1
) -> Iterator[str]:
    """Return ``count`` broken files."""
    return (broken(files, random, together) for _ in range(count))


def goal_or_sentence(
    file: Path, text: str | bytes, options: ImportOptions | None = None
) -> ImportedGoal | str:
    """
    Import a text by the suffix of a file; assert that a refusal is one sentence with its place.

    :returns: the goal, or the sentence.
    """
    file.write_bytes(text if isinstance(text, bytes) else text.encode(errors='surrogatepass'))
    try:
        return import_file(file, options)
    except BrokenFile as error:
        sentence = str(error)
    assert '\n' not in sentence, sentence
    assert sentence.endswith('.'), sentence
    assert not sentence.endswith('..'), sentence
    assert 'Error' not in sentence, sentence
    assert _PLACE.match(sentence) or _WHOLE_FILE.match(sentence), sentence
    return sentence
