"""Refused before any work: an output in the place of an input or of another output."""

from __future__ import annotations

import functools
import os
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import OptionError

__all__ = ["Written", "keeping_inputs", "require_apart"]

Command = Callable[..., Any]


def _nothing(given: Mapping[str, Any]) -> Iterable[Path]:
    return ()


@dataclass(frozen=True)
class Written:
    """Marks the parameter of a command that names an output; all other paths are inputs.

    Attributes
    ----------
    further : callable
        Files and folders a command writes besides, or within an output that is a folder, from all
        it is given by name; of a folder everything in it.
    """

    further: Callable[[Mapping[str, Any]], Iterable[Path]] = _nothing


def keeping_inputs(command: Command) -> Command:
    """The command, which refuses to replace what it is given: `require_apart`."""

    @functools.wraps(command)
    def run(**given: Any) -> Any:
        require_apart(command, given)
        return command(**given)

    return run


def require_apart(command: Command, given: Mapping[str, Any]) -> None:
    """Refuse outputs that are inputs of the same call, or each other.

    Parameters
    ----------
    command : callable
        Its outputs are annotated by `Written`.
    given : mapping
        Its arguments by name.

    Raises
    ------
    OptionError
        Names the file that would be replaced.
    """
    hints = typing.get_type_hints(command, include_extras=True)
    marks = {
        name: mark
        for name, hint in hints.items()
        for mark in _metadata(hint)
        if isinstance(mark, Written) and given.get(name) is not None
    }
    outputs = [given[name] for name in marks]
    further = [path for mark in marks.values() for path in mark.further(given)]
    inputs = [
        file
        for name, value in given.items()
        if name not in marks and isinstance(value, Path)
        for file in _files(value)
    ]
    for i, output in enumerate(outputs):
        if any(_same(output, other) for other in (*inputs, *outputs[:i])):
            raise _would_be_replaced(output)
    for path in (*inputs, *outputs):
        if any(_within(path, other) for other in further):
            raise _would_be_replaced(path)


def _metadata(hint: Any) -> tuple[Any, ...]:
    """Of an annotation, also where a default of None has made it optional."""
    inner = [part for each in typing.get_args(hint) for part in getattr(each, "__metadata__", ())]
    return (*getattr(hint, "__metadata__", ()), *inner)


def _would_be_replaced(path: Path) -> OptionError:
    return OptionError(f"{path} would be replaced by the output; choose another name")


def _files(path: Path) -> list[Path]:
    """An input; of a folder what is read there, meshes and landmarks."""
    from ..io.formats import suffixes

    if not path.is_dir():
        return [path]
    read = (*suffixes(solid=False), ".csv")
    return [file for file in path.iterdir() if file.suffix.lower() in read and file.is_file()]


def _same(one: Path, other: Path) -> bool:
    """Whether both name one file, whatever links and capital letters lead there."""
    if os.path.realpath(one) == os.path.realpath(other):
        return True
    return one.exists() and other.exists() and os.path.samefile(one, other)


def _within(path: Path, place: Path) -> bool:
    """Whether it is that place, or in it where that is a folder."""
    full = Path(os.path.realpath(path))
    return any(_same(each, place) for each in (full, *full.parents))
