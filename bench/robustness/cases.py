"""What is run: drawn solids by family and seed, and meshes from files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from families import families

_SUFFIXES = (".npz", ".ply", ".obj", ".off", ".stl", ".vtu", ".mesh", ".msh")


@dataclass(frozen=True)
class Case:
    """One mesh to be mapped.

    Attributes
    ----------
    group : str
        Family, or name of the folder the file lies in.
    name : str
        Seed, or stem of the file.
    path : Path
        The mesh; a drawn one is put there before it is mapped.
    seed : int or None
        None for a file that is there.
    size : float
        Factor of the number of tets of a drawn one.
    """

    group: str
    name: str
    path: Path
    seed: int | None = None
    size: float = 1.0


def seeds_of(text: str) -> list[int]:
    """``tune`` (even ones of 0 .. 39), ``report`` (odd ones), ``all``, ``a:b`` or ``a,b,c``.

    Raises
    ------
    ValueError
        If the text is none of these.
    """
    named = {"tune": range(0, 40, 2), "report": range(1, 40, 2), "all": range(40)}
    if text in named:
        return list(named[text])
    if found := re.fullmatch(r"(\d+):(\d+)", text):
        return list(range(int(found[1]), int(found[2])))
    return [int(word) for word in text.split(",")]


def drawn(names: Iterable[str], seeds: Iterable[int], size: float, out: Path) -> list[Case]:
    """Cases of the families, all families seed by seed, so that part of a run says something."""
    folder = out / "meshes"
    chosen = list(names) or list(families())
    return [
        Case(name, str(seed), folder / f"{name}_{seed}_{size:g}.npz", seed, size)
        for seed in seeds
        for name in chosen
    ]


def from_files(paths: Iterable[Path]) -> list[Case]:
    """Cases of mesh files, and of the folders' mesh files."""
    cases = []
    for path in paths:
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        cases += [
            Case(file.resolve().parent.name, file.stem, file.resolve())
            for file in files
            if file.suffix.lower() in _SUFFIXES
        ]
    return cases
