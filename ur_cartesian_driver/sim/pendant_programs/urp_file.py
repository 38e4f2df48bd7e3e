# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reads program files of PolyScope 3 and 5 (.urp): XML, compressed by gzip or not.

The format is not published; this reader knows the elements of public files and tools::

    <URProgram name="seam"><children>
      <MainProgram runOnlyOnce="false"><children>
        <Script type="Line"><expression><ExpressionChar character="h"/>...</expression></Script>
        <Script type="File"><cachedContents>...</cachedContents></Script>
        <Contributed strategyURCapName="External Control" ...><dataModel/></Contributed>
      </children></MainProgram>
    </children></URProgram>
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
import zlib

from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    ExternalControlNode,
    ProgramTree,
    ScriptText,
    TreeNode,
)

#: The name of the URCap in the node's attribute.
EXTERNAL_CONTROL = 'External Control'
_GZIP_MAGIC = b'\x1f\x8b'
#: Largest program after decompression [bytes].
_MAX_SIZE = 10_000_000


def read_urp(data: bytes, name: str) -> ProgramTree:
    """
    Return the tree of a program file.

    :param name: the name of the file, for errors.
    :raises ValueError: the data are no program file, or have a node that the simulator does not
        run.
    """
    try:
        xml = _decompressed(data) if data.startswith(_GZIP_MAGIC) else data
        if b'<!DOCTYPE' in xml:  # declares entities, which can grow without bound
            raise ValueError('it has a DOCTYPE')
        root = ElementTree.fromstring(xml)
    except (zlib.error, ElementTree.ParseError, LookupError, ValueError) as error:
        raise ValueError(f'{name} is no program file of PolyScope 3 or 5: {error}.') from None
    main = root.find('children/MainProgram')
    if root.tag != 'URProgram' or main is None:
        raise ValueError(
            f'{name} is no program file of PolyScope 3 or 5: it has no <URProgram> with a '
            '<MainProgram>.'
        )
    for other in root.findall('children/*'):
        if other is not main:
            raise _unknown_node(other, name)
    return ProgramTree(tuple(_nodes(main, name)), loops=main.get('runOnlyOnce') != 'true')


def _decompressed(data: bytes) -> bytes:
    unzip = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    xml = unzip.decompress(data, _MAX_SIZE)
    if unzip.unconsumed_tail:
        raise ValueError(f'it is larger than {_MAX_SIZE} bytes')
    return xml


def _nodes(parent: Element, name: str) -> Iterator[TreeNode]:
    """Yield the nodes below a node; the nodes of a folder, not the folder; no comments."""
    for node in parent.findall('children/*'):
        if node.tag == 'Contributed' and node.get('strategyURCapName') == EXTERNAL_CONTROL:
            yield ExternalControlNode()
        elif node.tag == 'Folder':
            yield from _nodes(node, name)
        elif node.tag == 'Comment':
            continue
        else:
            read = _READERS.get((node.tag, node.get('type', '')))
            text = None if read is None else read(node)
            if text is None:
                raise _unknown_node(node, name)
            yield ScriptText(text)


def _line(node: Element) -> str:
    """Return the text of a script line, which has an element for each of its characters."""
    return ''.join(
        part.get('character') or part.get('token') or '' for part in node.iterfind('expression/*')
    )


def _file(node: Element) -> str | None:
    return node.findtext('cachedContents')


def _sleep(node: Element) -> str | None:
    try:
        return f'sleep({float(node.findtext("waitTime", ""))})'
    except ValueError:
        return None


def _popup(node: Element) -> str:
    text = node.get('message', '').replace('"', "'")
    window = f'popup("{text}", "Message", False, False, blocking=True)'
    return f'{window}\nhalt' if node.get('haltProgram') == 'true' else window


#: Tag and type of a node -> function that returns the node's URScript; None = the node has none.
_READERS: Mapping[tuple[str, str], Callable[[Element], str | None]] = {
    ('Script', 'Line'): _line,
    ('Script', 'File'): _file,
    ('Wait', 'Sleep'): _sleep,
    ('Popup', 'Message'): _popup,
}


def _unknown_node(node: Element, name: str) -> ValueError:
    kind = node.get('strategyURCapName') or node.get('type')
    what = f'<{node.tag}> ({kind})' if kind else f'<{node.tag}>'
    return ValueError(
        f'{name} has a node {what}, which the simulator does not run; it runs script lines and '
        'files, waits, popups, comments, folders and External Control: write the node as a script.'
    )
