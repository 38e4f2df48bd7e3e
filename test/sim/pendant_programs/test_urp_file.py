# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Program files of PolyScope: what is read, and what is refused with its name."""

from dataclasses import replace
import gzip

import pytest
from urp_text import EXTERNAL_CONTROL, script_file, script_line, urp_text

from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    ExternalControlNode,
    FetchedScript,
    function_name,
    ProgramTree,
    ScriptText,
)
from ur_cartesian_driver.sim.pendant_programs.urp_file import read_urp
from ur_cartesian_driver.sim.programs.stored_programs import StoredPrograms
from ur_cartesian_driver.urscript import parse

CODE = 'if 1 < 2 and "a&b" == "c":\n  x = 3\nend\n'
NODES = (
    script_line('textmsg("a < b & \'c\'")'),
    '<Comment comment="x"/>',
    EXTERNAL_CONTROL,
    f'<Folder name="f"><children>{script_file(CODE)}</children></Folder>',
    '<Wait type="Sleep"><waitTime>1.5</waitTime></Wait>',
    '<Popup type="Message" haltProgram="false" message="a &quot;b&quot;"/>',
    '<Popup type="Message" haltProgram="true" message="end"/>',
)
TREE = ProgramTree(
    (
        ScriptText('textmsg("a < b & \'c\'")'),
        ExternalControlNode(),
        ScriptText(CODE),
        ScriptText('sleep(1.5)'),
        ScriptText('popup("a \'b\'", "Message", False, False, blocking=True)'),
        ScriptText('popup("end", "Message", False, False, blocking=True)\nhalt'),
    )
)


@pytest.mark.parametrize('pack', [bytes, gzip.compress])
def test_a_file_is_read_compressed_or_not(pack):
    assert read_urp(pack(urp_text(*NODES).encode()), 'a.urp') == TREE


def test_a_program_may_loop():
    assert read_urp(urp_text(*NODES, once=False).encode(), 'a.urp').loops


@pytest.mark.parametrize(
    ('data', 'reason'),
    [
        (b'def p():\nend\n', 'is no program file of PolyScope 3 or 5: '),
        (b'\x1f\x8bno gzip', 'is no program file of PolyScope 3 or 5: '),
        (gzip.compress(b'<a/>', mtime=0)[:12], 'is no program file of PolyScope 3 or 5: '),
        (b'<?xml version="1.0" encoding="martian"?><a/>', 'unknown encoding'),
        (gzip.compress(b' ' * 10_000_001), 'larger than 10000000 bytes'),
        (b'<!DOCTYPE a><a/>', 'it has a DOCTYPE'),
        (b'<Installation/>', 'it has no <URProgram> with a <MainProgram>'),
        (urp_text('<MoveJ/>').encode(), 'has a node <MoveJ>, which the simulator does not run'),
        (
            urp_text('<Contributed strategyURCapName="Gripper"/>').encode(),
            'has a node <Contributed> (Gripper), which',
        ),
        (
            urp_text().replace('</MainProgram>', '</MainProgram><SubProgram/>').encode(),
            'has a node <SubProgram>, which',
        ),
        (urp_text('<Wait type="Sleep"/>').encode(), 'has a node <Wait> (Sleep), which'),
    ],
)
def test_other_files_and_nodes_are_refused_by_name(data, reason):
    with pytest.raises(ValueError, match=r'^a\.urp ') as refusal:
        read_urp(data, 'a.urp')
    assert reason in str(refusal.value)


def test_the_header_stands_where_the_software_puts_it():
    tree = ProgramTree((ScriptText('a'), ExternalControlNode(), ExternalControlNode()), loops=True)
    fetched = FetchedScript(header='h', control_loop='c')
    loop = 'def my_seam_2():\n{}while (True):\na\n{}\nc\n{}\nc\nend\nend\n'
    assert tree.script('my seam-2.urp', fetched) == loop.format('', 'h', '')
    first = replace(fetched, header_first=True)
    assert tree.script('my seam-2.urp', first) == loop.format('h\n', '', '')


@pytest.mark.parametrize(
    ('name', 'function'), [('1', '_1'), ('', 'program'), ('end', '_end'), ('weld it', 'weld_it')]
)
def test_every_name_makes_a_function_in_trees_and_uploaded_programs(name, function):
    assert ProgramTree(()).script(f'{name}.urp', FetchedScript()).startswith(f'def {function}():')
    assert parse(f'def {function_name(name)}():\nend\n').name == function
    programs = StoredPrograms({})
    programs.put(name, {'program': {'urscript': {'script': 'sync()'}}})
    script = programs.program(f'{name}.urpx')
    assert isinstance(script, str)
    assert script.startswith(f'def {function}():')
