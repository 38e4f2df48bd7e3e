# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Refuse a release that still has placeholders, disagrees on its version, or has no changelog.

Run it when the version is set and the entries of the release stand under Forthcoming::

    python scripts/check_release.py
"""

from __future__ import annotations

from pathlib import Path
import re
import sys
import tomllib
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]

PLACEHOLDER = re.compile(r'<\w+>|TO BE SET|@(\S+\.)?example\.|\.invalid\b', re.IGNORECASE)


def problems(root: Path) -> list[str]:
    """Return what prevents a release of the checkout, one sentence each."""
    package = ElementTree.parse(root / 'package.xml').getroot()
    return [
        *maintainer_problems(package),
        *repository_problems(package, root),
        *contact_problems(root),
        *version_problems(package, root),
        *changelog_problems(package, root),
    ]


def maintainer_problems(package: ElementTree.Element) -> list[str]:
    """Return a sentence for each maintainer of package.xml that is a placeholder."""
    maintainers = [
        f'{(element.text or "").strip()} <{element.get("email", "")}>'
        for element in package.iter('maintainer')
    ]
    return [
        f'package.xml: the maintainer "{maintainer}" is a placeholder; set name and email.'
        for maintainer in maintainers
        if PLACEHOLDER.search(maintainer.replace('<', '').replace('>', ''))
    ]


def repository_problems(package: ElementTree.Element, root: Path) -> list[str]:
    """Return errors of the repository's URL, and documents that name another one."""
    name = package.findtext('name', '')
    url = package.findtext('url[@type="repository"]', '').strip()
    if not url:
        return ['package.xml: <url type="repository"> is missing; add it.']
    found = []
    if PLACEHOLDER.search(url):
        found.append(f'package.xml: the repository URL {url} is a placeholder; set it.')
    for page in (*sorted(root.glob('*.md')), *sorted(root.glob('doc/**/*.md'))):
        for number, line in enumerate(page.read_text(encoding='utf-8').splitlines(), 1):
            _, clones, what = line.partition('git clone ')
            if not clones or name not in what:
                continue
            place = f'{page.relative_to(root)}:{number}'
            if PLACEHOLDER.search(what):
                found.append(f'{place}: `git clone` names a placeholder; name the repository.')
            elif what.split()[0] not in (url, f'{url}.git'):
                found.append(
                    f'{place}: `git clone` does not name the repository of package.xml, {url}.git.'
                )
    return found


def contact_problems(root: Path) -> list[str]:
    """Return the errors of the files that tell people how to report something."""
    found = []
    if not (root / 'SECURITY.md').is_file():
        found.append('SECURITY.md is missing; say in it how to report a vulnerability.')
    pages = [*root.glob('SECURITY.md'), *sorted(root.glob('.github/**/*.*'))]
    for page in pages:
        for number, line in enumerate(text_of(page).splitlines(), 1):
            if placeholder := PLACEHOLDER.search(line):
                found.append(
                    f'{page.relative_to(root)}:{number}: "{placeholder[0]}" is of a placeholder; '
                    'set the contact or the address.'
                )
    return found


def version_problems(package: ElementTree.Element, root: Path) -> list[str]:
    """Return the files whose version differs from package.xml."""
    version = package.findtext('version', '')
    cmake = re.search(r'^project\(\w+ VERSION (\S+)\)', text_of(root / 'CMakeLists.txt'), re.M)
    setup = re.search(r'^ +version=(.+),$', text_of(root / 'setup.py'), re.M)
    project = tomllib.loads(text_of(root / 'pyproject.toml')).get('project', {})
    named = {
        'CMakeLists.txt': cmake[1] if cmake else 'none',
        # setup.py reads the version of package.xml by text('version').
        'setup.py': setup[1].replace("text('version')", version).strip('\'"') if setup else 'none',
        'pyproject.toml': project.get('version', version),
    }
    return [
        f'{file}: the version is {other}, but {version} in package.xml; set both to the same.'
        for file, other in named.items()
        if other != version
    ]


def changelog_problems(package: ElementTree.Element, root: Path) -> list[str]:
    """Return the errors of CHANGELOG.rst for the version of package.xml."""
    version = package.findtext('version', '')
    _, *parts = re.split(r'^(\S.*)\n-+$', text_of(root / 'CHANGELOG.rst'), flags=re.M)
    sections = dict(zip(parts[::2], parts[1::2], strict=True))
    found = []
    if not re.search(r'^\* ', sections.pop('Forthcoming', ''), re.M):
        found.append('CHANGELOG.rst: Forthcoming is empty; say what the release changes.')
    released = [title.split()[0] for title in sections]
    if newer := [other for other in released if numbers(other) >= numbers(version)]:
        found.append(
            f'CHANGELOG.rst: {newer[0]} is released already, but package.xml has {version}; '
            'set a higher version in package.xml and CMakeLists.txt.'
        )
    return found


def numbers(version: str) -> list[int]:
    """Return the numbers of a version, which can be compared."""
    return [int(part) for part in re.findall(r'\d+', version)]


def text_of(path: Path) -> str:
    """Return the text of a file."""
    return path.read_text(encoding='utf-8')


def main() -> None:
    """Print what prevents a release and exit with 1; exit with 0 if nothing does."""
    if found := problems(ROOT):
        sys.exit('\n'.join(['Not ready for a release:', *(f'  {problem}' for problem in found)]))


if __name__ == '__main__':
    main()
