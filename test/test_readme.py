# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The documents are true: goals can be planned, snippets run, links and names exist."""

from __future__ import annotations

from dataclasses import fields
import importlib.util
import os
import re
import shlex
import subprocess
import sys
from textwrap import indent
import threading
from xml.etree import ElementTree

from checkout import CHECKOUT, needs_checkout
import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.cli import main, parser
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.sim.command_line import parser as simulator_parser

pytestmark = needs_checkout

README = CHECKOUT / 'README.md'
DOCUMENTS = [
    README,
    CHECKOUT / 'CONTRIBUTING.md',
    CHECKOUT / 'QUALITY_DECLARATION.md',
    CHECKOUT / 'SECURITY.md',
    CHECKOUT / 'benchmark' / 'README.md',
    *tracked_files(CHECKOUT, 'doc/**/*.md'),
]
#: Programs that the documents start and that are no part of this package.
FOREIGN = {
    'git',
    'cd',
    'cp',
    'mkdir',
    '.',
    'export',
    'make',
    'rosdep',
    'colcon',
    'pip',
    'ros2',
    'python',
    'pytest',
}
#: Where the simulator's own package can be imported from a checkout, with the driver's modules.
SIMULATOR_ALONE = {'PYTHONPATH': str(CHECKOUT / 'simulator')}


def name_of(document):
    return str(document.relative_to(CHECKOUT))


def blocks(document, *languages):
    """Return the fenced blocks of a document in one of the languages."""
    text = document.read_text(encoding='utf-8')
    return [
        body
        for language, body in re.findall(
            r'^ *```(\w*)\n(.*?)^ *```$', text, re.DOTALL | re.MULTILINE
        )
        if language in languages
    ]


def commands(document):
    """Return the commands of the shell blocks, each as a list of words."""
    found = []
    for body in blocks(document, 'bash'):
        found += lines_of(body)
    for body in blocks(document, 'console'):
        found += lines_of(
            '\n'.join(line[2:] for line in body.splitlines() if line.startswith('$ '))
        )
    return found


def lines_of(text):
    """Return the words of each line, quotes over several lines respected, comments left out."""
    words = shlex.shlex(text, posix=True, punctuation_chars='&\n')
    words.whitespace, words.whitespace_split, words.commenters = ' ', True, ''
    line, lines, comment = [], [], False
    for word in words:
        if set(word) <= {'&', '\n'}:
            lines.append(line)
            line, comment = [], False
        else:
            comment = comment or word.startswith('#')
            if not comment:
                line.append(word)
    return [line for line in [*lines, line] if line]


def snippets():
    return [
        pytest.param(body, id=f'{name_of(document)}-{number}')
        for document in DOCUMENTS
        if document.is_file()
        for number, body in enumerate(blocks(document, 'python'))
    ]


def snippet(part):
    """Return the one Python snippet of all documents that contains a text."""
    (found,) = [
        body for document in DOCUMENTS for body in blocks(document, 'python') if part in body
    ]
    return found


# ---- the goal -----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def send_goal():
    """Return the words of the one ros2 action send_goal line of all documents."""
    (found,) = [
        words
        for document in DOCUMENTS
        for words in commands(document)
        if words[1:3] == ['action', 'send_goal']
    ]
    return found


def test_send_goal_names_the_action_that_is_served(send_goal):
    assert send_goal[3:5] == [
        '/ur_cartesian_driver/follow_cartesian_trajectory',
        'ur_cartesian_driver/action/FollowCartesianTrajectory',
    ]
    assert len(send_goal) == 6


def test_send_goal_is_the_goal_of_the_square_example(send_goal):
    from ur_cartesian_driver.ros.client import load_goal

    assert load_goal(send_goal[5]) == load_goal(
        share_path() / 'config' / 'examples' / 'square.yaml'
    )


def test_send_goal_passes_planning_from_home_and_takes_ten_seconds(send_goal):
    from ur_cartesian_driver.kinematics.chain import Arm
    from ur_cartesian_driver.kinematics.robot_models import robot_model
    from ur_cartesian_driver.motion.goal.known_frames import Frames
    from ur_cartesian_driver.planning import plan, PlanningOptions
    from ur_cartesian_driver.planning.stop_prediction import state_at_rest
    from ur_cartesian_driver.ros.client import load_goal
    from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
    from ur_cartesian_driver.sim import HOME

    arm = Arm(robot_model('ur5e'))
    goal = goal_from_message(load_goal(send_goal[5]), Frames(), now=0)
    found = plan(goal, state_at_rest(arm, HOME), arm, PlanningOptions())
    assert found.duration == pytest.approx(10.0)
    assert [segment.length for segment in found.segments] == pytest.approx([0.2] * 4)


