"""What the headers of files announce, understood without their readers."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from collections.abc import Callable

# Points and elements a file announces; None where its text does not say.
Counts = tuple[int | None, int | None]


def _after(points: bytes, elements: bytes) -> Callable[[bytes], Counts]:
    """The whole numbers that follow two patterns for the first time."""

    def announced(data: bytes) -> Counts:
        found = [re.search(pattern + rb"(\d+)\b(?![.])", data) for pattern in (points, elements)]
        first, second = (int(m[1]) if m and len(m[1]) < 20 else None for m in found)
        return first, second

    return announced


def ply_counts(data: bytes) -> Counts:
    head = data.partition(b"end_header")[0]
    return _after(rb"(?m)^element[ \t]+vertex[ \t]+", rb"(?m)^element[ \t]+face[ \t]+")(head)


def off_counts(data: bytes) -> Counts:
    found = re.match(rb"\s*OFF\s+(\d+)\s+(\d+)\b", re.sub(rb"#.*", b"", data))
    return (int(found[1]), int(found[2])) if found else (None, None)


def _lines(data: bytes) -> bytes:
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def stl_counts(data: bytes) -> Counts:
    text = _lines(data).lstrip().lower()
    if text[:5] == b"solid":
        return None, len(re.findall(rb"(?m)^[ \t]*facet\b", text))
    return None, struct.unpack("<I", data[80:84])[0] if len(data) >= 84 else None


def obj_counts(data: bytes) -> Counts:
    data = _lines(data).replace(b"\\\n", b" ")
    found = [len(re.findall(rb"(?m)^[ \t]*" + key + rb"[ \t]", data)) for key in (b"v", b"f")]
    return found[0], found[1]


def npz_counts(data: bytes) -> Counts:
    """Rows by the length of the arrays, where their header is that of the sound file."""
    sizes = []
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = ("V.npy", "F.npy", "T.npy")
        members = {name: archive.read(name) for name in archive.namelist() if name in names}
    for name, kind, bytes_per_row in (("V", b"<f8", 24), ("F", b"<i4", 12), ("T", b"<i4", 16)):
        member = members.get(f"{name}.npy", b"")
        if kind in member[:40] and len(member) > 10:
            length = len(member) - 10 - int.from_bytes(member[8:10], "little")
            sizes.append(length // bytes_per_row)
    return (sizes[0], sizes[1]) if len(sizes) == 2 else (None, None)


vtk_counts = _after(rb"(?m)^POINTS +", rb"(?m)^CELL_TYPES +")
vtu_counts = _after(rb"NumberOfPoints=\"", rb"NumberOfCells=\"")
mesh_counts = _after(rb"(?m)^Vertices\s+", rb"(?m)^Tetrahedra\s+")
msh_counts = _after(rb"(?m)^\$Nodes\n", rb"(?m)^\$Elements\n")
