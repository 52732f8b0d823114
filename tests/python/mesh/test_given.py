"""The kind of mesh that is needed, or the way to it."""

from __future__ import annotations

import pytest

from shapes import a_map, torus
from stretchmap import TetMesh, TriMesh, samples
from stretchmap.errors import ArrayError, KindError
from stretchmap.mesh.given import as_mesh, as_solid, as_surface, require_same_mesh

SOLID = samples.solid_torus(400)
SURFACE = TriMesh(*torus())


def test_meshes_pass():
    assert as_surface(SURFACE) is SURFACE and as_mesh(SURFACE) is SURFACE
    assert as_solid(SOLID) is SOLID and as_mesh(SOLID) is SOLID


@pytest.mark.parametrize(
    ("convert", "given", "words"),
    [
        (as_surface, SOLID, r"a TetMesh was given where a TriMesh is needed.*\.surface"),
        (
            as_solid,
            SURFACE,
            r"a TriMesh was given where a TetMesh is needed.*stretchmap.tetrahedralize",
        ),
        (as_solid, "mesh.npz", r"a path.*stretchmap\.read\(path\)"),
        (as_surface, a_map(SOLID, SOLID.V), r"a LoadedMap was given.*\.mesh"),
        (as_mesh, a_map(SOLID, SOLID.V), r"a LoadedMap was given.*\.mesh"),
        (as_mesh, None, r"a NoneType was given.*TriMesh\(V, F\)"),
        (as_mesh, TetMesh, "a class was given"),
        (as_solid, SOLID.V, r"a ndarray was given.*TetMesh\(V, T\)"),
    ],
)
def test_what_is_none_is_refused_with_a_remedy(convert, given, words):
    with pytest.raises(KindError, match=words) as caught:
        convert(given, "the argument")
    assert str(caught.value).startswith("the argument: ")
    assert isinstance(caught.value, TypeError) and isinstance(caught.value, ArrayError)


def test_the_same_mesh():
    again = TetMesh(SOLID.V, SOLID.T)
    require_same_mesh(SOLID, again, "the basis is of another mesh", "leave it out")
    moved = SOLID.V.copy()
    moved[[3, 5]] += 1.0
    for other, words in (
        (TetMesh(moved, SOLID.T), "the basis is of another mesh: 2 rows of V differ; leave it out"),
        (TetMesh(SOLID.V, SOLID.T[1:]), "rows of T against"),
        (SOLID.surface, "the basis is of another mesh: a TriMesh against a TetMesh"),
    ):
        with pytest.raises(KindError, match=words):
            require_same_mesh(SOLID, other, "the basis is of another mesh", "leave it out")
