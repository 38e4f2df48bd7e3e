# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""`make lint`, the hooks of git and the public CI run the same checks."""

from pathlib import Path
import re
import shutil
import subprocess
import sys

from checkout import CHECKOUT, needs_checkout
import pytest
from tracked_files import tracked_files
import yaml

MISSPELT = 'te' + 'h'
HOOKS = CHECKOUT / '.pre-commit-config.yaml'
pytestmark = needs_checkout


@pytest.fixture(scope='module')
def hooks():
    (repository,) = yaml.safe_load(HOOKS.read_text())['repos']
    assert repository['repo'] == 'local'
    return repository['hooks']


def without_options(command):
    return ' '.join(word for word in command.split() if not word.startswith('--'))


def lint_commands(folder):
    """Return the commands of `make lint` in a folder, as make prints them."""
    make = ['make', '-n', '-f', str(CHECKOUT / 'Makefile'), '-o', '.venv/.installed', 'lint']
    printed = subprocess.run(make, cwd=folder, capture_output=True, text=True, check=True)
    return [line for line in printed.stdout.splitlines() if '.venv/bin/' in line]


def test_a_commit_is_checked_as_by_make_lint(hooks):
    checks = {without_options(line.rpartition('xargs -0 ')[2]) for line in lint_commands(CHECKOUT)}
    assert checks == {without_options(hook['entry']) for hook in hooks if 'stages' not in hook}


@pytest.fixture
def project(tmp_path):
    """Return a folder with our settings and a module without faults, that git tracks."""
    for name in ('Makefile', 'pyproject.toml'):
        shutil.copy2(CHECKOUT / name, tmp_path)
    (tmp_path / 'examples').mkdir()
    (tmp_path / 'examples' / 'good.py').write_text("NAME: str = 'good'\n")
    subprocess.run(['git', 'init', '--quiet'], cwd=tmp_path, check=True)
    subprocess.run(['git', 'add', '--all'], cwd=tmp_path, check=True)
    return tmp_path


@pytest.mark.slow
def test_what_a_user_writes_into_a_checkout_is_not_linted(project):
    """Each tool finds a fault of its own in the same files once git tracks them."""

    def refusing_tools():
        return [
            command.split('.venv/bin/')[1].split()[0]
            for command in lint_commands(project)
            if 'lint-imports' not in command  # it reads the package only
            and subprocess.run(
                command.replace('.venv/bin', str(Path(sys.executable).parent)),
                shell=True,
                cwd=project,
                capture_output=True,
                check=False,
            ).returncode
        ]

    for folder in ('', 'doc', 'examples', 'my goals'):
        (project / folder).mkdir(exist_ok=True)
        (project / folder / 'own.py').write_text(f'import os\nx: int  = "{MISSPELT}"\n')
        (project / folder / 'demo.html').write_text(f'<p>{MISSPELT}</p>')
        (project / folder / 'goal.yaml').write_text(f'{MISSPELT}: 1')
    assert refusing_tools() == []
    subprocess.run(['git', 'add', '--all'], cwd=project, check=True)
    assert refusing_tools() == ['ruff', 'ruff', 'mypy', 'codespell']


def test_the_hooks_run_the_tools_of_the_environment(hooks):
    for hook in hooks:
        assert hook['language'] == 'system'
        assert hook['entry'].startswith('.venv/bin/'), hook['id']


@pytest.fixture(scope='module')
def jobs():
    workflow = CHECKOUT / '.github' / 'workflows' / 'ci.yml'
    return yaml.safe_load(workflow.read_text())['jobs']


def test_the_public_ci_runs_what_has_to_pass_here(jobs):
    for name, command in (('ci', '.ci/run ${{ matrix.job }}'), ('newest', '.ci/run newest')):
        assert [step.get('run') or step['uses'].split('@')[0] for step in jobs[name]['steps']] == [
            'actions/checkout',
            'actions/setup-python',
            command,
        ]
    run = CHECKOUT / '.ci' / 'run'
    assert run.stat().st_mode & 0o100
    documented = re.findall(r'^#   (\w+)  +\w', run.read_text(), re.MULTILINE)
    # Lint is part of the tests.
    assert sorted([*jobs['ci']['strategy']['matrix']['job'], 'lint', 'newest']) == sorted(
        documented
    )


def test_only_the_newest_versions_of_everything_may_fail(jobs):
    assert [name for name, job in jobs.items() if job.get('continue-on-error')] == ['newest']


def test_an_unknown_job_is_refused_in_a_sentence():
    run = [str(CHECKOUT / '.ci' / 'run'), 'newst']
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        ".ci/run: there is no job 'newst': see the first lines of .ci/run, "
        'or name none for everything.\n'
    )


def test_the_public_ci_has_every_python_that_is_supported(jobs):
    classifiers = re.findall(r'Python :: (3\.\d+)', (CHECKOUT / 'setup.py').read_text())
    _, python, _ = jobs['ci']['steps']
    assert python['with']['python-version'].split() == classifiers


def test_what_reads_the_checkout_is_marked():
    """Else it fails where the package is installed, long after `make test` has passed."""
    reads = re.compile(r"\bCHECKOUT\b|(?<!'config' )/ '(?:doc|scripts|benchmark|examples)'|'doc/")
    unmarked = [
        str(module.relative_to(CHECKOUT))
        for module in tracked_files(CHECKOUT, 'test/**/test_*.py')
        if reads.search(text := module.read_text('utf-8')) and 'needs_checkout' not in text
    ]
    # The browser's job runs in the checkout alone; the others look whether there is one.
    assert unmarked == [
        'test/browser/test_pages.py',
        'test/browser/test_site.py',
        'test/test_words.py',
    ]
