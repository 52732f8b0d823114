"""Tables of records, and their place in a document."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

Record = dict[str, Any]
_LONGEST = 160  # characters of a reason


def quantile(records: Iterable[Record], key: str, q: float) -> float:
    """Quantile of one figure over the records that have it; NaN without any."""
    values = [r[key] for r in records if r.get(key) is not None]
    return float(np.quantile(values, q)) if values else math.nan


def pair(key: str, q: float, form: str = ".3g") -> Callable[[list[Record]], str]:
    """A cell with the median and another quantile."""
    return lambda records: (
        f"{quantile(records, key, 0.5):{form}} / {quantile(records, key, q):{form}}"
    )


def count(key: str) -> Callable[[list[Record]], str]:
    """A cell with the number of records for which something holds."""
    return lambda records: str(sum(bool(r.get(key)) for r in records))


COLUMNS: dict[str, Callable[[list[Record]], str]] = {
    "cases": lambda records: str(len(records)),
    "certified": count("certified"),
    "converged": count("converged"),
    "killed": count("killed"),
    "elements": lambda records: f"{quantile(records, 'elements', 0.5):.0f}",
    "added tets, %": pair("added_percent", 0.95, ".2g"),
    "mean abs(ratio − 1)": pair("mean", 0.95),
    "SD": pair("sd", 0.95),
    "smallest ratio": pair("ratio_min", 0.05),
    "quasi-isometry": pair("quasi_isometry", 0.95),
    "µs per element": pair("microseconds_per_element", 0.95, ".0f"),
    "seconds": pair("seconds", 0.95, ".1f"),
    "MiB": pair("peak_mib", 0.95, ".0f"),
}
_SOLIDS_ONLY = ("added tets, %", "quasi-isometry")


def table(records: list[Record]) -> str:
    """One row per group, and one for all; medians and 95 % quantiles (5 % of smallest ratios)."""
    area = all(r["kind"] == "area" for r in records)
    names = [name for name in COLUMNS if not (area and name in _SOLIDS_ONLY)]
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record["group"], []).append(record)
    rows = [[group, *(COLUMNS[n](members) for n in names)] for group, members in groups.items()]
    if len(groups) > 1:
        rows.append(["all", *(COLUMNS[n](records) for n in names)])
    return markdown(["", *names], rows)


def reasons(records: list[Record]) -> str:
    """A row for each of the records, which are those that failed."""
    if not records:
        return "None.\n"
    rows = [[r["group"], r["name"], str(r.get("reason", ""))[:_LONGEST]] for r in records]
    return markdown(["", "seed or file", "reason"], rows)


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return (
        "\n".join(lines + ["| " + " | ".join(row).replace("\n", " ") + " |" for row in rows]) + "\n"
    )


def put(document: Path, section: str, text: str) -> None:
    """Replace what stands between the marks of a section in a document.

    Raises
    ------
    ValueError
        If the document has no such marks.
    """
    begin, end = f"<!-- {section} -->\n", f"<!-- end of {section} -->\n"
    whole = document.read_text()
    before, found, rest = whole.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{document} has no section {section!r}")
    document.write_text(before + begin + "\n" + text + "\n" + end + after)
