"""Maps at the edge: the kind that is needed, or an error that says how to get it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..base.torus import Torus
from ..errors import CertificationError, KindError, OptionError
from ..mesh.meshes import TetMesh
from .result import MapResult

__all__ = ["as_map", "as_map_of_solid", "require_unfolded", "target_of", "torus_of"]


def as_map(result: Any, name: str = "result") -> MapResult:
    """The argument as a map of a surface or a solid.

    Raises
    ------
    KindError
        It is no map.
    """
    if isinstance(result, MapResult):
        return result
    raise KindError(
        f"{name}: a {type(result).__name__} was given where a map is needed, such as volume_map, "
        "area_map, conformal_map and register return, or load_map reads"
    )


def as_map_of_solid(result: Any, task: str) -> tuple[MapResult, TetMesh]:
    """The argument as a map of a solid, and the solid.

    Raises
    ------
    KindError
        It is no map, or the map of a surface.
    """
    mapped = as_map(result)
    if isinstance(mapped.mesh, TetMesh):
        return mapped, mapped.mesh
    raise KindError(f"{task} needs the map of a solid, this is that of a surface; see volume_map")


def torus_of(result: MapResult) -> Torus:
    """The torus a map goes to.

    Raises
    ------
    OptionError
        It goes to another solid, or its file names no torus.
    """
    if result.torus is None:
        raise OptionError("the map has no torus, so there are no coordinates on it")
    return result.torus


def require_unfolded(result: MapResult, solid: TetMesh, task: str) -> None:
    """Refuse a map that turns tets inside out, as one that is kept uncertified may.

    Raises
    ------
    CertificationError
        Tets of the image have no positive volume; ``ids`` are these.
    """
    image = np.ascontiguousarray(result.image)
    folded = np.asarray(_core.certificate.not_positive_tets(image, solid.T))
    if len(folded):
        raise CertificationError(
            f"{len(folded)} tets of the image have no positive volume; {task} needs a certified "
            "map",
            folded,
        )


def target_of(result: MapResult, task: str) -> TetMesh:
    """The solid a registration goes to.

    Raises
    ------
    OptionError
        The map goes to a torus, or its file names no target.
    """
    if result.target is None:
        raise OptionError(f"{task} needs a registration; this map has no target solid")
    return result.target
