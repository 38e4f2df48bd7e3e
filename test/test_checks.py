# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""`make lint`, the hooks of git and the public CI run the same checks."""

from pathlib import Path
import re

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[1]
HOOKS = CHECKOUT / '.pre-commit-config.yaml'
pytestmark = pytest.mark.skipif(not HOOKS.is_file(), reason='only a checkout has these files')


@pytest.fixture(scope='module')
def hooks():
    (repository,) = yaml.safe_load(HOOKS.read_text())['repos']
    assert repository['repo'] == 'local'
    return repository['hooks']


def without_options(command):
    return ' '.join(word for word in command.split() if not word.startswith('--'))


def test_a_commit_is_checked_as_by_make_lint(hooks):
    recipe = re.search(r'^lint:.*\n((?:\t.*\n)+)', (CHECKOUT / 'Makefile').read_text(), re.M)[1]
    checks = {without_options(line.replace('$(bin)', '.venv/bin')) for line in recipe.splitlines()}
    assert checks == {without_options(hook['entry']) for hook in hooks if 'stages' not in hook}


def test_the_hooks_run_the_tools_of_the_environment(hooks):
    for hook in hooks:
        assert hook['language'] == 'system'
        assert hook['entry'].startswith('.venv/bin/'), hook['id']


def test_the_public_ci_runs_what_has_to_pass_here():
    workflow = yaml.safe_load((CHECKOUT / '.github' / 'workflows' / 'ci.yml').read_text())
    (job,) = workflow['jobs'].values()
    assert [step.get('run') or step['uses'].split('@')[0] for step in job['steps']] == [
        'actions/checkout',
        'actions/setup-python',
        '.ci/run',
    ]
    assert (CHECKOUT / '.ci' / 'run').stat().st_mode & 0o100


def test_the_public_ci_has_every_python_that_is_supported():
    workflow = (CHECKOUT / '.github' / 'workflows' / 'ci.yml').read_text()
    classifiers = re.findall(r'Python :: (3\.\d+)', (CHECKOUT / 'setup.py').read_text())
    assert sorted(re.findall(r'^ +(3\.\d+)$', workflow, re.M)) == sorted(classifiers)
