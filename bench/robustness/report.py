"""Tables of records, and their place in a document."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

Record = dict[str, Any]
_LONGEST = 160  # characters of a reason
_DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "robustness.md"


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


# Heading -> the figure it is about and the cell; columns about what no record has are left out.
COLUMNS: dict[str, tuple[str, Callable[[list[Record]], str]]] = {
    "cases": ("name", lambda records: str(len(records))),
    "certified": ("certified", count("certified")),
    "converged": ("converged", count("converged")),
    "killed": ("killed", count("killed")),
    "elements": ("elements", lambda records: f"{quantile(records, 'elements', 0.5):.0f}"),
    "added tets, %": ("added_percent", pair("added_percent", 0.95, ".2g")),
    "mean abs(ratio − 1)": ("mean", pair("mean", 0.95)),
    "SD": ("sd", pair("sd", 0.95)),
    "smallest ratio": ("ratio_min", pair("ratio_min", 0.05)),
    "quasi-isometry": ("quasi_isometry", pair("quasi_isometry", 0.95)),
    "landmark error": ("landmark_error", pair("landmark_error", 1.0, ".1g")),
    "µs per element": ("microseconds_per_element", pair("microseconds_per_element", 0.95, ".0f")),
    "seconds": ("seconds", pair("seconds", 0.95, ".1f")),
    "MiB": ("peak_mib", pair("peak_mib", 0.95, ".0f")),
}


def table(records: list[Record]) -> str:
    """One row per group, and one for all; medians and 95 % quantiles (5 % of smallest ratios)."""
    names = [n for n, (key, _) in COLUMNS.items() if any(key in r for r in records)]
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record["group"], []).append(record)
    if len(groups) > 1:
        groups["all"] = records
    cells = [[group, *(COLUMNS[n][1](members) for n in names)] for group, members in groups.items()]
    return markdown(["", *names], cells)


def reasons(records: list[Record]) -> str:
    """A row for each of the records, which are those that failed."""
    if not records:
        return "None.\n"
    rows = [[r["group"], r["name"], str(r.get("reason", ""))[:_LONGEST]] for r in records]
    return markdown(["", "seed or file", "reason"], rows)


def finish(records: list[Record], section: str | None) -> int:
    """Print the table and what is not certified, put both into a section of the documentation if
    there is one, and return 1 if anything is not."""
    failed = [r for r in records if not r["certified"]]
    text = f"{table(records)}\nNot certified:\n\n{reasons(failed)}"
    print(text)
    if section is not None:
        put(_DOCUMENT, section, text)
    return int(bool(failed))


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
