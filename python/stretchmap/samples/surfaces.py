"""Closed surfaces."""

from __future__ import annotations

import numpy as np

from ..base.options import memory, whole
from ..base.torus import TWO_PI, Torus
from ..mesh.meshes import TriMesh
from .solids import ball, solid_double_torus

__all__ = ["double_torus", "sphere", "torus_surface"]


_BYTES_PER_VERTEX = 400  # at the peak


def torus_surface(nu: int = 60, nv: int = 20, R: float = 3.0, r: float = 1.0) -> TriMesh:
    """A regular triangulation of the standard torus, faces outward.

    Parameters
    ----------
    nu, nv : int
        Vertices the long and the short way round, at least 3; vertex ``i nv + j`` lies at the
        angles ``(2 pi i / nu, 2 pi j / nv)``.
    R, r : float
        Radii, ``0 < r < R``.

    Returns
    -------
    TriMesh

    Raises
    ------
    OptionError
        If there are fewer than three vertices either way or the radii do not make a torus.

    Examples
    --------
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(24, 12)
    >>> surface
    TriMesh(288 vertices, 576 faces)
    >>> surface.euler
    0
    """
    nu, nv = whole("nu", nu, 3), whole("nv", nv, 3)
    memory(f"a mesh of {2 * nu * nv} faces", _BYTES_PER_VERTEX * nu * nv)
    i, j = (index.ravel() for index in np.indices((nu, nv)))
    a, b = i * nv + j, (i + 1) % nu * nv + j
    c, d = (i + 1) % nu * nv + (j + 1) % nv, i * nv + (j + 1) % nv
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    return TriMesh(Torus(R, r).xi(TWO_PI * i / nu, TWO_PI * j / nv), faces)


def sphere(n: int = 6) -> TriMesh:
    """The unit sphere, ``48 n^2`` faces; the boundary of :func:`ball`.

    Parameters
    ----------
    n : int
        As of :func:`ball`.

    Returns
    -------
    TriMesh

    Raises
    ------
    OptionError
        If ``n < 1``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> sm.samples.sphere(2).n_faces
    192
    """
    return ball(n).surface


def double_torus(n: int = 2) -> TriMesh:
    """A closed surface of genus 2, the boundary of :func:`solid_double_torus`.

    Parameters
    ----------
    n : int
        As of :func:`solid_double_torus`.

    Returns
    -------
    TriMesh

    Raises
    ------
    OptionError
        If ``n < 1``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> sm.samples.double_torus(1).genus
    2
    """
    return solid_double_torus(n).surface
