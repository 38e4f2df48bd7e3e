# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""`make release-check` refuses what must not be released."""

import importlib.util
import shutil

from checkout import CHECKOUT, needs_checkout
import pytest
from tracked_files import tracked_files
import yaml

SCRIPT = CHECKOUT / 'scripts' / 'check_release.py'
pytestmark = needs_checkout

URL = 'https://github.com/welding-cell/ur_cartesian_driver'
FILES = {
    'package.xml': f"""<package format="3">
  <name>ur_cartesian_driver</name>
  <version>0.2.0</version>
  <maintainer email="ada@welding-cell.org">Ada Lovelace</maintainer>
  <url type="repository">{URL}</url>
</package>
""",
    'CMakeLists.txt': 'project(ur_cartesian_driver VERSION 0.2.0)\n',
    'setup.py': "setup(\n    version=text('version'),\n)\n",
    'pyproject.toml': '[tool.ruff]\nline-length = 99\n',
    'CHANGELOG.rst': """Changelog
^^^^^^^^^

Forthcoming
-----------
* Goals

  * Add splines.

0.1.0 (2026-01-31)
------------------
* First release.
""",
    'README.md': f'$ git clone {URL}.git && cd ur_cartesian_driver\n',
    'SECURITY.md': 'Write to **security@welding-cell.org**.\n',
    '.github/ISSUE_TEMPLATE/config.yml': f'url: {URL}/security/policy\n',
    'doc/setup.md': f'git clone {URL}\ngit clone https://github.com/ros2/rclpy\n',
}


@pytest.fixture(scope='module')
def check_release():
    spec = importlib.util.spec_from_file_location('check_release', SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def problems(check_release, tmp_path):
    """Return a function: the problems of a release with one text replaced in one of its files."""

    def of_release_with(file=None, old='', new=''):
        for name, text in FILES.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            assert name != file or old in text
            path.write_text(text.replace(old, new) if name == file else text, encoding='utf-8')
        return check_release.problems(tmp_path)

    return of_release_with


def test_a_complete_release_passes(problems):
    assert problems() == []


@pytest.mark.parametrize(
    ('file', 'old', 'new', 'part'),
    [
        ('package.xml', 'Ada Lovelace', 'TO BE SET BEFORE A RELEASE', 'maintainer "TO BE SET'),
        ('package.xml', 'welding-cell.org', 'example.invalid', 'maintainer "Ada Lovelace'),
        ('package.xml', 'welding-cell.org', 'example.com', 'maintainer "Ada Lovelace'),
        ('package.xml', f'<url type="repository">{URL}</url>', '', '<url type="repository"> is'),
        ('README.md', 'welding-cell', '<owner>', 'README.md:1: `git clone` names a placeholder'),
        ('README.md', 'welding-cell', 'ada', 'README.md:1: `git clone` does not name the'),
        ('README.md', f'{URL}.git', 'REPOSITORY', 'README.md:1: `git clone` does not name the'),
        ('doc/setup.md', 'welding-cell', '<owner>', 'doc/setup.md:1: `git clone` names a pl'),
        ('SECURITY.md', 'welding-cell.org', 'example.invalid', 'SECURITY.md:1: "@example.'),
        (
            '.github/ISSUE_TEMPLATE/config.yml',
            'welding-cell',
            '<owner>',
            'config.yml:1: "<owner>"',
        ),
        ('CMakeLists.txt', '0.2.0', '0.1.0', 'CMakeLists.txt: the version is 0.1.0, but 0.2.0'),
        ('setup.py', "text('version')", "'0.1.0'", 'setup.py: the version is 0.1.0, but 0.2.0'),
        ('pyproject.toml', '[tool', '[project]\nversion = "0.1.0"\n[tool', 'pyproject.toml: the'),
        ('CHANGELOG.rst', '0.1.0 (', '0.2.0 (', 'CHANGELOG.rst: 0.2.0 is released already'),
        ('CHANGELOG.rst', '0.1.0 (', '0.10.0 (', 'CHANGELOG.rst: 0.10.0 is released already'),
        ('CHANGELOG.rst', '* Goals\n\n  * Add splines.\n', '', 'Forthcoming is empty'),
        ('CHANGELOG.rst', 'Forthcoming\n-----------\n', '', 'Forthcoming is empty'),
    ],
)
def test_what_is_incomplete_is_refused(file, old, new, part, problems):
    (problem,) = problems(file, old, new)
    assert part in problem


def test_a_placeholder_of_the_repository_is_refused(problems):
    first, *clones = problems('package.xml', 'github.com/welding-cell', 'github.com/&lt;owner&gt;')
    assert '/<owner>/ur_cartesian_driver is a placeholder' in first
    assert len(clones) == 2  # they name another repository now


def test_a_release_says_how_to_report_a_vulnerability(check_release, problems, tmp_path):
    problems()
    (tmp_path / 'SECURITY.md').unlink()
    (problem,) = check_release.problems(tmp_path)
    assert problem.startswith('SECURITY.md is missing')


def test_this_checkout_lacks_only_what_a_release_sets(check_release, tmp_path):
    for pattern in ('*', 'doc/**/*.md', '.github/**/*'):
        for file in tracked_files(CHECKOUT, pattern):
            copy = tmp_path / file.relative_to(CHECKOUT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(file, copy)
    lacking = check_release.problems(tmp_path)
    assert [
        problem
        for problem in lacking
        if 'placeholder' not in problem and 'Forthcoming' not in problem
    ] == []


def test_a_problem_ends_the_script_with_a_message(check_release, problems, monkeypatch, tmp_path):
    assert problems('CMakeLists.txt', '0.2.0', '0.1.0')
    monkeypatch.setattr(check_release, 'ROOT', tmp_path)
    with pytest.raises(SystemExit, match=r'^Not ready for a release:\n  CMakeLists\.txt'):
        check_release.main()


def test_issue_templates_are_forms():
    for path in tracked_files(CHECKOUT / '.github' / 'ISSUE_TEMPLATE', '*.yml'):
        form = yaml.safe_load(path.read_text(encoding='utf-8'))
        if path.name == 'config.yml':
            assert form['contact_links'][0].keys() == {'name', 'url', 'about'}
            continue
        assert {'name', 'description', 'body'} <= form.keys(), path.name
        fields = [field for field in form['body'] if field['type'] != 'markdown']
        names = [field['id'] for field in fields]
        assert len(set(names)) == len(names)
        assert all(field['attributes']['label'] for field in fields), path.name
