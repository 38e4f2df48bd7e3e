# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The recorded scenes of a page, as messages of viser."""

from __future__ import annotations

from base64 import b64decode
import json
import re
from typing import Any

import numpy as np


def scenes_of(page: str) -> dict[str, list[tuple[float, dict[str, Any]]]]:
    """Return the scenes of a page by name: (time, message) each; arrays are numpy's."""
    import msgspec
    import zstandard

    found = re.search(r'SCENES\.type\)\((\{.*?\})\)', page)
    assert found is not None
    scenes = {}
    for name, data in json.loads(found[1]).items():
        inner = zstandard.ZstdDecompressor().decompress(b64decode(data)[8:])
        at = 8 + int.from_bytes(inner[:8], 'little')
        content = msgspec.msgpack.decode(inner[8:at])
        buffers = []
        for length in content['binaryBufferLengths']:
            at = -(-at // 8) * 8  # each array begins at a multiple of 8
            buffers.append(inner[at : at + length])
            at += length
        for _, message in content['messages']:
            props = message.get('props', {})
            for key, value in props.items():
                if isinstance(value, dict) and '__binary_index' in value:
                    buffer = buffers[value['__binary_index']]
                    props[key] = np.frombuffer(buffer, dtype=value['dtype'])
        scenes[name] = content['messages']
    return scenes
