"""Statistics of a field over a population: every shape's field on the mean, tet by tet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_reals, read_only
from ..base.options import instance, one_of, real, shown
from ..errors import ArrayError, MissingDependencyError, OptionError
from ..maps.files import LoadedMap
from ..mesh.meshes import TetMesh
from ..resample.fields import transfer
from ..volume.fill import fill
from .result import Population

__all__ = ["FieldStatistics", "carry_field", "field_statistics"]

Conserve = Literal["integral", "value"]
Per = Literal["vertex", "tet"]


@dataclass(frozen=True, eq=False)
class FieldStatistics:
    """A field over a population, in the tets of its mean.

    Attributes
    ----------
    names : tuple of str
        Of the shapes whose fields there are.
    values : ndarray, shape (k, n_tets)
    mean, std : ndarray, shape (n_tets,)
        Over the shapes; the standard deviation with k - 1.
    t, p : ndarray, shape (n_tets,)
        Student's t and its two-sided p-value; NaN where the field does not vary.
    p_adjusted : ndarray, shape (n_tets,)
        Corrected for the number of tets (Benjamini and Hochberg 1995): calling everything up to a
        level significant, the share of false calls is expected to be no more than that level.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1, tol=1.0)
    >>> fields = {name: bones.material[int(name)][:, 0] for name in found.names}
    >>> statistics = sm.population.field_statistics(found, fields, conserve="value")
    >>> statistics.values.shape == (3, found.mean.n_tets)
    True
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    t: NDArray[np.float64]
    p: NDArray[np.float64]
    p_adjusted: NDArray[np.float64]


def carry_field(
    population: Population,
    name: str,
    values: ArrayLike,
    *,
    per: Per = "vertex",
    conserve: Conserve = "integral",
) -> NDArray[np.float64]:
    """Carry a field of one shape to the mean of its population.

    Parameters
    ----------
    population : Population
        Made by `fit`, which knows where the shapes are.
    name : str
        Of the shape.
    values : array_like, shape (n,) or (k,)
        At the vertices of the shape or in its tets, see ``per``.
    per : {"vertex", "tet"}
    conserve : {"integral", "value"}
        ``"integral"``: a density, whose integral over every tet stays what it is on the part of the
        shape that corresponds to it. ``"value"``: what is there, whatever the volume.

    Returns
    -------
    ndarray, shape (n_tets,)
        In the tets of ``population.mean``.

    Raises
    ------
    OptionError
        There is no such shape, or an option out of range.
    ArrayError, NonFiniteError, DegenerateError
        As `transfer`.
    CertificationError
        The mean is too coarse for the shape, and its refinement could not be laid on it.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1, tol=1.0)
    >>> solid = bones.solids[1]
    >>> mass = sm.population.carry_field(found, "1", np.ones(solid.n_tets), per="tet")
    >>> bool(np.isclose(mass @ found.mean.tet_volumes, solid.volume))
    True
    """
    population = instance("population", population, Population, "stretchmap.population.fit(...)")
    one_of("conserve", conserve, ("integral", "value"))
    one_of("name", name, population.names)
    places = {shape.name: shape for shape in population.shapes}
    if name not in places:
        raise OptionError(f"where the shape {name!r} came from is not known; take a result of fit")
    values = as_reals(values, "values", (None,))
    solid = places[name].load()
    laid, parent = _laid(population, name)
    between = LoadedMap(
        mesh=solid, image=solid.V, target=laid, arrays={}, meta={}, converged=True,
        stop_reason="the shape itself", seconds={},
    )  # fmt: skip
    carried = transfer(
        between, values, per=per, conserve="mean" if conserve == "value" else "integral"
    )
    mean = population.mean
    there = laid.tet_volumes
    if parent is not None:  # of the parts of each tet
        parts, there = carried * there, np.bincount(parent, there).astype(np.float64)
        carried = np.bincount(parent, parts) / there
    return carried if conserve == "value" else np.asarray(carried * (there / mean.tet_volumes))


def _laid(population: Population, name: str) -> tuple[TetMesh, NDArray[np.int32] | None]:
    """The mean laid on a shape, refined if that took more tets than it has, and which of its tets
    each lies in."""
    mean, points = population.mean, population.correspondences[population.names.index(name)]
    laid = TetMesh(points, mean.T)
    if (laid.tet_volumes > 0.0).all():
        return laid, None
    found = fill(mean, points[mean.boundary_vertices])
    parent = None if found.refinement is None else found.refinement.parent_tet
    return TetMesh(found.image, found.mesh.T), parent


