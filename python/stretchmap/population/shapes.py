"""The shapes of a population as they are given: solids, files or a folder; and their landmarks."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import as_reals
from ..base.files import open_to_read
from ..base.options import as_path
from ..errors import ArrayError, FileFormatError, LandmarkError, OptionError
from ..io.formats import suffixes
from ..io.numbers import read_numbers
from ..io.reading import read_solid
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh

__all__ = ["Shape", "gather_landmarks", "gather_shapes", "require_landmarks"]

_log = logging.getLogger("stretchmap")

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Shape:
    """One shape, read when it is needed.

    Attributes
    ----------
    name : str
    source : Path or TetMesh
    landmarks : Path, ndarray (l, 3) or None
        A file that is missing is a fault of the shape.
    """

    name: str
    source: Path | TetMesh = field(repr=False)
    landmarks: Path | Array | None = field(default=None, repr=False)

    def load(self) -> TetMesh:
        """The solid.

        Raises
        ------
        StretchmapError, OSError
            It cannot be read, or is no solid torus.
        """
        solid = self.source if isinstance(self.source, TetMesh) else read_solid(self.source)
        solid.require_solid_torus()
        return solid

    def load_landmarks(self) -> Array | None:
        """Its landmarks (l, 3).

        Raises
        ------
        LandmarkError, StretchmapError, OSError
            They cannot be read.
        """
        if isinstance(self.landmarks, Path):
            if not self.landmarks.exists():
                raise LandmarkError(f"{self.name} has no landmarks: {self.landmarks} is not there")
            return read_numbers(self.landmarks, {3: "x, y, z"})
        return self.landmarks

    def is_there(self) -> bool:
        """Whether the files it is read from are."""
        files = (part for part in (self.source, self.landmarks) if isinstance(part, Path))
        return all(os.path.isfile(file) for file in files)

    def digest(self) -> str:
        """Changes when what the shape is made of does."""
        found = hashlib.sha256(self.name.encode())
        for part in (self.source, self.landmarks):
            if isinstance(part, Path):
                try:
                    with open_to_read(part) as file:
                        while chunk := file.read(1 << 20):
                            found.update(chunk)
                except (OSError, FileFormatError) as error:  # told when it is to be read
                    found.update(str(error).encode())
            elif part is not None:
                arrays = (part.V, part.T) if isinstance(part, TetMesh) else (part,)
                for array in arrays:
                    found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()


def gather_shapes(solids: Any) -> list[Shape]:
    """Shapes from a folder, or a sequence or mapping of solids and paths.

    Raises
    ------
    OptionError
        It is none of these, the folder holds no mesh, or two shapes have one name.
    KindError
        An object is no solid.
    FileNotFoundError
        No such folder.
    """
    if isinstance(solids, (str, os.PathLike)):
        folder = as_path(solids)
        if not folder.is_dir():
            raise FileNotFoundError(2, "no such folder", str(folder))
        known = suffixes(solid=True)
        found = sorted(p for p in folder.iterdir() if p.suffix.lower() in known and p.is_file())
        surfaces = _surfaces(folder, known)
        if not found:
            advice = f"; {surfaces} as surfaces: fill them first (`prepare`)" if surfaces else ""
            raise OptionError(f"{folder} holds no mesh of tets ({', '.join(known)}){advice}")
        if surfaces:
            _log.warning("%s left out: surfaces have to be filled first (`prepare`)", surfaces)
        return gather_shapes([path for path in found if not path.name.startswith(".")])
    if isinstance(solids, Mapping):
        return _checked([_shape(entry, str(name)) for name, entry in solids.items()])
    if not isinstance(solids, Sequence):
        raise OptionError(
            "solids must be a folder, or a sequence or mapping of solids and paths, got "
            f"{type(solids).__name__}"
        )
    width = len(str(max(len(solids) - 1, 0)))
    names = [
        as_path(entry).stem if isinstance(entry, (str, os.PathLike)) else f"{i:0{width}d}"
        for i, entry in enumerate(solids)
    ]
    return _checked([_shape(entry, name) for entry, name in zip(solids, names, strict=True)])


def _surfaces(folder: Path, known: Sequence[str]) -> str:
    """Names of the files in a folder that can hold a surface only."""
    only = set(suffixes(solid=False)) - set(known)
    names = sorted(p.name for p in folder.iterdir() if p.suffix.lower() in only and p.is_file())
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def gather_landmarks(shapes: list[Shape], landmarks: Any) -> list[Shape]:
    """The shapes with their landmarks: a folder of NAME.csv, a mapping by name, or an array.

    Raises
    ------
    OptionError
        None of these.
    ArrayError, NonFiniteError
        The array has another shape; a mapping lacks one.
    """
    if landmarks is None:
        return shapes
    marks: list[Any]
    if isinstance(landmarks, (str, os.PathLike)):
        folder = as_path(landmarks).absolute()
        if not folder.is_dir():
            raise FileNotFoundError(2, "no such folder", str(folder))
        marks = [folder / f"{shape.name}.csv" for shape in shapes]
    elif isinstance(landmarks, Mapping):
        missing = [shape.name for shape in shapes if shape.name not in landmarks]
        if missing:
            raise ArrayError(f"landmarks: there are none of {', '.join(missing[:5])}")
        marks = [as_reals(landmarks[s.name], f"landmarks[{s.name!r}]", (None, 3)) for s in shapes]
    else:
        marks = list(as_reals(landmarks, "landmarks", (len(shapes), None, 3)))
    if all(not isinstance(mark, Path) and not len(mark) for mark in marks):
        return shapes
    return [Shape(s.name, s.source, mark) for s, mark in zip(shapes, marks, strict=True)]


def require_landmarks(shapes: Sequence[Shape]) -> None:
    """Refuse shapes of which fewer than two have the landmarks that are looked for in a folder.

    Raises
    ------
    LandmarkError
        Says how many have none, and where they would be.
    """
    files = [shape.landmarks for shape in shapes if isinstance(shape.landmarks, Path)]
    missing = [file for file in files if not file.is_file()]
    if missing and len(files) - len(missing) < 2:
        more = ", ..." if len(missing) > 5 else ""
        raise LandmarkError(
            f"{len(missing)} of {len(files)} shapes have no landmarks, two shapes with them are "
            f"needed; in {missing[0].parent} there is no "
            f"{', '.join(file.name for file in missing[:5])}{more}"
        )


def _shape(entry: Any, name: str) -> Shape:
    if isinstance(entry, (str, os.PathLike)):
        # A run may be asked for a shape after the working directory has become another.
        return Shape(name, as_path(entry).absolute())
    return Shape(name, as_solid(entry, f"solids[{name}]"))


def _checked(shapes: list[Shape]) -> list[Shape]:
    names = [shape.name for shape in shapes]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise OptionError(f"two shapes are named {twice[0]!r}; pass a mapping from names to paths")
    for name in names:
        if not name or name.startswith(".") or any(c in name for c in "/\\\0"):
            raise OptionError(f"{name!r} cannot be the name of a shape: files are named after it")
    return shapes
