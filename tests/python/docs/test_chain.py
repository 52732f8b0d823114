"""No room of the package imports one that comes after it, and no two modules import each other."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import stretchmap

PACKAGE = Path(stretchmap.__file__).parent
# Rooms of one row know nothing of each other.
CHAIN = (
    ("errors", "_core", "_version"),
    ("base",),
    ("mesh",),
    ("samples", "io", "forms", "measures", "deformation"),
    ("homology", "maps"),
    ("conformal", "certificate", "partitions", "preparation"),
    ("area",),
    ("volume",),
    ("registration", "energies"),
    ("resample",),
    ("population",),
    ("plot",),
    ("cli",),
    ("__main__",),
)
FLOOR = {room: floor for floor, rooms in enumerate(CHAIN) for room in rooms}


def imports(source: str, module: tuple[str, ...], is_package: bool) -> list[tuple[str, ...]]:
    """Modules of the package that a module of it imports, wherever in the file it does."""
    here = module if is_package else module[:-1]
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.level:
            start = here[: len(here) - node.level + 1]
            target = (*start, *(node.module.split(".") if node.module else ()))
            names = [(*target, alias.name) for alias in node.names]
            found += [name if exists(name) else target for name in names]
    return found


def exists(module: tuple[str, ...]) -> bool:
    path = PACKAGE.joinpath(*module)
    return path.with_suffix(".py").exists() or path.is_dir() or module == ("_core",)


def modules() -> dict[tuple[str, ...], list[tuple[str, ...]]]:
    graph = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        is_package = parts[-1] == "__init__"
        module = parts[:-1] if is_package else parts
        graph[module] = imports(path.read_text(encoding="utf-8"), module, is_package)
    return graph


def upward(graph: dict[tuple[str, ...], list[tuple[str, ...]]]) -> list[str]:
    """Imports of a room of the same floor or of a later one."""
    return [
        f"{'.'.join(module)} imports {'.'.join(target)}"
        for module, targets in graph.items()
        for target in targets
        if module and target and module[0] != target[0] and FLOOR[target[0]] >= FLOOR[module[0]]
    ]


def circle(graph: dict[tuple[str, ...], list[tuple[str, ...]]]) -> list[str]:
    try:
        TopologicalSorter(
            {m: [t for t in targets if t and t != m] for m, targets in graph.items() if m}
        ).prepare()
    except CycleError as error:
        return [".".join(module) for module in error.args[1]]
    return []


def test_every_room_has_its_floor():
    assert {module[0] for module in modules() if module} <= set(FLOOR)


def test_no_room_imports_a_later_one():
    assert upward(modules()) == []


def test_no_circle():
    assert circle(modules()) == []


@pytest.mark.parametrize("line", ["from ..volume.map import volume_map", "from ..area import map"])
def test_an_upward_import_is_seen(line):
    module = ("conformal", "map")
    assert len(upward({module: imports(line, module, is_package=False)})) == 1


def test_a_circle_is_seen():
    assert circle({("a", "b"): [("a", "c")], ("a", "c"): [("a", "b")]})
