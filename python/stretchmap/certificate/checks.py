"""Proof, or refusal, that a computed map is a bijection; independent of how it was computed.

A map is piecewise affine: it is given by the images of the vertices. Let M be the solid, S its
boundary and f the map.

*Theorem.* Let M be a connected complex of coherently oriented tets whose boundary S is one closed
surface. If every tet has positive image volume and f restricted to S is one to one, then f is a
bijection from M onto the solid that f(S) encloses.

*Proof.* Take y outside f(S) and off the images of all triangles. Every preimage of y counts +1, so
the number of preimages is the winding number of f(S) about y. As f(S) is an embedded closed
surface, that number is 0 outside and the same constant, 1 or -1, inside; some tet has positive
volume, so it is 1. Now let x be any point of M. Every tet at x is mapped one to one, so near x only
x goes to f(x), the local degree of f there is defined, and it is positive: the image of each
neighbourhood of an inner point x contains a neighbourhood of f(x). Suppose f(x) = f(x') with
x != x'. If both are inner points, points near f(x) have two preimages; if x is inner and x' in S,
f(x) is a limit of outside points, yet those near f(x) have a preimage; if both are in S, f is not
one to one there. Each is excluded.

*That f(S) does not cross itself* is proven in one of two ways. With a torus given, by showing that
it is a graph over the torus: every face looks outward along the whole face, and the (u, v) torus is
covered once; by the same counting argument, applied to x -> (u, v), this map is then one to one on
f(S), and f(S) embedded. Otherwise, or where that fails, by exact intersection tests of all pairs of
faces that come near each other.

*Arithmetic.* Signs of volumes and intersections are exact; the graph condition is accepted only
beyond a bound on its rounding error; the covering number is an integer by construction. The source
has to pass the same two tests, since otherwise M is no subset of space that could be mapped.
"""

from __future__ import annotations

import math
import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_reals, describe
from ..base.options import instance, real
from ..base.torus import TWO_PI, Torus
from ..errors import MeshError
from ..maps.files import load_map
from ..measures.orientation import chart_areas, outward_areas
from ..mesh.crossings import too_small
from ..mesh.given import as_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .findings import MOST_IDS, Certificate, Findings
from .reach import not_positive

__all__ = ["certify", "certify_file"]

# Defects of the source that the exact tests here judge better than tolerances do.
_JUDGED_EXACTLY = ("degenerate", "inverted", "inside_out")
_SCALE = "scale the points"


def certify(
    mesh: TetMesh | TriMesh,
    image: ArrayLike,
    torus: Torus | None = None,
    *,
    tolerance: float = 1e-9,
) -> Certificate:
    """Prove that the piecewise-affine map of a solid, or of a closed surface, is a bijection.

    Parameters
    ----------
    mesh : TetMesh or TriMesh
        The source.
    image : array_like, shape (n, 3)
        Image of each vertex.
    torus : Torus, optional
        The torus the boundary is meant to lie on; then the boundary vertices have to lie on it and
        their image has to cover it once. Without it any embedded boundary image is accepted.
    tolerance : float
        Largest distance of boundary vertices from the torus, relative to its tube radius.

    Returns
    -------
    Certificate
        A surface is certified to be mapped one to one; a solid, to be mapped one to one onto what
        its boundary image encloses. The module's documentation holds the proof.

    Raises
    ------
    ArrayError
        If ``image`` has the wrong shape or holds no real numbers.
    NonFiniteError
        If it holds a NaN or an infinity.
    OptionError
        If the tolerance is negative or not finite.

    Notes
    -----
    The theorem and its proof are in the documentation of `stretchmap.certificate.checks`; for the
    degree of piecewise-affine maps see Lipman (2014), for exact signs Shewchuk (1997).

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> sm.certify(solid, solid.V).certified
    True
    >>> squashed = solid.V.copy()
    >>> squashed[0] = solid.V[1]
    >>> sm.certify(solid, squashed).certified
    False
    """
    mesh = as_mesh(mesh)
    tolerance = real("tolerance", tolerance, 0.0)
    if torus is not None:
        instance("torus", torus, Torus, "Torus(R, r)")
    points = as_reals(image, "image", mesh.V.shape)
    found = Findings()
    if not _topology(found, mesh):
        return found.certificate("")
    if isinstance(mesh, TetMesh):
        surface = mesh.surface
        boundary_image = np.ascontiguousarray(points[mesh.boundary_vertices])
        _positive(found, "source_positive", mesh.V, mesh.T, "source")
        _positive(found, "image_positive", points, mesh.T, "image")
    else:
        surface, boundary_image = mesh, points
    # Of one mesh many maps are certified in turn.
    _embedded(found, "source_embedded", surface.crossing_faces, surface.V, "source surface")
    proof = _boundary(found, boundary_image, surface.F, torus, tolerance)
    if isinstance(mesh, TetMesh):
        _volumes(found, points, mesh.T, boundary_image, surface.F)
        proof = f"all image volumes positive and {proof}"
    return found.certificate(proof)