def test_plain_goal_passes_planning_from_home():
    from ur_cartesian_driver.kinematics.chain import Arm
    from ur_cartesian_driver.kinematics.robot_models import robot_model
    from ur_cartesian_driver.motion.goal.known_frames import Frames
    from ur_cartesian_driver.planning import plan, PlanningOptions
    from ur_cartesian_driver.planning.stop_prediction import state_at_rest
    from ur_cartesian_driver.ros.client import load_goal
    from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
    from ur_cartesian_driver.sim import HOME

    (body,) = blocks(CHECKOUT / 'doc' / 'goals.md', 'yaml')
    arm = Arm(robot_model('ur5e'))
    goal = goal_from_message(load_goal(body), Frames(), now=0)
    assert plan(goal, state_at_rest(arm, HOME), arm, PlanningOptions()).duration == 2.0


def test_the_output_of_where_is_a_point_of_a_goal():
    from ur_cartesian_driver.cli.commands import point_as_yaml
    from ur_cartesian_driver.kinematics.chain import Arm
    from ur_cartesian_driver.kinematics.robot_models import robot_model
    from ur_cartesian_driver.planning.stop_prediction import state_at_rest
    from ur_cartesian_driver.ros.client import load_goal
    from ur_cartesian_driver.sim import HOME

    arm = Arm(robot_model('ur5e'))
    printed = point_as_yaml(state_at_rest(arm, HOME)).replace('-0.000000', '0.000000')
    goal = load_goal(f'trajectory:\n  points:\n{indent(printed, "    ")}')
    position = goal.trajectory.points[0].pose.position
    assert (position.x, position.y, position.z) == pytest.approx(
        arm.forward(HOME).position, abs=1e-6
    )
    (shown,) = [
        body
        for document in DOCUMENTS
        for body in blocks(document, 'console')
        if 'ur-cartesian where' in body
    ]
    assert printed.splitlines()[3:] == shown.splitlines()[4:]


def test_demo_plans_what_the_document_shows(capsys):
    main(['validate', 'seam'])
    printed = ' '.join(capsys.readouterr().out.split())
    (shown,) = [
        body
        for body in blocks(CHECKOUT / 'doc' / 'getting_started.md', '')
        if 'client are starting' in body
    ]
    plan = re.search(r'^plan:\n(.*?)^SUCCEEDED: ', shown, re.DOTALL | re.MULTILINE)[1]
    lines = [line for line in plan.splitlines() if line != '...']
    assert len(lines) == 6
    assert [line for line in lines if line not in printed] == []


# ---- snippets -----------------------------------------------------------------------------------


@pytest.mark.parametrize('body', snippets())
def test_python_snippet_compiles(body):
    compile(body, 'snippet', 'exec')


@pytest.mark.slow
def test_snippet_without_ros_moves_the_arm(ur_sim, capsys):
    ports = ur_sim.ports
    there = (
        f"robot_ip='127.0.0.1', rtde_port={ports.rtde}, primary_port={ports.primary}, "
        'reverse_port=0, script_sender_port=0, trajectory_port=0, script_command_port=0, '
        # Robot and driver share this interpreter, which can be busy for longer than 0.2 s.
        'robot_receive_timeout=10.0, max_state_age=0.0'
    )
    body = snippet('outcome.code.name')
    assert "robot_ip='127.0.0.1'" in body
    exec(body.replace("robot_ip='127.0.0.1'", there), {})
    assert 'SUCCESSFUL All 2 points' in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    'part', ['sent = client.send_goal_async', '    outcome = client.execute(']
)
def test_snippet_of_an_action_client_moves_the_arm(part, ur_sim, cartesian_driver):
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(cartesian_driver)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    try:
        ended = subprocess.run(
            [sys.executable, '-c', snippet(part)],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            env=os.environ,
        )
    finally:
        executor.shutdown()
        spinning.join()
    assert (
        ended.stdout.splitlines()[-1].removeprefix('0 ').startswith('All 2 points were executed')
    ), ended.stderr


PYTEST = ('-m', 'pytest', '-p', 'no:cacheprovider', '--junitxml=outcome.xml')


def outcomes(folder):
    """Return for each test that pytest has run in a folder the failures, errors and skips."""
    report = ElementTree.parse(folder / 'outcome.xml')
    return [[child.tag for child in case] for case in report.iter('testcase')]


