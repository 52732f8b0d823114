"""The scalars of a map file: JSON that is what it should be, or a `FileFormatError`."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

from numpy.typing import NDArray

from ..errors import FileFormatError
from .history import NAN, IterationRecord

__all__ = ["read_history", "read_meta", "summary_rows"]

_DEEPEST = 20  # lists and objects within each other
# Fields of records that files of version 0.1 call otherwise.
_NAMES_OF_0_1 = {"ring_sd": "ring_std", "element_sd": "element_std"}
_COUNTS = "added_vertices", "boundary_splits"
_KINDS: dict[str, tuple[type, ...]] = {"stage": (str,), "iteration": (int,), "flips": (int,)}


def read_meta(meta: NDArray[Any] | None) -> dict[str, Any]:
    """The entries of ``meta``; empty without it.

    Raises
    ------
    FileFormatError
        It is no JSON object, or an entry that results have is of another kind than theirs.
    """
    if meta is None:
        return {}
    if meta.ndim or meta.dtype.kind != "U":
        raise FileFormatError("meta is not a text")
    try:
        value = json.loads(str(meta), parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"meta is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise FileFormatError("meta is not a JSON object")
    _check_depth(value)
    for name, kind in (("kind", str), ("stop_reason", str), ("converged", bool), ("history", list)):
        if name in value and not isinstance(value[name], kind):
            raise FileFormatError(f"{name} in meta is not of type {kind.__name__}")
    for name in _COUNTS:
        count = value.get(name, 0)
        if isinstance(count, bool) or not isinstance(count, int) or count < 0:
            raise FileFormatError(f"{name} in meta is no number of vertices: {count!r:.40}")
    seconds = value.get("seconds", {})
    if not isinstance(seconds, dict) or not all(_is_number(x) for x in seconds.values()):
        raise FileFormatError("seconds in meta are not numbers by stage")
    return value


def read_history(meta: dict[str, Any]) -> tuple[IterationRecord, ...]:
    """The records in ``meta``.

    Raises
    ------
    FileFormatError
        They are none.
    """
    return tuple(_record(entry) for entry in meta.get("history", []))


def _record(entry: Any) -> IterationRecord:
    if not isinstance(entry, dict):
        raise FileFormatError("the history in meta holds something else than records")
    values = {_NAMES_OF_0_1.get(name, name): value for name, value in entry.items()}
    record: dict[str, Any] = {}
    for name in (f.name for f in dataclasses.fields(IterationRecord)):
        if name not in values:
            raise FileFormatError(f"a record of the history in meta has no {name}")
        value = values[name]
        kinds = _KINDS.get(name)
        if kinds is None:
            sound = value is None or _is_number(value)
            value = NAN if value is None else value
        else:
            sound = isinstance(value, kinds) and not isinstance(value, bool)
        if not sound:
            raise FileFormatError(f"{name} of a record of the history in meta is {value!r:.40}")
        record[name] = value
    return IterationRecord(**record)


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return (isinstance(value, int) and abs(value) < 2**63) or (
        isinstance(value, float) and math.isfinite(value)
    )


def _no_number(word: str) -> None:
    raise ValueError(f"{word} is no number of JSON")


def _check_depth(value: Any) -> None:
    level = [value]
    for _ in range(_DEEPEST):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, (dict, list))
        ]
        if not level:
            return
    raise FileFormatError(f"meta holds lists within lists more than {_DEEPEST} deep")


def summary_rows(report: dict[str, Any]) -> dict[str, Any]:
    """The entries of a map's report that its summary shows, one to a row."""
    rows = {k: v for k, v in report.items() if k not in ("seconds", "versions", "certificate")}
    torus, certificate = rows.pop("torus"), report.get("certificate")
    if torus is not None:
        rows["torus"] = f"R = {torus['R']:.6g}, r = {torus['r']:.6g}"
    if certificate is not None and not certificate["certified"]:
        rows["certified"] = f"no: {certificate['reason']}"
    return rows | {f"seconds, {stage}": value for stage, value in report["seconds"].items()}