def field_statistics(
    population: Population,
    fields: Mapping[str, ArrayLike],
    *,
    per: Per = "vertex",
    conserve: Conserve = "integral",
    group: Mapping[str, Any] | None = None,
    against: float = 0.0,
) -> FieldStatistics:
    """Mean, standard deviation and t-map of a field over a population.

    Parameters
    ----------
    population : Population
    fields : mapping from names of shapes to arrays
        As in `carry_field`; shapes without one are left out.
    per, conserve
        As in `carry_field`.
    group : mapping from names to one of two labels, optional
        Compare two groups, the first in sorted order minus the second, by Welch's test, which does
        not take variances to be equal. Labels are all numbers, sorted as such, or all text.
        Without it the mean is compared with ``against``.
    against : float

    Returns
    -------
    FieldStatistics

    Raises
    ------
    OptionError
        An unknown shape, or an option out of range.
    ArrayError
        Fewer than two shapes of a group, more than two groups, labels of several kinds, or fields
        of other shapes.
    MissingDependencyError
        SciPy is older than 1.11.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:4], max_rounds=1, tol=1.0)
    >>> fields = {name: np.ones(bones.solids[int(name)].n_vertices) for name in found.names}
    >>> labels = dict(zip(found.names, "aabb"))
    >>> statistics = sm.population.field_statistics(found, fields, group=labels)
    >>> statistics.t.shape == (found.mean.n_tets,)
    True
    """
    import scipy.stats  # takes as long as all else that fitting a population imports

    if not hasattr(scipy.stats, "false_discovery_control"):
        raise MissingDependencyError("field statistics need SciPy 1.11: pip install 'scipy>=1.11'")
    against = real("against", against)
    for what, given in (("fields", fields), ("group", {} if group is None else group)):
        if not isinstance(given, Mapping):
            raise OptionError(
                f"{what} must be a mapping by the names of shapes, got {shown(given)}"
            )
    names = tuple(fields)
    rows = [carry_field(population, n, fields[n], per=per, conserve=conserve) for n in names]
    if len(rows) < 2:
        raise ArrayError(f"statistics need the fields of two shapes or more, got {len(rows)}")
    values = np.stack(rows)
    spread = values.std(axis=0, ddof=1)
    varies = spread > 1e-12 * np.abs(values).max(axis=0)
    t, p, adjusted = (np.full(values.shape[1], np.nan) for _ in range(3))
    if varies.any():
        sides = _sides(names, values[:, varies], group)
        if len(sides) == 2:
            found = scipy.stats.ttest_ind(*sides, equal_var=False)
        else:
            found = scipy.stats.ttest_1samp(sides[0], against)
        t[varies], p[varies] = found.statistic, found.pvalue
        known = np.isfinite(p)
        adjusted[known] = scipy.stats.false_discovery_control(p[known], method="bh")
    arrays = (values, values.mean(axis=0), spread, t, p, adjusted)
    return FieldStatistics(names, *(read_only(array) for array in arrays))


def _sides(
    names: tuple[str, ...], values: NDArray[np.float64], group: Mapping[str, Any] | None
) -> list[NDArray[np.float64]]:
    """All values, or those of two groups."""
    if group is None:
        return [values]
    given = [group.get(name, math.nan) for name in names]
    try:  # what is not equal to itself is NaN, which tables have for no label
        missing = [n for n, label in zip(names, given, strict=True) if label != label]
        labels = sorted(set(given)) if not missing else []
    except (TypeError, ValueError):
        kinds = sorted({type(label).__name__ for label in given})
        raise ArrayError(
            f"group: labels must be all numbers or all text, got {' and '.join(kinds)}"
        ) from None
    if missing:
        raise ArrayError(f"group: no label of {', '.join(missing[:5])}")
    sides = [values[[label == each for each in given]] for label in labels]
    if len(sides) != 2 or min(map(len, sides)) < 2:
        sizes = ", ".join(f"{k}: {len(s)}" for k, s in zip(labels, sides, strict=True))
        raise ArrayError(f"two groups of two shapes or more can be compared, got {sizes}")
    return sides
