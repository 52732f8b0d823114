"""A look at the nodes of Gmsh's ``.msh`` files of version 4.1 before meshio reads them.

meshio makes room for as many nodes as the header announces, whether they follow or not, and a table
as long as the largest tag.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError

__all__ = ["require_sound_nodes"]

_FORMAT = re.compile(rb"\$MeshFormat\s+4\.1\s+([01])\s+8\s")
_ROOM = 1 << 26  # bytes a table of tags may take however small the file is


def require_sound_nodes(path: Path) -> None:
    """Refuse a file whose nodes are not those announced, or whose tags are far too large.

    Raises
    ------
    FileFormatError
        It is such a file; those of other versions pass.
    Exception
        What NumPy raises where the file ends too early.
    """
    data = path.read_bytes()
    header, section = _FORMAT.search(data), re.search(rb"^\$Nodes[ \t]*\r?\n", data, re.MULTILINE)
    if header is None or section is None:
        return
    start = section.end()
    found = _binary_tags(data, start) if header[1] == b"1" else _text_tags(data, start)
    announced, tags = found
    if len(tags) != announced:
        raise FileFormatError(f"{announced} nodes are announced, {len(tags)} follow")
    if len(tags) and (tags.min() < 1 or 8 * int(tags.max()) > 16 * len(data) + _ROOM):
        raise FileFormatError(
            f"tags of {len(tags)} nodes run from {tags.min()} to {tags.max()}; renumber them"
        )


def _binary_tags(data: bytes, at: int) -> tuple[int, NDArray[Any]]:
    n_blocks, announced = np.frombuffer(data, np.uint64, 2, at).tolist()
    at += 32
    tags = []
    for _ in range(n_blocks):  # ends where the file does
        count = int(np.frombuffer(data, np.uint64, 1, at + 12)[0])
        if 32 * count > len(data):
            raise FileFormatError(f"a block of {count} nodes does not fit into the file")
        tags.append(np.frombuffer(data, np.uint64, count, at + 20))
        at += 20 + 32 * count
    return announced, np.concatenate(tags) if tags else np.empty(0, np.uint64)


def _text_tags(data: bytes, at: int) -> tuple[int, NDArray[Any]]:
    words = data[at : data.find(b"$EndNodes", at)].split()
    n_blocks, announced = int(words[0]), int(words[1])
    at, tags = 4, []
    for _ in range(n_blocks):
        count = int(words[at + 3])
        tags.append(np.array(words[at + 4 : at + 4 + count], dtype=np.bytes_).astype(np.int64))
        at += 4 + 4 * count
    return announced, np.concatenate(tags) if tags else np.empty(0, np.int64)
