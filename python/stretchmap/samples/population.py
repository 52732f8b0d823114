"""Synthetic vertebrae that differ by a few known modes, each meshed in its own way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from ..base.arrays import as_points, read_only
from ..base.options import real, whole
from ..base.torus import TWO_PI
from ..errors import SolverError
from ..mesh.meshes import TetMesh
from .sweep import Array, parameters, resolution, sweep
from .vertebra import SLENDERNESS, individual

__all__ = ["VertebraPopulation", "vertebra_population"]

# Share of the size that the mean displacement of a mode is worth at one standard deviation.
_SPREAD = (0.02, 0.013, 0.008, 0.005)
_LARGEST_SCORE = 2.0  # of few individuals: normal, cut off here
_STATIONS, _SIXTHS = 12, 6  # landmarks sit at the crossings of these lines


@dataclass(frozen=True, eq=False)
class VertebraPopulation:
    """Solids that are known deformations of one another.

    Every point of an individual is a material point of the mean individual, moved by
    ``sum_j scores[i, j] * modes[j]`` and then by a rotation, a shift and a change of size.

    Attributes
    ----------
    solids : tuple of TetMesh
        The individuals, of different resolution, phase, numbering, pose and size.
    material : tuple of ndarray, shape (n_i, 3)
        Where every vertex of ``solids[i]`` lies in the mean individual.
    reference : TetMesh
        The mean individual.
    truth : ndarray, shape (k, n, 3)
        Where the vertices of the reference lie in every individual.
    modes : ndarray, shape (m, n, 3)
        Displacements of the reference's vertices at one standard deviation; on a dense set of
        points of the solid orthogonal to each other and to translations, rotations and scaling.
    scores : ndarray, shape (k, m)
        In standard deviations. Of m + 2 individuals or more: of mean 0, variance 1 and not
        correlated, so that the modes are the principal components of this very sample.
    landmarks : ndarray, shape (k, l, 3)
        Points on the surface of every individual that correspond.
    poses : ndarray, shape (k, 4, 3)
        Rows 0 to 2 turn and scale a row vector, row 3 is added.

    Examples
    --------
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(3, n_tets=600)
    >>> len(bones.solids), bones.truth.shape[0], bones.scores.shape
    (3, 3, (3, 4))
    """

    solids: tuple[TetMesh, ...]
    material: tuple[NDArray[np.float64], ...]
    reference: TetMesh
    truth: NDArray[np.float64]
    modes: NDArray[np.float64]
    scores: NDArray[np.float64]
    landmarks: NDArray[np.float64]
    poses: NDArray[np.float64]
    _deformation: _Deformation

    def place(self, individual: int, material: ArrayLike) -> NDArray[np.float64]:
        """Where material points of the mean individual lie in another.

        Parameters
        ----------
        individual : int
            From 0 to k - 1.
        material : array_like, shape (p, 3)

        Returns
        -------
        ndarray, shape (p, 3)

        Raises
        ------
        OptionError
            No such individual.
        ArrayError, NonFiniteError
            The points are none.
        """
        i = whole("individual", individual, 0, len(self.solids) - 1)
        return self._deformation.place(i, as_points(material, "material"))

    def modes_at(self, material: ArrayLike) -> NDArray[np.float64]:
        """The modes (m, p, 3) at material points (p, 3) of the mean individual."""
        return self._deformation.fields.at(as_points(material, "material"))


@dataclass(frozen=True, eq=False)
class _ModeFields:
    """Combinations of smooth fields that are orthogonal on a set of points."""

    mixture: Array  # (m, m + 7), of the fields of `_raw_fields`

    @classmethod
    def of(cls, points: Array, size: float, spread: Array) -> _ModeFields:
        """Raw fields in turn made orthogonal to similarities and to those before, and scaled."""
        raw = _raw_fields(points)
        count, free = len(raw), len(raw) - len(_SPREAD)
        flat = raw.reshape(count, -1)
        basis = np.zeros((0, count))
        for k in range(count):
            row = np.eye(count)[k]
            for _ in range(2):  # twice is enough (Kahan, Parlett)
                for other in basis:
                    row = row - (other @ flat) @ (row @ flat) * other
            basis = np.vstack([basis, row / np.linalg.norm(row @ flat)])
        unit = np.sqrt(len(points)) * size
        return cls(basis[free:] * (unit * spread)[:, None])

    def at(self, points: Array) -> Array:
        return np.asarray(np.einsum("jk,knx->jnx", self.mixture, _raw_fields(points)))


@dataclass(frozen=True, eq=False)
class _Deformation:
    """From the mean individual to every other."""

    fields: _ModeFields
    scores: Array
    poses: Array

    def place(self, i: int, points: Array) -> Array:
        moved = points + np.einsum("j,jnx->nx", self.scores[i], self.fields.at(points))
        return np.asarray(moved @ self.poses[i, :3] + self.poses[i, 3])


def _raw_fields(points: Array) -> Array:
    """(7 + m, n, 3) Infinitesimal similarities, then what the modes are made from."""
    x, y, z = points.T
    o, e = np.zeros_like(x), np.ones_like(x)
    behind = 0.8 * np.logaddexp(0.0, -(x + 1.0) / 0.8)
    front = 1.0 / (1.0 + np.exp(-(x - 1.0) / 0.8))
    fields = [
        (e, o, o), (o, e, o), (o, o, e), (o, -z, y), (z, o, -x), (-y, x, o), (x, y, z),
        (x, o, o),  # deeper and narrower
        (o, o, y * y),  # transverse processes lifted
        (-behind, o, -0.5 * behind),  # a longer spinous process, that hangs lower
        (o, o, z * front),  # a higher body
    ]  # fmt: skip
    return np.stack([np.stack(field, axis=1) for field in fields])


def vertebra_population(
    n: int = 20,
    seed: int = 0,
    *,
    n_tets: int = 10_000,
    n_landmarks: int = 24,
    spread: float = 1.0,
) -> VertebraPopulation:
    """Synthetic vertebrae by known smooth deformations of one, with four known modes.

    The modes are depth against width, the lift of the transverse processes, the length of the
    spinous process and the height of the body. Each individual has a mesh of its own: other numbers
    of stations round the canal, other phases and spacings, shuffled vertices and tets; and a pose
    and a size of its own.

    Parameters
    ----------
    n : int
        Number of individuals, at least 1.
    seed : int
        Draws scores, meshes and poses.
    n_tets : int
        Number of tets aimed at, of each.
    n_landmarks : int
        From 0 to 72, spread over the surface.
    spread : float
        Factor of all scores; at 1 the displacements at one standard deviation are 2, 1.3, 0.8 and
        0.5 % of the size, root mean square over the points.

    Returns
    -------
    VertebraPopulation

    Raises
    ------
    OptionError
        A number out of range.
    SolverError
        The spread is so large that a tet is turned over.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(2, seed=3, n_tets=600)
    >>> bool(np.allclose(bones.place(1, bones.material[1]), bones.solids[1].V))
    True
    """
    n, seed = whole("n", n, 1, 100_000), whole("seed", seed, 0, 2**30)
    n_landmarks = whole("n_landmarks", n_landmarks, 0, _STATIONS * _SIXTHS)
    spread = real("spread", spread, 0.0)
    rng = np.random.default_rng([seed, 0xB0E5])
    embed = individual(None)
    rings, stations = resolution(n_tets, SLENDERNESS)
    reference = sweep(rings, stations, embed)
    size = float(np.linalg.norm(np.ptp(reference.V, axis=0)))
    dense = embed(*parameters(4, 96)).reshape(-1, 3)
    fields = _ModeFields.of(dense, size, np.array(_SPREAD))
    scores = spread * _scores(rng, n)
    poses = np.stack([_pose(rng, size) for _ in range(n)])
    rests = [_remeshed(rng, n_tets) for _ in range(n)]
    sites = np.sort(rng.permutation(_STATIONS * _SIXTHS)[:n_landmarks])
    turn, angle = (sites // _SIXTHS) / _STATIONS, TWO_PI * (sites % _SIXTHS) / _SIXTHS
    marks = embed(turn[:, None], np.cos(angle)[:, None], np.sin(angle)[:, None]).reshape(-1, 3)

    deformation = _Deformation(fields, read_only(scores), read_only(poses))
    place = deformation.place
    solids = tuple(TetMesh(place(i, rest.V), rest.T) for i, rest in enumerate(rests))
    for i, solid in enumerate(solids):
        flipped = np.flatnonzero(~(solid.tet_volumes > 0.0))
        if len(flipped):
            raise SolverError(
                f"individual {i} has {len(flipped)} tets turned over; choose a smaller spread",
                flipped,
            )
    return VertebraPopulation(
        solids=solids,
        material=tuple(rest.V for rest in rests),
        reference=reference,
        truth=read_only(np.stack([place(i, reference.V) for i in range(n)])),
        modes=read_only(fields.at(reference.V)),
        scores=scores,
        landmarks=read_only(np.stack([place(i, marks) for i in range(n)])),
        poses=poses,
        _deformation=deformation,
    )


def _scores(rng: np.random.Generator, n: int) -> Array:
    """Normal scores (n, m), whitened where there are enough individuals."""
    drawn = rng.standard_normal((n, len(_SPREAD)))
    if n <= len(_SPREAD) + 1:
        return np.clip(drawn, -_LARGEST_SCORE, _LARGEST_SCORE)
    centered = drawn - drawn.mean(axis=0)
    return np.asarray(np.linalg.qr(centered)[0] * np.sqrt(n - 1.0))


def _pose(rng: np.random.Generator, size: float) -> Array:
    """A random rotation times a factor within five per cent, and a shift."""
    rotation = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    scale = 1.0 + 0.05 * rng.uniform(-1.0, 1.0)
    return np.vstack([scale * rotation, size * rng.uniform(-1.0, 1.0, 3)])


def _remeshed(rng: np.random.Generator, n_tets: int) -> TetMesh:
    """The mean individual with another mesh."""
    rings, stations = resolution(round(n_tets * rng.uniform(0.85, 1.15)), SLENDERNESS)
    phase, turn = rng.uniform(0.0, 1.0), rng.uniform(0.0, TWO_PI)
    waves, strength = int(rng.integers(1, 4)), rng.uniform(0.0, 0.3)
    embed = individual(None)

    def own(turns: Array, x: Array, y: Array) -> Array:
        at = turns + phase
        at = at + strength / (TWO_PI * waves) * np.sin(TWO_PI * waves * turns)
        c, s = np.cos(turn), np.sin(turn)
        return embed(at, c * x - s * y, s * x + c * y)

    mesh = sweep(rings, stations, own)
    order, tets = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_tets)
    rank = np.argsort(order).astype(np.int32)
    return TetMesh(mesh.V[order], rank[mesh.T[tets]])