def certify_file(
    path: str | os.PathLike[str], torus: Torus | None = None, *, tolerance: float = 1e-9
) -> Certificate:
    """:func:`certify` for a map file, also one written by another program.

    Parameters
    ----------
    path : path-like
        An ``.npz`` with ``V``, ``F`` or ``T``, and ``image``.
    torus : Torus, optional
        Overrides the one named in the file; a file need not name one.
    tolerance : float
        As in :func:`certify`.

    Returns
    -------
    Certificate

    Raises
    ------
    FileFormatError
        If the file is not such an ``.npz``.
    MeshError
        If its arrays are not a mesh.
    OSError
        If it cannot be opened.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> result = sm.volume_map(sm.samples.solid_torus(600))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result.save(os.path.join(folder, "map.npz"))
    ...     found = sm.certify_file(os.path.join(folder, "map.npz"))
    >>> found.certified
    True
    """
    if torus is not None:
        instance("torus", torus, Torus, "Torus(R, r)")
    loaded = load_map(path)
    return certify(loaded.mesh, loaded.image, torus or loaded.torus, tolerance=tolerance)


def _topology(found: Findings, mesh: TetMesh | TriMesh) -> bool:
    diagnosis = mesh.diagnose()
    names = {d.name for d in diagnosis.defects}.difference(_JUDGED_EXACTLY)
    try:
        diagnosis.require(names)
    except MeshError as error:
        return found.note("topology", False, f"source: {error}", error.ids)
    if len(diagnosis.genus) != 1:
        return found.note("topology", False, "source: its boundary is not connected")
    return found.note("topology", True)


def _positive(
    found: Findings, name: str, V: NDArray[np.float64], T: NDArray[np.int32], what: str
) -> None:
    bad = _core.certificate.not_positive_tets(V, T)
    reason = ""
    if len(bad):
        proven = not_positive(V, T, bad)
        reason = f"{what} volume not positive: {describe('tet', proven)}"
        if not len(proven):
            reason = f"{what} volume too small for exact tests: {describe('tet', bad)}; {_SCALE}"
        bad = np.concatenate([proven, np.setdiff1d(bad, proven)])
    found.note(name, not len(bad), reason, bad)


def _embedded(
    found: Findings, name: str, pairs: NDArray[np.int32], V: NDArray[np.float64], what: str
) -> None:
    fault = f"touches or crosses itself: {describe('face pair', pairs)}"
    if too_small(V):
        fault = f"is too small for exact tests; {_SCALE}"
    found.note(name, not len(pairs), f"the {what} {fault}", pairs)


def _boundary(
    found: Findings,
    image: NDArray[np.float64],
    F: NDArray[np.int32],
    torus: Torus | None,
    tolerance: float,
) -> str:
    """Embeddedness of the boundary image; returns the proof in words."""

    def not_crossing() -> str:
        pairs = _core.certificate.crossing_faces(image, F, MOST_IDS)
        _embedded(found, "boundary_embedded", pairs, image, "boundary image")
        return "the boundary image does not cross itself (exact tests)"

    if torus is None:
        return not_crossing()
    graph = _core.certificate.torus_graph(image, F, torus.R)
    u, v, s = torus.coordinates(image)
    winding = graph.winding
    found.checks["boundary_graph"] = not len(graph.bad)
    if len(graph.bad):
        found.ids["boundary_graph"] = tuple(graph.bad[:MOST_IDS].tolist())
        flipped = np.flatnonzero(~(outward_areas(image, F, torus) > 0.0))
        found.note(
            "boundary_oriented",
            not len(flipped),
            f"the boundary image is folded: {describe('face', flipped)}",
            flipped,
        )
        proof = not_crossing()
        winding = float(chart_areas(F, np.stack([u, v], axis=1)).sum()) / TWO_PI**2
    else:
        proof = "the boundary image is a graph over the torus, covered once"
    found.quantities["winding"] = round(winding)
    found.note(
        "covers_once",
        abs(winding - 1.0) < 1e-6,
        f"the boundary image covers the torus {winding:.6g} times instead of once",
    )
    distance = np.abs(s - torus.r) / torus.r
    found.quantities["torus_distance"] = float(distance.max())
    far = np.flatnonzero(distance > tolerance)
    found.note(
        "on_torus", not len(far), f"not on the torus: {describe('boundary vertex', far)}", far
    )
    return proof


def _volumes(
    found: Findings,
    image: NDArray[np.float64],
    T: NDArray[np.int32],
    boundary_image: NDArray[np.float64],
    F: NDArray[np.int32],
) -> None:
    volumes = _core.mesh.tet_volumes(image, T)
    total = float(volumes.sum())
    enclosed = _core.mesh.enclosed_volume(boundary_image, F)
    # Either sum is off by less than its number of terms in units of rounding of the bounding box.
    box = float(np.prod(np.ptp(image, axis=0)))
    bound = 8.0 * float(np.finfo(float).eps) * (len(T) + len(F)) * box
    found.quantities["image_volume"] = total
    found.quantities["enclosed_volume"] = enclosed
    found.quantities["smallest_volume"] = (
        float(volumes.min() / (abs(total) / len(T))) if total else math.nan
    )
    found.note(
        "volume_enclosed",
        abs(total - enclosed) <= bound,
        f"the tets' volumes add up to {total:.17g}, the boundary image encloses {enclosed:.17g}",
    )
