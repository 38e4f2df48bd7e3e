# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Formats of other packages: found by name and suffix, and harmless where they are broken."""

from importlib.util import find_spec
import os
import subprocess
import sys

from checkout import CHECKOUT, needs_checkout
from pages import save_files
import pytest
from synthetic_recording import only_file, packet, record
import yaml

from ur_cartesian_driver.cli.export_command import EXPORTERS
from ur_cartesian_driver.file_formats import FileFormats
from ur_cartesian_driver.importing import FORMATS, ImportFormat

PAGE = CHECKOUT / 'doc' / 'adding_a_format.md'
CSV = 'x [m],y [m],z [m]\n0.1,0.2,0.3\n0.4,0.2,0.3\n'
READER = """
from ur_cartesian_driver.importing import ImportFormat

def collect(path, options, into):
    for line, text in enumerate(path.read_text().split('\\n'), 1):
        into.add(line, [float(word) for word in text.split()])

FORMAT = ImportFormat(collect=collect)
"""


def install(folder, name, importers='', exporters='', **modules):
    """Lay a package into a folder, as pip does; entry points are lines of NAME = VALUE."""
    info = folder / f'{name.replace("-", "_")}-1.5.dist-info'
    info.mkdir(parents=True)
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n')
    (info / 'entry_points.txt').write_text(
        f'[ur_cartesian_driver.importers]\n{importers}\n'
        f'[ur_cartesian_driver.exporters]\n{exporters}\n'
    )
    for module, text in modules.items():
        (folder / f'{module}.py').write_text(text)


def run(folder, *arguments):
    """Run Python with a folder of packages, and return its status and outputs."""
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get('PYTHONPATH')])])
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        env={**os.environ, 'PYTHONPATH': path, 'COLUMNS': '200'},
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert 'Traceback' not in done.stderr
    return done.returncode, done.stdout, done.stderr


def command(folder, *arguments):
    return run(folder, '-m', 'ur_cartesian_driver.cli', *arguments)


