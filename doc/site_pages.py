# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the site needs beyond Sphinx.

The pages are read on GitHub too, so their links lead to files of the repository. Those that are
pages of the site stay within it; all others become links to the repository.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import re
from typing import Any, ClassVar
from xml.etree import ElementTree

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from ur_cartesian_driver.cli import parser

ROOT = Path(__file__).resolve().parents[1]
#: Files outside doc/ that the site has as pages.
PAGES = {
    'README.md': 'index.md',
    'CONTRIBUTING.md': 'contributing.md',
    'CHANGELOG.rst': 'changes.md',
    'benchmark/README.md': 'benchmarks.md',
    'examples': 'examples.md',
    'action': 'interfaces.md',
    'msg': 'interfaces.md',
    'srv': 'interfaces.md',
    'config/driver.yaml': 'parameters.md',
    'doc/diagrams': 'diagrams/trajectory.md',
}
#: Pages that include a file from elsewhere in the repository, whose links count from there.
INCLUDED = {'contributing': 'CONTRIBUTING.md', 'benchmarks': 'benchmark/README.md'}
_LINK = re.compile(r'(?<=\]\()(?!https?:|#|mailto:)([^)#\s]+)(#[^)\s]*)?(?=\))')


def repository() -> str:
    """Return the address of the repository, as package.xml has it."""
    return ElementTree.parse(ROOT / 'package.xml').getroot().findtext('url', '')


def site_links(text: str, folder: Path, page_folder: Path) -> str:
    """
    Return a page with its links as the site needs them.

    :param folder: that the links of the text count from.
    :param page_folder: that of the page of the site.
    """

    def link(match: re.Match[str]) -> str:
        target = Path(os.path.normpath(folder / match[1]))
        anchor = match[2] or ''
        inside = str(target.relative_to(ROOT))
        if inside in PAGES:
            anchor = '' if inside == 'README.md' else anchor
            target = ROOT / 'doc' / PAGES[inside]
        elif not target.is_relative_to(ROOT / 'doc'):
            kind = 'tree' if target.is_dir() else 'blob'
            return f'{repository()}/{kind}/main/{inside}{anchor}'
        return os.path.relpath(target, page_folder) + anchor

    return _LINK.sub(link, text)


def _read(app: Sphinx, name: str, source: list[str]) -> None:
    page_folder = (ROOT / 'doc' / name).parent
    if name in INCLUDED:
        file = ROOT / INCLUDED[name]
        source[0] = site_links(file.read_text(encoding='utf-8'), file.parent, page_folder)
    else:
        source[0] = site_links(source[0], page_folder, page_folder)


class CommandReference(SphinxDirective):
    """The help of each command, from the parser itself."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each command."""
        top = parser()
        (commands,) = (a for a in top._actions if isinstance(a, argparse._SubParsersAction))
        return [section for each in commands.choices.values() for section in self._section(each)]

    def _section(self, command: argparse.ArgumentParser) -> list[nodes.Node]:
        name = command.prog
        section = nodes.section(ids=[nodes.make_id(name)], names=[name])
        section += nodes.title(text=name)
        section += nodes.literal_block(text=command.format_help(), language='text')
        self.state.document.note_implicit_target(section, section)
        return [section]


class FileList(SphinxDirective):
    """All files of a pattern, each as it is: interfaces, examples."""

    required_arguments = 1
    option_spec: ClassVar = {'language': str}

    def run(self) -> list[nodes.Node]:
        """Return a section for each file, in the order of their names."""
        found: list[nodes.Node] = []
        for path in sorted(ROOT.glob(self.arguments[0])):
            name = str(path.relative_to(ROOT))
            self.env.note_dependency(str(path))
            section = nodes.section(ids=[nodes.make_id(path.stem)], names=[path.stem])
            section += nodes.title(text=path.stem)
            section += nodes.paragraph('', '', nodes.literal(text=name))
            language = self.options.get('language', 'text')
            section += nodes.literal_block(
                text=path.read_text(encoding='utf-8'), language=language
            )
            self.state.document.note_implicit_target(section, section)
            found.append(section)
        return found


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it."""
    os.environ['COLUMNS'] = '96'  # the width of the help texts
    app.connect('source-read', _read)
    app.add_directive('command-reference', CommandReference)
    app.add_directive('file-list', FileList)
    app.add_lexer('mermaid', TextLexer)  # GitHub draws them
    return {'parallel_read_safe': True}
