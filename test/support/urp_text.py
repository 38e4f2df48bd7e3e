# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Program files of PolyScope 5 (XML) and X (JSON), with the names that public files have."""

from typing import Any
from xml.sax.saxutils import escape, quoteattr

EXTERNAL_CONTROL = (
    '<Contributed strategyClass="com.fzi.externalcontrol.ExternalControlNode" '
    'strategyProgramNodeType="External Control" '
    'strategyURCapDeveloper="FZI Research Center for Information Technology" '
    'strategyURCapName="External Control"><dataModel/></Contributed>'
)


def script_line(text: str) -> str:
    """Return a node that is one line of URScript."""
    characters = ''.join(f'<ExpressionChar character={quoteattr(c)}/>' for c in text)
    return f'<Script type="Line"><expression>{characters}</expression></Script>'


def script_file(text: str) -> str:
    """Return a node that is a file of URScript, which the program contains."""
    return (
        f'<Script type="File"><cachedContents>{escape(text)}</cachedContents>'
        '<file resolves-to="file">/programs/a.script</file></Script>'
    )


def urp_text(*nodes: str, once: bool = True) -> str:
    """Return the program of some nodes."""
    return (
        '<URProgram name="a" installation="default" directory="/programs">'
        '<kinematics status="NOT_INITIALIZED" validChecksum="false"/>'
        f'<children><MainProgram runOnlyOnce="{str(once).lower()}" InitVariablesNode="false">'
        f'<children>{"".join(nodes)}</children></MainProgram></children></URProgram>'
    )


def urpx(name: str, script: str, **application: object) -> dict[str, Any]:
    """Return the content of a program of PolyScope X, reduced to the parts that a robot runs."""
    information = {'name': name, 'description': '', 'programState': 'FINAL'}
    return {
        'application': application,
        'program': {
            'id': '5',
            'programContent': {'children': []},
            'programInformation': information,
            'urscript': {'script': script, 'nodeIDList': []},
        },
    }
