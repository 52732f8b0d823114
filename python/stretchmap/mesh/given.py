"""Meshes at the edge: the kind that is needed, or an error that says how to get it."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ..errors import KindError
from .foreign import converted
from .meshes import TetMesh, TriMesh

__all__ = ["as_mesh", "as_solid", "as_surface", "require_same_mesh"]


def as_surface(mesh: Any, name: str = "surface") -> TriMesh:
    """The argument as a surface.

    Parameters
    ----------
    mesh : TriMesh, mesh of PyVista, trimesh or meshio, or tuple (V, F)
    name : str
        What the caller names it, for messages.

    Raises
    ------
    KindError
        It is something else; says how to get a surface from it.
    """
    mesh = converted(mesh)
    if isinstance(mesh, TriMesh):
        return mesh
    if isinstance(mesh, TetMesh):
        raise KindError(
            f"{name}: a TetMesh was given where a TriMesh is needed; its boundary is .surface"
        )
    raise KindError(f"{name}: {_remedy(mesh, 'TriMesh', 'TriMesh(V, F)')}")


def as_solid(mesh: Any, name: str = "solid") -> TetMesh:
    """The argument as a solid; as `as_surface`."""
    mesh = converted(mesh)
    if isinstance(mesh, TetMesh):
        return mesh
    if isinstance(mesh, TriMesh):
        raise KindError(
            f"{name}: a TriMesh was given where a TetMesh is needed; fill it with tets, "
            "stretchmap.tetrahedralize(surface)"
        )
    raise KindError(f"{name}: {_remedy(mesh, 'TetMesh', 'TetMesh(V, T)')}")


def as_mesh(mesh: Any, name: str = "mesh") -> TriMesh | TetMesh:
    """The argument as a surface or a solid; as `as_surface`."""
    mesh = converted(mesh)
    if isinstance(mesh, (TriMesh, TetMesh)):
        return mesh
    raise KindError(
        f"{name}: {_remedy(mesh, 'TriMesh or a TetMesh', 'TriMesh(V, F), TetMesh(V, T)')}"
    )


def require_same_mesh(
    first: TriMesh | TetMesh, second: TriMesh | TetMesh, what: str, remedy: str
) -> None:
    """Raise unless two meshes have the same vertices and elements, in the same order.

    Parameters
    ----------
    first, second : TriMesh or TetMesh
    what : str
        The fault in words, such as "the basis is of another mesh"; how they differ is added.
    remedy : str

    Raises
    ------
    KindError
        They differ.
    """
    if first is second:
        return
    if type(first) is not type(second):
        raise KindError(
            f"{what}: a {type(second).__name__} against a {type(first).__name__}; {remedy}"
        )
    key = "T" if isinstance(first, TetMesh) else "F"
    for name in ("V", key):
        ours, theirs = getattr(first, name), getattr(second, name)
        if not np.array_equal(ours, theirs):
            how = f"{len(theirs)} rows of {name} against {len(ours)}"
            if ours.shape == theirs.shape:
                how = f"{int((ours != theirs).any(axis=1).sum())} rows of {name} differ"
            raise KindError(f"{what}: {how}; {remedy}")


def _remedy(mesh: Any, wanted: str, made_by: str) -> str:
    given = f"a {type(mesh).__name__} was given where a {wanted} is needed"
    if isinstance(mesh, type):
        return f"a class was given where a {wanted} is needed"
    if isinstance(mesh, (str, os.PathLike)):
        return f"a path was given where a {wanted} is needed; read it, stretchmap.read(path)"
    for attribute in ("mesh", "solid", "surface"):
        if isinstance(getattr(mesh, attribute, None), (TriMesh, TetMesh)):
            return f"{given}; its mesh is .{attribute}"
    return f"{given}; make one, {made_by}"
