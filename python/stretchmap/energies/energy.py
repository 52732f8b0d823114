"""What all energies share: from derivatives of single elements to those of the whole mesh."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_reals
from ..base.options import whole
from ..errors import DegenerateError
from ..mesh.meshes import TetMesh, TriMesh

if TYPE_CHECKING:
    import scipy.sparse as sp

__all__ = ["ElementDerivatives", "Energy"]


@dataclass(frozen=True, eq=False)
class ElementDerivatives:
    """Energies of single elements with their derivatives by their c corners.

    Attributes
    ----------
    values : ndarray, shape (k,)
    gradients : ndarray, shape (k, c, 3), or None
        By the corners, in the order of the element.
    hessians : ndarray, shape (k, 3 c, 3 c), or None
        Unknown ``3 a + j`` is component j of corner a.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.energies.VolumeStretch(solid).elements(solid.V)
    >>> bool(np.allclose(found.gradients.sum(axis=1), 0.0, atol=1e-9))  # no force from outside
    True
    """

    values: NDArray[np.float64]
    gradients: NDArray[np.float64] | None
    hessians: NDArray[np.float64] | None

    def __repr__(self) -> str:
        order = 0 if self.gradients is None else 1 if self.hessians is None else 2
        return f"ElementDerivatives({len(self.values)} elements, order {order})"


class Energy(ABC):
    """An energy that is a sum over the elements of a mesh; base of the others.

    Attributes
    ----------
    mesh : TriMesh or TetMesh
        The source.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> energy = sm.energies.VolumeStretch(solid)
    >>> isinstance(energy, sm.energies.Energy)
    True
    """

    mesh: TriMesh | TetMesh

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.mesh!r})"

    @abstractmethod
    def _evaluate(self, image: NDArray[np.float64], order: int) -> Any:
        """What the core has computed of every element."""

    def elements(self, image: ArrayLike, order: int = 2) -> ElementDerivatives:
        """Energies of single elements with their derivatives.

        Parameters
        ----------
        image : array_like, shape (n, 3)
        order : {0, 1, 2}
            How many derivatives; those of second order take 1.2 kB a tet, 0.7 kB a face.

        Returns
        -------
        ElementDerivatives

        Raises
        ------
        ArrayError, NonFiniteError
            Of ``image``.
        OptionError
            Another order.
        DegenerateError
            Derivatives were asked for where the energy is infinite; ``ids`` are the elements.
        """
        points = np.ascontiguousarray(as_reals(image, "image", (self.mesh.n_vertices, 3)))
        order = whole("order", order, 0, 2)
        if order:
            self._require_finite(points)
        found = self._evaluate(points, order)
        corners = self._corners.shape[1]
        return ElementDerivatives(
            found.values,
            found.gradients.reshape(-1, corners, 3) if order > 0 else None,
            found.hessians.reshape(-1, 3 * corners, 3 * corners) if order > 1 else None,
        )

    def value(self, image: ArrayLike) -> float:
        """The energy of an image (n, 3); infinite where it is not defined."""
        return float(self.elements(image, 0).values.sum())

    def gradient(self, image: ArrayLike) -> NDArray[np.float64]:
        """The gradient by all vertices, shape (n, 3); errors as of `elements`."""
        parts = self.elements(image, 1).gradients
        assert parts is not None
        n, at = self.mesh.n_vertices, self._corners.ravel()
        flat = parts.reshape(-1, 3)
        return np.column_stack([np.bincount(at, flat[:, j], n) for j in range(3)])

    def hessian(self, image: ArrayLike) -> sp.csr_matrix:
        """The Hessian, sparse and symmetric, shape (3 n, 3 n); errors as of `elements`."""
        import scipy.sparse as sp

        parts = self.elements(image, 2).hessians
        assert parts is not None
        unknowns = (3 * self._corners[:, :, None] + np.arange(3)).reshape(len(parts), -1)
        rows = np.broadcast_to(unknowns[:, :, None], parts.shape)
        columns = np.broadcast_to(unknowns[:, None, :], parts.shape)
        size = 3 * self.mesh.n_vertices
        entries = (parts.ravel(), (rows.ravel(), columns.ravel()))
        return sp.coo_matrix(entries, shape=(size, size)).tocsr()

    @property
    def _corners(self) -> NDArray[np.int32]:
        return self.mesh.T if isinstance(self.mesh, TetMesh) else self.mesh.F

    def _require_finite(self, points: NDArray[np.float64]) -> None:
        bad = np.flatnonzero(~np.isfinite(self._evaluate(points, 0).values))
        if len(bad):
            raise DegenerateError(
                f"the energy of {len(bad)} elements is infinite, {bad[0]} among them: it has no "
                "derivatives where they are inverted; untangle first, or give epsilon > 0",
                bad,
            )
