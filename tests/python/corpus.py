"""Odd but legal surface files, each a cube, with the corners of its faces in order.

`cases` lists them; ``python tests/python/corpus.py`` reads all of them with our readers, meshio and
trimesh and prints how many each of them understands.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import corpus_ply
from corpus_cube import MIXED, POINTS, QUADS, TRIANGLES


@dataclass(frozen=True)
class Case:
    """A file; ``split`` polygons are in it."""

    name: str
    suffix: str
    data: bytes
    split: int = 0


def cases() -> list[Case]:
    """All files."""
    found = []
    for suffix, files in (
        (".obj", _obj),
        (".off", _off),
        (".ply", corpus_ply.files),
        (".stl", _stl),
    ):
        for name, content, split in files():
            data = content if isinstance(content, bytes) else content.encode()
            found.append(Case(name, suffix, data, split))
    return found


Files = Iterator[tuple[str, str | bytes, int]]


def _v(extra: str = "", number: Callable[[float], str] = repr) -> str:
    return "".join(f"v {' '.join(map(number, p))}{extra}\n" for p in POINTS.tolist())


def _f(faces: list[list[int]], corner: str = "{}", shift: int = 1, end: str = "\n") -> str:
    return "".join(
        "f " + " ".join(corner.replace("{}", str(i + shift)) for i in face) + end for face in faces
    )


def _obj() -> Files:
    plain = _v() + _f(TRIANGLES)
    vt, vn = "vt 0 0\nvt 1 0\n", "vn 0 0 1\n"
    yield "plain", plain, 0
    yield "comments and blank lines", "# c\n\n" + plain.replace("\nf", "\n# c\n\nf") + "# end", 0
    yield "CRLF", plain.replace("\n", "\r\n"), 0
    yield "CR alone", plain.replace("\n", "\r"), 0
    yield "no last newline", plain.rstrip(), 0
    yield "byte order mark", b"\xef\xbb\xbf" + ("# c\n" + plain).encode(), 0
    yield "byte order mark before v", b"\xef\xbb\xbf" + plain.encode(), 0
    yield "names beyond ASCII", b"o W\xfcrfel\n" + plain.encode() + b"# \xff\n", 0
    yield "negative indices", _v() + _f(TRIANGLES, shift=-8), 0
    half = "".join(_v().splitlines(True)[:4]), "".join(_v().splitlines(True)[4:])
    low = [f for f in TRIANGLES if max(f) < 4]
    high = [f for f in TRIANGLES if max(f) >= 4]
    yield (
        "negative indices between vertices",
        half[0] + _f(low, shift=-4) + half[1] + _f(high, shift=-8),
        0,
    )
    yield "vertices between faces", half[0] + _f(low) + half[1] + _f(high), 0
    yield "quads", _v() + _f(QUADS), 6
    yield "quads and triangles", _v() + _f(MIXED), 3
    yield "texture and normals", _v() + vt + vn + _f(TRIANGLES, "{}/1/1"), 0
    yield "normals alone", _v() + vn + _f(TRIANGLES, "{}//1"), 0
    yield "texture of three numbers", _v() + "vt 0 0 0\n" + _f(TRIANGLES, "{}/1"), 0
    yield "texture that points nowhere", _v() + vt + _f(TRIANGLES, "{}/7"), 0
    yield "texture of some faces", _v() + vt + _f(TRIANGLES[:3], "{}/1") + _f(TRIANGLES[3:]), 0
    yield "colors of vertices", _v(" 0.5 0.5 1") + _f(TRIANGLES), 0
    yield "weights of vertices", _v(" 1.0") + _f(TRIANGLES), 0
    yield "objects, groups, materials", "mtllib none.mtl\no a\ng b c\nusemtl d\ns off\n" + plain, 0
    yield "group between faces", _v() + _f(TRIANGLES[:5]) + "o b\ns 1\n" + _f(TRIANGLES[5:]), 0
    yield "lines and points", _v() + "l 1 2 3\np 1\n" + _f(TRIANGLES), 0
    yield "continued lines", plain.replace("f 1 3 4", "f 1 \\\n 3 4"), 0
    yield "blanks at both ends", plain.replace("f ", "  f\t").replace("\n", " \t\n"), 0
    yield "comment after a face", _v() + _f(TRIANGLES, end=" # c\n"), 0
    yield "signs and exponents", _v(number="{:+.3E}".format) + _f(TRIANGLES), 0
    yield "free-form lines", "vp 0 0\n" + _v() + "cstype bspline\ndeg 3\n" + _f(TRIANGLES), 0


def _off() -> Files:
    rows = "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in POINTS.tolist())

    def faces(of: list[list[int]], end: str = "\n") -> str:
        return "".join(f"{len(f)} {' '.join(map(str, f))}{end}" for f in of)

    plain = "OFF\n8 12 0\n" + rows + faces(TRIANGLES)
    yield "plain", plain, 0
    yield "comments and blank lines first", "\n# c\n\n" + plain.replace("8 12", "\n# c\n8 12"), 0
    yield "counts beside the word", plain.replace("OFF\n", "OFF "), 0
    yield "no number of edges", plain.replace("8 12 0", "8 12"), 0
    yield "CRLF", plain.replace("\n", "\r\n"), 0
    yield "comments behind rows", plain.replace("\n3", " # c\n3"), 0
    yield "byte order mark", b"\xef\xbb\xbf" + plain.encode(), 0
    yield "colors of faces", "OFF\n8 12 18\n" + rows + faces(TRIANGLES, " 255 0 0\n"), 0
    yield "real colors of faces", "OFF\n8 12 18\n" + rows + faces(TRIANGLES, "  0.5 0.5 1 1\n"), 0
    yield (
        "colors of vertices",
        plain.replace("OFF", "COFF").replace(rows, rows.replace("\n", " 9 9 9 255\n")),
        0,
    )
    yield "normals", plain.replace("OFF", "NOFF").replace(rows, rows.replace("\n", " 0 0 1\n")), 0
    yield "quads", "OFF\n8 6 0\n" + rows + faces(QUADS), 6
    yield "quads and triangles", f"OFF\n8 {len(MIXED)} 0\n" + rows + faces(MIXED), 3
    yield "all in one line", plain.replace("\n", " "), 0
    yield "blanks at both ends", plain.replace("\n", " \t\n  "), 0
    yield "rows after the last face", plain + "\n\n# end\n", 0


def _stl() -> Files:
    corners = POINTS[TRIANGLES]
    text = (
        "solid cube\n"
        + "".join(
            "facet normal 0 0 0\n  outer loop\n"
            + "".join(f"    vertex {x:.6e} {y:.6e} {z:.6e}\n" for x, y, z in facet)
            + "  endloop\nendfacet\n"
            for facet in corners.tolist()
        )
        + "endsolid cube\n"
    )
    yield "text", text, 0
    yield "text, upper case", text.upper(), 0
    yield "text, CRLF and tabs", text.replace("  ", "\t").replace("\n", "\r\n"), 0
    yield "text, CR alone", text.replace("\n", "\r"), 0
    yield "text, no name", text.replace(" cube", ""), 0
    yield "text, blank lines first", "\n\n  " + text, 0
    yield "text, normals that are nan", text.replace("normal 0 0 0", "normal nan nan nan"), 0
    yield "text, a name beyond ASCII", text.encode().replace(b"cube", b"w\xfcrfel"), 0
    yield "text, byte order mark", b"\xef\xbb\xbf" + text.encode(), 0
    place = text.find("endfacet\n", len(text) // 2) + 9
    yield "text, two solids", text[:place] + "endsolid cube\nsolid b\n" + text[place:], 0
    yield "text, no last newline", text.rstrip(), 0
    for name, header, attribute, behind in (
        ("binary", b"", 0, b""),
        ("binary, header begins with solid", b"solid cube facet", 0, b""),
        ("binary, colors as attributes", b"COLOR=\1\2\3\4", 31, b""),
        ("binary, bytes behind", b"", 0, b"\0" * 7),
        ("binary, header of letters beyond ASCII", b"\xff" * 80, 0, b""),
    ):
        facets = np.zeros(12, [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
        facets["c"], facets["a"] = corners, attribute
        yield name, header.ljust(80) + np.uint32(12).tobytes() + facets.tobytes() + behind, 0
    signed = np.where(corners == 0.0, -0.0, corners)
    signed[::2] = corners[::2]
    facets["c"] = signed
    yield (
        "binary, zeros of both signs",
        b"".ljust(80) + np.uint32(12).tobytes() + facets.tobytes(),
        0,
    )


def is_cube(V: Any, F: Any) -> bool:
    """Whether triangles are those of the cube: eight corners once, volume, area, outward."""
    V, F = np.asarray(V, float), np.asarray(F)
    if V.ndim != 2 or F.ndim != 2 or F.shape[1] != 3 or len(F) != 12:
        return False
    used = V[np.unique(F)]
    if len(used) != 8 or len(np.unique(used + 0.0, axis=0)) != 8:
        return False
    a, b, c = np.moveaxis(V[F], 1, 0)
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    return np.allclose(areas, 0.5) and bool(np.isclose(volume, 1.0))


def _ours(path: Path) -> tuple[Any, Any]:
    from stretchmap.io import read

    mesh: Any = read(path)
    return mesh.V, mesh.F


def _by_meshio(path: Path) -> tuple[Any, Any]:
    import meshio

    name = path.suffix[1:]
    mesh = meshio._helpers.reader_map[name](str(path))
    triangles = [np.asarray(block.data) for block in mesh.cells if block.type == "triangle"]
    for block in mesh.cells:  # with the most lenient caller there can be
        if block.type == "quad":
            quads = np.asarray(block.data)
            triangles += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    V, F = mesh.points, np.concatenate(triangles)
    if path.suffix == ".stl":
        V, ids = np.unique(V + 0.0, axis=0, return_inverse=True)
        F = ids.reshape(-1)[F]
    return V, F


def _by_trimesh(path: Path) -> tuple[Any, Any]:
    import trimesh

    mesh = trimesh.load(path, process=False, force="mesh")
    if path.suffix == ".stl":
        mesh.merge_vertices()
    return mesh.vertices, mesh.faces


def main() -> None:
    readers = {"stretchmap": _ours, "meshio": _by_meshio, "trimesh": _by_trimesh}
    print(f"| format | files | {' | '.join(readers)} |\n|---|---|{'---|' * len(readers)}")
    missed: dict[str, list[str]] = {name: [] for name in readers}
    with tempfile.TemporaryDirectory() as folder:
        for suffix in (".obj", ".off", ".ply", ".stl"):
            files = [case for case in cases() if case.suffix == suffix]
            right = dict.fromkeys(readers, 0)
            for case in files:
                path = Path(folder, f"cube{suffix}")
                path.write_bytes(case.data)
                for name, reader in readers.items():
                    try:
                        sound = is_cube(*reader(path))
                    except (Exception, SystemExit):
                        sound = False
                    right[name] += sound
                    if not sound:
                        missed[name].append(f"{suffix} {case.name}")
            print(f"| {suffix} | {len(files)} | {' | '.join(map(str, right.values()))} |")
    for name, files in missed.items():
        print(f"\n{name} misses: {'; '.join(files) or 'none'}")


if __name__ == "__main__":
    sys.exit(main())
