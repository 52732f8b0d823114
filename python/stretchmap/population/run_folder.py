"""The folder of a run: made, or found to be that of this run."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..base.files import atomic_path
from ..errors import OptionError
from .shapes import Shape
from .task import map_file

__all__ = ["prepare_folder"]


def prepare_folder(folder: Path, settings: dict[str, Any], shapes: Sequence[Shape]) -> None:
    """Make the run folder, or check that it is of such a run.

    Shapes may be added, left out, and replaced as long as there is no map of them.

    Raises
    ------
    OptionError
        It is that of a run with other settings, or under the name of a shape it has the map of
        another.
    """
    for name in ("maps", "images", "records"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    path = folder / "run.json"
    known: dict[str, str] = {}
    if path.exists():
        before, known = _read(path)
        if before != settings:
            raise OptionError(f"{folder} holds a run with other settings, {before}; take another")
    digests = {shape.name: shape.digest() for shape in shapes if shape.is_there()}
    others = [
        name
        for name, digest in digests.items()
        if known.get(name, digest) != digest and map_file(folder, name, 0).exists()
    ]
    if others:
        more = ", ..." if len(others) > 5 else ""
        raise OptionError(
            f"{folder} holds a run of other shapes by the names of {', '.join(others[:5])}{more}, "
            "or with other landmarks; take another folder"
        )
    if known | digests != known or not path.exists():
        with atomic_path(path) as temporary:
            text = json.dumps(settings | {"shapes": known | digests}, indent=1)
            temporary.write_text(text, encoding="utf-8")


def _read(path: Path) -> tuple[dict[str, Any] | None, dict[str, str]]:
    """Settings of the run before, None where they cannot be read, and digests of its shapes."""
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
        shapes = before.pop("shapes")
        return before, dict(shapes)
    except (ValueError, KeyError, AttributeError, TypeError):
        return None, {}