def positions(goal):
    """Return the positions of the points of a goal file."""
    return [
        [point['pose']['position'][axis] for axis in 'xyz']
        for point in yaml.safe_load(goal)['trajectory']['points']
    ]


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a package that reads .abc."""
    install(tmp_path, 'alphabet', 'abc = alphabet:FORMAT\n.abc = alphabet:FORMAT', alphabet=READER)
    (tmp_path / 'part.abc').write_text('0.1 0.2 0.3\n0.4 0.2 0.3')
    (tmp_path / 'part.csv').write_text(CSV)
    return tmp_path


# ---- the tables ----------------------------------------------------------------------------


def test_our_importers_are_there():
    assert len(FORMATS.built_in) == 25
    assert all(isinstance(FORMATS[name], ImportFormat) for name in FORMATS.built_in)


def test_our_exporters_are_there():
    assert [EXPORTERS[name].__name__ for name in EXPORTERS.built_in] == ['write_mcap', 'write_csv']


@pytest.fixture
def formats(folder, monkeypatch):
    """Return a table that has seen no other packages yet."""
    monkeypatch.syspath_prepend(folder)
    yield FileFormats('ur_cartesian_driver.importers', {'io:StringIO': 'text .txt'}, ())
    for module in ('alphabet', 'newer'):
        sys.modules.pop(module, None)


def test_names_are_known_without_importing_the_package(formats):
    assert {'text', 'abc'} <= set(formats.names())
    assert {'.txt', '.abc'} <= set(formats.suffixes())
    assert '.abc' in formats
    assert '.xyz' not in formats
    assert 'alphabet' not in sys.modules
    assert isinstance(formats['.abc'], ImportFormat)


def test_case_makes_no_difference(formats, folder):
    install(folder, 'capitals', '.XYZ = alphabet:FORMAT')
    assert '.xyz' in formats


# ---- commands ------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize('arguments', [['part.abc'], ['part.txt', '--format', 'abc']])
def test_the_command_reads_a_format_of_others(folder, arguments):
    (folder / 'part.abc').rename(folder / arguments[0])
    status, goal, said = command(folder, 'import', *arguments)
    assert status == 0
    assert positions(goal) == [[0.1, 0.2, 0.3], [0.4, 0.2, 0.3]]
    assert said.endswith('wrote 2 points to standard output\n')


@pytest.mark.slow
def test_lists_have_the_formats_of_others(folder):
    install(folder, 'writers', exporters='.pcd = writers:write')
    _, shown, _ = command(folder, 'import', '--help')
    assert '{csv,gcode,dxf,ros,urscript,recording,abc}' in shown
    _, shown, _ = command(folder, 'export', '--help')
    assert 'its suffix is the format, .mcap or .csv or .pcd;' in ' '.join(shown.split())
    status, _, said = command(folder, 'import', 'part.step')
    assert status == 1
    assert said == (
        "ur-cartesian import: part.step: '.step' is no suffix of a known format; give one of csv, "
        'gcode, dxf, ros, urscript, recording, abc.\n'
    )


# ---- what goes wrong -----------------------------------------------------------------------

#: For each suffix: a module with a fault, and the reason that the sentence gives.
BROKEN = {
    'raises': ('1 / 0', 'ZeroDivisionError: division by zero'),
    'exits': ('raise SystemExit(3)', 'SystemExit: 3'),
    'library': ("raise OSError('libscan.so:\\n not found')", 'OSError: libscan.so: not found'),
    'syntax': ('x = = 1', 'SyntaxError: invalid syntax (syntax.py, line 1)'),
    'missing': (None, "ModuleNotFoundError: No module named 'missing'"),
    'nothing': ('', "AttributeError: module 'nothing' has no attribute 'FORMAT'"),
    'kind': ('FORMAT = {}', "AttributeError: 'dict' object has no attribute 'collect'"),
    'bug': (
        READER.replace('text.split()', 'text.split()[3]'),
        'IndexError: list index out of range',
    ),
    'flat': (
        READER.replace('in text.split()', 'in text.split()[:2]'),
        'ValueError: not enough values to unpack (expected 3, got 2)',
    ),
}
IMPORTS = """
import sys
from ur_cartesian_driver.importing import import_file

for file in sys.argv[1:]:
    try:
        print(len(import_file(file).goal.waypoints))
    except ImportError as error:
        print(error)
