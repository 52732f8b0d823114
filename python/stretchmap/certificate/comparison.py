"""Several maps of one mesh side by side: a method of one's own against others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from ..base.arrays import as_reals
from ..base.tables import HasSummary, cell, plain_dict
from ..base.torus import Torus
from ..errors import OptionError
from ..maps.result import MapResult
from ..measures.elements import Distortion, distortion
from ..mesh.given import as_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .checks import certify
from .findings import Certificate

__all__ = ["Comparison", "compare"]

# Figures of the table: heading, and how it comes from distortion and certificate.
_COLUMNS: dict[str, Callable[[Distortion, Certificate], object]] = {
    "certified": lambda d, c: c.certified,
    "flips": lambda d, c: d.flips,
    "ring std": lambda d, c: d.ring_std,
    "total distortion": lambda d, c: d.total_distortion,
    "mean |ratio - 1|": lambda d, c: d.element_error_mean,
    "smallest ratio": lambda d, c: d.ratio_min,
    "angle mean": lambda d, c: d.angle_mean,
}


@dataclass(frozen=True, eq=False)
class Comparison(HasSummary):
    """Maps of one mesh side by side.

    Attributes
    ----------
    mesh : TriMesh or TetMesh
        What was mapped; a map that refined it is measured on its refinement.
    distortion : dict of Distortion
        By the names of the maps.
    certificate : dict of Certificate

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.compare(solid, {"as it is": solid.V, "mirrored": -solid.V})
    >>> [found.certificate[name].certified for name in found.distortion]
    [True, False]
    """

    mesh: TriMesh | TetMesh = field(repr=False)
    distortion: Mapping[str, Distortion]
    certificate: Mapping[str, Certificate]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(self.distortion)})"

    def rows(self) -> dict[str, dict[str, Any]]:
        """By map the figures of the table, by their headings."""
        return {
            name: {
                heading: figure(found, self.certificate[name])
                for heading, figure in _COLUMNS.items()
            }
            for name, found in self.distortion.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """All scalars, JSON-compatible."""
        return plain_dict(
            {
                name: found.to_dict()
                | {
                    "certified": self.certificate[name].certified,
                    "reason": self.certificate[name].reason,
                }
                for name, found in self.distortion.items()
            }
        )

    def summary(self) -> str:
        """A table, one row per map."""
        lines = [["", *_COLUMNS]]
        lines += [[name, *map(cell, row.values())] for name, row in self.rows().items()]
        widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
        return "\n".join(
            "  ".join(
                text.ljust(width) if k == 0 else text.rjust(width)
                for k, (text, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )


def compare(
    mesh: TriMesh | TetMesh,
    images: Mapping[str, ArrayLike | MapResult],
    *,
    torus: Torus | None = None,
) -> Comparison:
    """Measure and certify several maps of one mesh, whoever made them.

    Parameters
    ----------
    mesh : TriMesh or TetMesh
    images : dict
        By name the images (n, 3) of the vertices of ``mesh``, or results of `volume_map`,
        `area_map`, `load_map` and so on; these bring their own mesh (a refinement of ``mesh``) and
        torus.
    torus : Torus, optional
        What boundary images given as arrays lie on, if they do; as in `certify`.

    Returns
    -------
    Comparison
        With ``distortion`` and ``certificate`` by name and ``summary()``; drawn by
        ``stretchmap.plot.comparison``.

    Raises
    ------
    OptionError
        There is nothing to compare, or a result is of another mesh.
    ArrayError, MeshError
        As `distortion` and `certify`.

    Notes
    -----
    Measures (6.1) to (6.5) of Yueh, Li, Lin, Yau (2020) and those of single elements.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.bumpy_torus(1500)
    >>> found = sm.compare(solid, {"identity": solid.V, "certified": sm.volume_map(solid)})
    >>> found.certificate["certified"].certified
    True
    >>> found.distortion["identity"].flips
    0
    """
    mesh = as_mesh(mesh)
    if not isinstance(images, Mapping) or not images:
        raise OptionError("images must be a dict with at least one image or map, by name")
    distortions, certificates = {}, {}
    for name, image in images.items():
        if not isinstance(name, str):
            raise OptionError(f"images must go by names, and {name!r} is not a str")
        if isinstance(image, MapResult):
            own = image.mesh
            n = mesh.n_vertices
            if type(own) is not type(mesh) or not (
                own.n_vertices >= n and (own.V[:n] == mesh.V).all()
            ):
                raise OptionError(f"the map {name!r} is of another mesh")
            distortions[name] = image.distortion
            certificates[name] = certify(own, image.image, image.torus)
        else:
            image = as_reals(image, f"images[{name!r}]", mesh.V.shape)
            distortions[name] = distortion(mesh, image, torus=torus)
            certificates[name] = certify(mesh, image, torus)
    return Comparison(mesh, distortions, certificates)
