"""What all maps share: mesh and image, points carried along, the report."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.options import as_path, flag, whole
from ..base.tables import HasSummary, plain_dict, table, versions
from ..base.torus import Torus
from ..measures.elements import Distortion, distortion
from ..mesh.exchange import Cells, Exchanged
from ..mesh.meshes import TetMesh, TriMesh
from .carrying import CarriesPoints
from .fields import carried
from .history import IterationRecord
from .meta import summary_rows
from .writing import all_fields, elements, save_arrays, write_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Kind", "MapResult"]

_Map = TypeVar("_Map", bound="MapResult")

# Of pictures, see `stretchmap.plot`.
Kind = Literal[
    "checkerboard", "cutaway", "levels", "registration", "loops", "domain", "ratios", "convergence"
]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class MapResult(CarriesPoints, HasSummary, Exchanged):
    """A piecewise-affine map, given by the image of each vertex.

    Attributes
    ----------
    mesh : TriMesh or TetMesh
        The mesh the map starts from.
    image : ndarray, shape (n, 3)
        Image of each of its vertices.
    torus : Torus or None
        The standard torus it goes to; None where it goes to another solid, or none is known.
    target : TetMesh or None
        The solid it goes to, if that is not the standard one.
    angles : ndarray, shape (n, 2), or None
        Of a map of a surface: (u, v) of the image in radians, any branch.
    history : tuple of IterationRecord
    converged : bool
    stop_reason : str
        Why the iterations ended, in words.
    seconds : dict
        Wall-clock time per stage.
    point_fields, cell_fields : dict of str to ndarray
        Fields of the input by name, see `with_fields`; they go into every file.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.volume_map(sm.samples.solid_torus(600))
    >>> result.mesh.n_vertices == len(result.image)
    True
    >>> result.distortion.flips, result.certificate.certified
    (0, True)
    >>> u, v, s = result.coordinates().T
    >>> bool(s.max() <= result.torus.r * (1.0 + 1e-12))
    True
    """

    _title: ClassVar[str] = "map"

    mesh: TriMesh | TetMesh
    image: NDArray[np.float64]
    torus: Torus | None = None
    target: TetMesh | None = field(default=None, repr=False)
    angles: NDArray[np.float64] | None = field(default=None, repr=False)
    history: tuple[IterationRecord, ...] = field(default=(), repr=False)
    converged: bool
    stop_reason: str
    seconds: Mapping[str, float]
    point_fields: Mapping[str, NDArray[Any]] = field(default_factory=dict, repr=False)
    cell_fields: Mapping[str, NDArray[Any]] = field(default_factory=dict, repr=False)

    @property
    def title(self) -> str:
        """What kind of map this is."""
        return self._title

    def __repr__(self) -> str:
        size = f"{len(elements(self.mesh))} {'tets' if isinstance(self.mesh, TetMesh) else 'faces'}"
        state = "converged" if self.converged else "not converged"
        return f"{type(self).__name__}({size}, {state})"

    def plot(self, kind: Kind | None = None, **options: Any) -> Figure:
        """Picture of the map.

        Parameters
        ----------
        kind : str, optional
            One of ``stretchmap.plot.kinds(result)``: ``"levels"``, ``"checkerboard"``, ...; by
            default the first of them.
        **options
            Those of the function of that name in ``stretchmap.plot``.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        OptionError
            Unknown kind, or an option it does not have.
        MissingDependencyError
            matplotlib is not installed.
        """
        import stretchmap  # the front door loads pictures when they are asked for

        if kind is None:
            kind = stretchmap.plot.kinds(self)[0]
        return stretchmap.plot.picture(self, kind, **options)

    def with_fields(
        self: _Map,
        point_data: Mapping[str, ArrayLike] | None = None,
        cell_data: Mapping[str, ArrayLike] | None = None,
    ) -> _Map:
        """The map with further fields of its input, which its files and frames then carry.

        Fields it has stay, but for those of the same name.

        Parameters
        ----------
        point_data, cell_data : mapping of str to array_like
            Rows as the input's vertices and elements, or as those of ``mesh``. Where the input was
            refined, a tet or face has the values of the one it is a part of, an added vertex the
            mean of its parents or, of whole numbers, the value of the first.

        Raises
        ------
        ArrayError
            Another number of rows, no numbers, or two names that are one once slashes are
            underscores.
        """
        added = getattr(self, "refinement", None)
        points, cells = carried(self.mesh, added, point_data, cell_data)
        return dataclasses.replace(
            self,
            point_fields={**self.point_fields, **points},
            cell_fields={**self.cell_fields, **cells},
        )

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """Further arrays to be kept in a map file, by name."""
        return {}

    def extra_scalars(self) -> dict[str, Any]:
        """Further entries of the report, JSON-compatible, by name."""
        return {}

    @cached_property
    def distortion(self) -> Distortion:
        """Measures of the map, see :func:`distortion`.

        The image of a surface is oriented by ``torus``, else by ``angles``.
        """
        angles = self.angles if self.torus is None else None
        return distortion(self.mesh, self.image, torus=self.torus, angles=angles)

    def to_dict(self, history: bool = False) -> dict[str, Any]:
        """Everything scalar about the map, ready for JSON.

        Parameters
        ----------
        history : bool
            Add the list of iteration records.
        """
        history = flag("history", history)
        out: dict[str, Any] = {
            "kind": self.title,
            "n_vertices": len(self.mesh.V),
            "n_elements": len(elements(self.mesh)),
            "element": "tet" if isinstance(self.mesh, TetMesh) else "face",
            **self.distortion.report(),
            "iterations": sum(1 for record in self.history if record.iteration > 0),
            "converged": self.converged,
            "stop_reason": self.stop_reason,
            "seconds": dict(self.seconds),
            "torus": None if self.torus is None else {"R": self.torus.R, "r": self.torus.r},
            "versions": versions(),
            **self.extra_scalars(),
        }
        if history:
            out["history"] = [dataclasses.asdict(record) for record in self.history]
        return plain_dict(out)

    def to_json(self, history: bool = False, indent: int | None = 2) -> str:
        """:meth:`to_dict` as JSON text; what is not finite becomes ``null``."""
        indent = None if indent is None else whole("indent", indent, 0, 100)
        return json.dumps(self.to_dict(history), indent=indent, allow_nan=False)

    def summary(self) -> str:
        """A table of the scalars."""
        return table(summary_rows(self.to_dict()))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map to a file.

        Parameters
        ----------
        path : path-like
            ``.npz``: everything, for :func:`load_map`. ``.vtu``, ``.vtk``, ``.xdmf``: the source
            mesh; as point data ``image``, ``ring_ratio``, ``converged`` (0 or 1 in every row) and,
            on a torus, ``u``, ``v``, ``s`` with
            ``cos_u``, ``sin_u``, ``cos_v``, ``sin_v``, which have no seam where the angles start
            anew, and ``torus`` (R and r in every row); as cell data ``ratio``, of a refined mesh
            ``parent_tet`` or ``parent_face``, and of a solid on a torus the gradients and frames of
            :meth:`coordinate_field` (``grad_u``, ``grad_v``, ``grad_s``, ``along``, ``around``,
            ``radial``; zero on the core) with ``seam_u`` and ``seam_v``, 1 for tets across which
            the angle jumps; further the fields of the input. :func:`load_map` reads them,
            too. ``.obj`` of a surface with angles: the source with (u, v) in turns as texture
            coordinates. The other formats of :func:`stretchmap.write` get the image itself, of a
            solid where they can hold one and of its surface where not, with the fields of the
            input and ``ratio`` where they hold arrays.

        Raises
        ------
        FileFormatError
            If the suffix is not known or the format cannot hold the mesh.
        OSError
            If the file cannot be written.
        """
        path = as_path(path)
        if path.suffix.lower() == ".npz":
            d = self.distortion
            arrays = {"image": self.image, "ratios": d.ratios, "ring_ratios": d.ring_ratios}
            arrays |= self.extra_arrays()
            fields = {"point": self.point_fields, "cell": self.cell_fields}
            save_arrays(path, self.mesh, self.torus, arrays, fields, self.to_dict(history=True))
        else:
            write_map(path, self.as_cells(), self.mesh, self.image, self.angles)

    def as_cells(self) -> Cells:
        """The source with all fields of the map, as viewers and solvers take them."""
        d = self.distortion
        points: dict[str, NDArray[Any]] = {
            "image": self.image,
            "ring_ratio": d.ring_ratios,
            "converged": np.full(len(self.mesh.V), self.converged, np.int32),
            **self.point_fields,
        }
        cells = {"ratio": d.ratios, **self.cell_fields}
        return all_fields(self.mesh, self.torus, points, cells, self.extra_arrays())