"""


@pytest.fixture
def broken(folder):
    """Return the folder with broken packages beside the good one."""
    for name, (text, _) in BROKEN.items():
        install(
            folder,
            f'scan-{name}',
            f'.{name} = {name}:FORMAT',
            **({} if text is None else {name: text}),
        )
        (folder / f'part.{name}').write_text('0.1 0.2 0.3\n0.4 0.2 0.3')
    return folder


@pytest.mark.slow
def test_a_broken_package_is_named_and_breaks_nothing_else(broken):
    files = [f'part.{name}' for name in BROKEN]
    _, shown, _ = run(broken, '-c', IMPORTS, *files, 'part.abc', 'part.csv')
    *sentences, abc, csv = shown.splitlines()
    assert (abc, csv) == ('2', '2')
    assert len(sentences) == len(BROKEN) == 9
    for sentence, (name, (_, reason)) in zip(sentences, BROKEN.items(), strict=True):
        assert sentence.startswith(
            f"'.{name} = {name}:FORMAT' of scan-{name} 1.5 failed with {reason}"
        )
        assert sentence.endswith('; update or uninstall this package')


@pytest.mark.slow
def test_commands_say_what_is_broken(broken):
    status, goal, said = command(broken, 'import', 'part.raises')
    assert (status, goal) == (1, '')
    assert said == (
        "ur-cartesian import: part.raises: '.raises = raises:FORMAT' of scan-raises 1.5 failed "
        'with ZeroDivisionError: division by zero; update or uninstall this package\n'
    )
    status, goal, said = command(broken, 'import', 'part.csv')
    assert (status, len(positions(goal))) == (0, 2)
    assert 'scan' not in said


@pytest.mark.slow
def test_ours_win_and_a_warning_names_the_other_one(folder):
    install(folder, 'tables', 'csv = missing:FORMAT\n.csv = missing:FORMAT')
    status, goal, said = command(folder, 'import', 'part.csv')
    assert (status, len(positions(goal))) == (0, 2)
    assert said.startswith(
        "WARNING: '.csv = missing:FORMAT' of tables 1.5 is not used: .csv is built in; it needs "
        'another name\n'
    )
    (folder / 'part.csv').rename(folder / 'part.abc')
    status, _, said = command(folder, 'import', 'part.abc', '--format', 'csv')
    assert status == 0
    assert said.startswith("WARNING: 'csv = missing:FORMAT' of tables 1.5 is not used: csv is")


def test_of_two_packages_with_one_suffix_none_is_taken(formats, folder):
    install(folder, 'letters', '.abc = letters:FORMAT')
    with pytest.raises(ImportError) as caught:
        _ = formats['.abc']
    assert {
        *str(caught.value).removesuffix('; uninstall one of these packages').split(' by ')
    } == {
        '.abc is declared',
        "'.abc = alphabet:FORMAT' of alphabet 1.5 and",
        "'.abc = letters:FORMAT' of letters 1.5",
    }


def test_damaged_metadata_of_a_package_hides_no_other_one(formats, folder, caplog):
    install(folder, 'damaged', 'nonsense')
    assert isinstance(formats['.abc'], ImportFormat)
    assert caplog.messages == ['the entry points of damaged are damaged; reinstall it']


def test_a_package_that_is_installed_twice_counts_once(formats, folder, monkeypatch):
    install(folder / 'overlay', 'alphabet', '.abc = newer:FORMAT', newer=READER)
    monkeypatch.syspath_prepend(folder / 'overlay')
    assert isinstance(formats['.abc'], ImportFormat)


@pytest.fixture
def recording(tmp_path):
    record(tmp_path / 'made', map(packet, range(20)))
    return only_file(tmp_path / 'made')


@pytest.mark.slow
def test_an_export_that_fails_leaves_no_file(folder, recording):
    writer = (
        "def write(recording, file, options):\n    file.write(b'begin')\n    raise KeyError('x')"
    )
    install(folder, 'writers', exporters='.pcd = writers:write', writers=writer)
    status, shown, said = command(folder, 'export', recording, '-o', 'seam.pcd')
    assert (status, shown) == (1, '')
    assert said == (
        "ur-cartesian export: seam.pcd: '.pcd = writers:write' of writers 1.5 failed with "
        "KeyError: 'x'; update or uninstall this package\n"
    )
    assert list(folder.glob('seam*')) == []


# ---- the page ------------------------------------------------------------------------------


@pytest.mark.slow
@needs_checkout
def test_the_package_of_the_page_is_installed_and_works(tmp_path, recording):
    if not (find_spec('pip') and find_spec('setuptools')):
        pytest.skip('needs pip and setuptools')
    source, site = tmp_path / 'source', tmp_path / 'site'
    source.mkdir()
    save_files(PAGE, source)
    offline = ('--no-deps', '--no-build-isolation', '--no-index', '--quiet', '--target', site)
    status, _, said = run(source, '-m', 'pip', 'install', *offline, source)
    assert status == 0, said
    test = tmp_path / 'test_point_list.py'
    test.write_text((source / test.name).read_text())
    status, shown, _ = run(site, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', test)
    assert status == 0, shown
    assert '2 passed' in shown

    assert command(site, 'export', recording, '-o', 'seam.xyz') == (
        0,
        '20 packets: seam.xyz\n',
        '',
    )
    status, goal, said = command(site, 'import', 'seam.xyz', '--unit', 'm', '--format', 'points')
    assert status == 0, said
    assert positions(goal)[5] == [0.001, 0.001, 0.0]
    assert len(positions(goal)) == 20