@pytest.mark.slow
def test_snippet_of_a_test_passes(tmp_path):
    file = tmp_path / 'test_snippet.py'
    file.write_text(snippet('def test_arm_is_simulated'), encoding='utf-8')
    ended = subprocess.run(
        [sys.executable, *PYTEST, '--strict-markers', file],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=tmp_path,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert outcomes(tmp_path) == [[]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('part', 'printed'),
    [('def reach()', 'PROTECTIVE_STOP'), ('MemorySockets()', '0.5')],
)
def test_snippet_of_the_simulator_alone_prints_what_it_says(part, printed):
    ended = subprocess.run(
        [sys.executable, '-c', snippet(part)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | SIMULATOR_ALONE,
    )
    assert ended.stdout.strip() == printed, ended.stderr


@pytest.mark.slow
def test_snippet_of_a_test_with_the_simulator_alone_passes(tmp_path):
    file = tmp_path / 'test_snippet.py'
    file.write_text(snippet('def test_my_program'), encoding='utf-8')
    plugin = ('-p', 'ur_controller_sim.pytest_plugin')
    ended = subprocess.run(
        [sys.executable, *PYTEST, *plugin, file],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=tmp_path,
        env=os.environ | SIMULATOR_ALONE,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert outcomes(tmp_path) == [[]]


# ---- commands and links -------------------------------------------------------------------------


@pytest.mark.parametrize('document', DOCUMENTS, ids=name_of)
def test_commands_exist(document):
    for words in commands(document):
        if words[0] == 'ur-cartesian':
            parser().parse_args([word.replace('FILE', 'square') for word in words[1:]])
        elif words[0] == 'ur-controller-sim':
            simulator_parser().parse_args(words[1:])
        elif words[0] == 'ur-cartesian-driver':
            check_parameters(words)
        elif words[0].startswith('scripts/'):
            assert (CHECKOUT / words[0]).is_file()
        elif words[0] == 'make':
            targets = re.findall(r'^([\w-]+):', (CHECKOUT / 'Makefile').read_text(), re.MULTILINE)
            assert words[1] in targets
        elif words[:2] == ['ros2', 'launch']:
            check_launch(words)
        else:
            assert words[0] in FOREIGN, words


def check_parameters(words):
    from ur_cartesian_driver.ros.node import UR_DRIVER_NAMES
    from ur_cartesian_driver.ros.parameters.parameter_table import DECLARATIONS

    known = {declaration.name for declaration in DECLARATIONS}
    given = {word.split(':=')[0] for word in words if ':=' in word}
    assert [word for word in words if word != UR_DRIVER_NAMES][1] == '--ros-args'
    assert given <= known


def check_launch(words):
    text = (share_path() / 'launch' / words[3]).read_text(encoding='utf-8')
    assert words[2] == 'ur_cartesian_driver'
    for word in words[4:]:
        assert f"'{word.split(':=')[0]}'" in text


def sections(document):
    """Return the anchors that GitHub gives the headings of a document."""
    text = re.sub(r'^ *```.*?^ *```$', '', document.read_text('utf-8'), flags=re.DOTALL | re.M)
    return [
        re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')
        for heading in re.findall(r'^#+ (.*?)$', text, re.MULTILINE)
    ]


@pytest.mark.parametrize('document', DOCUMENTS, ids=name_of)
def test_links_lead_to_sections(document):
    text = document.read_text(encoding='utf-8')
    missing = [
        f'{target}#{section}'
        for target, section in re.findall(r'\]\(([^)#:]*\.md|)#([^)]+)\)', text)
        if section not in sections(document.parent / target if target else document)
    ]
    assert missing == []


@pytest.mark.parametrize('document', DOCUMENTS, ids=name_of)
def test_links_lead_to_files(document):
    text = document.read_text(encoding='utf-8')
    targets = re.findall(r'\]\(([^)#]+)(?:#[^)]*)?\)', text)
    missing = [
        target
        for target in targets
        if not target.startswith('https://') and not (document.parent / target).exists()
    ]
    assert missing == []


@pytest.mark.parametrize('page', ['glossary.md', 'architecture.md', 'planning.md'])
def test_modules_that_a_page_names_exist(page):
    text = (CHECKOUT / 'doc' / page).read_text(encoding='utf-8')
    named = re.findall(r'`([a-z_]+(?:/[a-z_]+)+/?(?:\.py)?)`', text)
    assert len(named) > 5
    folders = CHECKOUT / 'ur_cartesian_driver', CHECKOUT
    assert [
        name
        for name in named
        if not any((folder / f'{name}{end}').exists() for folder in folders for end in ('', '.py'))
    ] == []


def test_names_that_the_glossary_finds_in_modules_are_there():
    text = (CHECKOUT / 'doc' / 'glossary.md').read_text(encoding='utf-8')
    places = re.findall(r'`([a-z_/]+\.py)` \((`[^)]+`)\)', text)
    assert len(places) > 30
    missing = []
    for module, names in places:
        source = (CHECKOUT / 'ur_cartesian_driver' / module).read_text(encoding='utf-8')
        for name in re.findall(r'`(?:\w+\.)?(\w+)`', names):
            if not re.search(rf'(class|def) {name}\b|^ *{name}\b', source, re.MULTILINE):
                missing.append((module, name))
    assert missing == []


def test_readme_leads_to_every_document():
    linked = set()
    for document in DOCUMENTS:
        text = document.read_text(encoding='utf-8')
        linked |= {
            (document.parent / target).resolve() for target in re.findall(r'\]\(([^)#]+)\)', text)
        }
        for body in re.findall(r'^```\{toctree\}\n(.*?)^```', text, re.DOTALL | re.MULTILINE):
            pages = [line for line in body.splitlines() if line and not line.startswith(':')]
            linked |= {(document.parent / f'{page}.md').resolve() for page in pages}
    assert [name_of(d) for d in DOCUMENTS[1:] if d not in linked] == []


def test_readme_is_one_page():
    assert len(README.read_text(encoding='utf-8').splitlines()) <= 150


# ---- statements about the code ------------------------------------------------------------------


def test_every_error_code_is_described_with_its_number():
    text = (CHECKOUT / 'doc' / 'errors.md').read_text(encoding='utf-8')
    described = re.findall(r'^### (\w+), (-?\d+)$', text, re.MULTILINE)
    assert {(name, int(number)) for name, number in described} == {
        (code.name, code.value) for code in ErrorCode
    }
    assert len(described) == len(ErrorCode)


def test_every_parameter_that_is_named_as_one_exists():
    from ur_cartesian_driver.ros.parameters.node_parameters import defaults
    from ur_cartesian_driver.ros.parameters.parameter_table import declarations_of
    from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings

    named = [
        name
        for document in DOCUMENTS
        for table in re.findall(
            r'^\| parameter \|.*?\n\n',
            document.read_text(encoding='utf-8'),
            re.DOTALL | re.MULTILINE,
        )
        for line in table.strip().splitlines()[2:]
        for name in re.findall(r'`(\w+)`', line.split('|')[1])
    ]
    assert {'robot_ip', 'ur_type', 'max_tool_speed'} <= set(named)
    of_names = {declaration.name for declaration in declarations_of(NamesSettings)}
    assert set(named) <= set(defaults()) | of_names


def test_every_imperfection_is_described():
    from ur_cartesian_driver.sim.motion.imperfect_arm import Imperfections

    text = (CHECKOUT / 'doc' / 'simulation.md').read_text(encoding='utf-8')
    (table,) = re.findall(r'^\| imperfection \|.*?\n\n', text, re.DOTALL | re.MULTILINE)
    named = re.findall(
        r'`(\w+)`', ''.join(line.split('|')[1] for line in table.strip().splitlines())
    )
    assert sorted([*named, 'seed']) == sorted(field.name for field in fields(Imperfections))


def test_every_example_is_listed():
    text = (CHECKOUT / 'doc' / 'goals.md').read_text(encoding='utf-8')
    listed = re.findall(r'\]\(\.\./config/examples/(\w+)\.yaml\)', text)
    assert sorted(listed) == sorted(
        path.stem for path in tracked_files(share_path() / 'config' / 'examples', '*.yaml')
    )


def test_every_robot_model_is_listed():
    from ur_cartesian_driver.kinematics.robot_models import MODELS

    (section,) = re.findall(
        r'^## Robots\n(.*?)^## ', README.read_text(encoding='utf-8'), re.DOTALL | re.MULTILINE
    )
    assert set(re.findall(r'\bur\d+(?:e|long)?\b', section)) == set(MODELS)


def script(name):
    spec = importlib.util.spec_from_file_location(name, CHECKOUT / 'scripts' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_parameter_file_is_that_of_the_declarations():
    make_parameter_file = script('make_parameter_file')
    assert make_parameter_file.FILE.read_text(encoding='utf-8') == make_parameter_file.text(), (
        'run python scripts/make_parameter_file.py'
    )


def test_diagrams_are_those_of_the_tables():
    make_diagrams = script('make_diagrams')
    directory = CHECKOUT / 'doc' / 'diagrams'
    assert {
        path.name: path.read_text(encoding='utf-8') for path in tracked_files(directory, '*.md')
    } == make_diagrams.pages(), 'run python scripts/make_diagrams.py'
