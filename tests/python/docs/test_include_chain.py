"""The folders of the C++ core form a chain: nothing includes what stands to its right."""

from __future__ import annotations

import re
from pathlib import Path

CPP = Path(__file__).resolve().parents[3] / "cpp"
CHAIN = (
    {"base"},
    {"mesh", "linalg"},
    {"forms", "measures"},
    {"homology", "maps"},
    {"certificate", "partitions"},
    {"area"},
    {"volume"},
    {"registration", "energies"},
    {"resample"},
)
LEVEL = {room: level for level, rooms in enumerate(CHAIN) for room in rooms}
INCLUDE = re.compile(
    r'^\s*#\s*include\s+(?:"(?:stretchmap/)?|<stretchmap/)([^">]+)[">]', re.MULTILINE
)


def sources(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix in (".hpp", ".cpp"))


def room_of(path: Path) -> str:
    root = CPP / "include/stretchmap" if path.is_relative_to(CPP / "include") else CPP / "src"
    return path.relative_to(root).parts[0]


def includes() -> list[tuple[Path, str]]:
    """Every file of the core with each project header it names, as `room/.../header`."""
    files = sources(CPP / "include") + sources(CPP / "src")
    return [(path, name) for path in files for name in INCLUDE.findall(path.read_text())]


def upward(pairs: list[tuple[Path, str]]) -> list[str]:
    """The includes that point to the right or sideways in the chain."""
    found = []
    for path, name in pairs:
        room, other = room_of(path), name.split("/")[0]
        if room != other and LEVEL[other] >= LEVEL[room]:
            found.append(f"{path.relative_to(CPP)} includes {name}")
    return found


def test_every_folder_has_its_place_in_the_chain():
    assert {room_of(path) for path, _ in includes()} == set(LEVEL)


def test_every_include_names_a_file_by_its_room():
    missing = [
        f"{path.relative_to(CPP)}: {name}"
        for path, name in includes()
        if not any((root / name).is_file() for root in (CPP / "include/stretchmap", CPP / "src"))
    ]
    assert not missing


def test_nothing_includes_to_its_right():
    assert not upward(includes())


def test_an_include_to_the_right_is_found():
    planted = CPP / "src/mesh/size.cpp", "volume/solid_energy.hpp"
    assert upward([*includes(), planted]) == ["src/mesh/size.cpp includes volume/solid_energy.hpp"]


def test_private_headers_stay_in_their_room():
    foreign = [
        f"{path.relative_to(CPP)}: {name}"
        for path, name in includes()
        if (CPP / "src" / name).is_file() and name.split("/")[0] != room_of(path)
    ]
    assert not foreign


def test_headers_do_not_include_in_a_circle():
    headers: dict[str, list[str]] = {}
    for path, name in includes():
        if path.suffix == ".hpp":
            root = CPP / "include/stretchmap" if "include" in path.parts else CPP / "src"
            headers.setdefault(path.relative_to(root).as_posix(), []).append(name)
    done: set[str] = set()

    def visit(name: str, above: tuple[str, ...]) -> None:
        assert name not in above, " -> ".join([*above, name])
        if name not in done:
            for other in headers.get(name, []):
                visit(other, (*above, name))
            done.add(name)

    for header in headers:
        visit(header, ())
