"""Pictures of maps. Every function returns a matplotlib Figure; none shows it.

Colors are those of viridis, cividis and Okabe and Ito, told apart by color-blind eyes and in grey
print. All functions take any map: a result of `volume_map`, `area_map`, `conformal_map` or
`register`, or one read by `load_map`. Statistics of a map, its boundary surface, the inside of a
solid and pairs of solids have a module each; ``_painting`` draws surfaces without a graphics card.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..base.options import as_path, one_of, real
from ..errors import FileFormatError, OptionError
from ..maps.given import as_map
from ..maps.result import Kind, MapResult
from ..mesh.meshes import TetMesh
from .comparisons import comparison, tradeoff
from .pairs import registration
from .solids import cutaway, levels
from .statistics import convergence, ratios
from .surfaces import checkerboard, domain, loops

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "KINDS",
    "Kind",
    "checkerboard",
    "comparison",
    "convergence",
    "cutaway",
    "domain",
    "kinds",
    "levels",
    "loops",
    "picture",
    "ratios",
    "registration",
    "save",
    "tradeoff",
]

KINDS: dict[Kind, Callable[..., Figure]] = {
    "checkerboard": checkerboard,
    "cutaway": cutaway,
    "levels": levels,
    "registration": registration,
    "loops": loops,
    "domain": domain,
    "ratios": ratios,
    "convergence": convergence,
}


def kinds(result: MapResult) -> tuple[Kind, ...]:
    """Kinds of pictures a map has data for, keys of ``KINDS``.

    Parameters
    ----------
    result : MapResult

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> import stretchmap as sm
    >>> sm.plot.kinds(sm.conformal_map(sm.samples.torus_surface(24, 12)))
    ('checkerboard', 'loops', 'domain', 'ratios')
    """
    result = as_map(result)
    solid, torus = isinstance(result.mesh, TetMesh), result.torus is not None
    lacking: dict[Kind, bool] = {
        "checkerboard": not torus,
        "domain": not torus,
        "cutaway": not solid,
        "levels": not (solid and torus),
        "registration": result.target is None,
        "convergence": not result.history,
    }
    return tuple(kind for kind in KINDS if not lacking.get(kind, False))


def picture(result: MapResult, kind: Kind, **options: Any) -> Figure:
    """Picture of a map by name.

    Parameters
    ----------
    result : MapResult
    kind : str
        A key of ``KINDS``; `kinds` names those the map has data for.
    **options
        Those of the function of that name.

    Returns
    -------
    matplotlib.figure.Figure

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.conformal_map(sm.samples.torus_surface(24, 12))
    >>> len(sm.plot.picture(result, "checkerboard", cells=(12, 6)).axes)
    2

    Raises
    ------
    OptionError
        Unknown kind, or an option it does not have.
    MeshError, OptionError
        As the function.
    """
    if not isinstance(kind, str) or kind not in KINDS:
        # Those of this map; asked for one of another map's, the function says what it lacks.
        one_of("kind", kind, kinds(result))
    for option in options:
        if option not in inspect.signature(KINDS[kind]).parameters:
            raise OptionError(f"a picture of kind {kind!r} has no option {option!r}")
    return KINDS[kind](result, **options)


def save(figure: Figure, path: str | os.PathLike[str], dpi: float = 150.0) -> None:
    """Write a figure to a file that appears whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path-like
        ``.png``, ``.pdf`` or ``.svg``.
    dpi : float
        Dots per inch, at most 2400.

    Raises
    ------
    OptionError
        It is no figure, or the resolution out of range.
    FileFormatError
        Another suffix.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> figure = sm.plot.loops(sm.samples.torus_surface(24, 12))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sm.plot.save(figure, os.path.join(folder, "loops.png"))
    ...     os.listdir(folder)
    ['loops.png']
    """
    from ..base.files import atomic_path

    path, dpi = as_path(path), real("dpi", dpi, 1.0, 2400.0)
    if not callable(getattr(figure, "savefig", None)):
        raise OptionError(f"a matplotlib Figure is saved here, not a {type(figure).__name__}")
    if path.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise FileFormatError(f"{path}: pictures are .png, .pdf or .svg")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi)
