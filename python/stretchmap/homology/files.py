"""The file of a homology basis."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ..base.files import atomic_path
from ..base.options import as_path
from ..errors import FileFormatError
from ..io.npz import save_npz

if TYPE_CHECKING:
    from .loops import HomologyBasis

__all__ = ["save_basis"]


def save_basis(basis: HomologyBasis, path: str | os.PathLike[str]) -> None:
    """As `HomologyBasis.save`."""
    path = as_path(path)
    if path.suffix.lower() != ".npz":
        raise FileFormatError(f"{path}: loops and forms are written as .npz")
    surface = basis.surface
    arrays: dict[str, NDArray[Any]] = {"V": surface.V, "F": surface.F, "edges": surface.edges}
    arrays["dual_forms"] = basis.dual_forms
    families = {"generator": basis.generators, "handle": basis.handle_loops}
    if basis.tunnel_classes is not None:
        families["tunnel"] = basis.tunnel_loops
    for name, loops in families.items():
        arrays.update({f"{name}_{i}": loop for i, loop in enumerate(loops)})
    if basis.genus == 1:
        arrays.update(meridian=basis.meridian, longitude=basis.longitude)
        arrays["torus_forms"] = basis.torus_forms
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        save_npz(file, arrays)
