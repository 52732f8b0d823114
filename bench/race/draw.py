"""The picture of the race and its table, from its rows: python bench/race/draw.py"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
COLORS = ("#0072B2", "#D55E00", "#009E73", "#000000")
STYLES = ("-", "--", "-.", ":")
LEAST_GAP = 1e-9  # relative to the least energy anyone reached


def curve(points: list[dict[str, float]], key: str) -> tuple[list[float], list[float]]:
    """Times and values up to the last finite one."""
    kept = [point for point in points if point[key] < float("inf")]
    return [max(point["seconds"], 1e-3) for point in kept], [point[key] for point in kept]


def draw(rows: dict[str, dict[str, list[dict[str, float]]]], path: Path) -> None:
    """One row of two panels for each solid: energy above the least found, and the worst tet."""
    figure = Figure(figsize=(10.0, 3.6 * len(rows)), layout="constrained")
    panels: Any = figure.subplots(len(rows), 2, squeeze=False)
    for (title, methods), (left, right) in zip(rows.items(), panels, strict=True):
        least = min(point["energy"] for points in methods.values() for point in points)
        for (name, points), color, style in zip(methods.items(), COLORS, STYLES, strict=False):
            seconds, energy = curve(points, "energy")
            gaps = [max(value / least - 1.0, LEAST_GAP) for value in energy]
            left.loglog(seconds, gaps, style, color=color, label=name)
            right.loglog(*curve(points, "worst"), style, color=color, label=name)
        left.set(title=title, ylabel="energy over the least found, minus 1")
        right.set(title="worst tet", ylabel="its energy over its share of the volume")
        for axes in (left, right):
            axes.set_xlabel("processor time / s")
            axes.grid(alpha=0.3)
    panels[0][0].legend(fontsize="small")
    figure.savefig(path, dpi=100)


def table(rows: dict[str, dict[str, list[dict[str, float]]]], near: float = 1e-6) -> str:
    """Seconds and steps until the energy is as near to the least found."""
    titles = [title.split(",")[0] for title in rows]
    lines = [
        "| method | " + " | ".join(f"{title}, s | steps" for title in titles) + " |",
        "|---|" + "---|---|" * len(rows),
    ]
    for name in next(iter(rows.values())):
        cells = []
        for methods in rows.values():
            least = min(point["energy"] for points in methods.values() for point in points)
            reached = (i for i, p in enumerate(methods[name]) if p["energy"] <= (1 + near) * least)
            step = next(reached, None)
            cells += ["-", "-"] if step is None else [f"{methods[name][step]['seconds']:.2f}", step]
        lines.append(f"| {name} | " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    found = json.loads((HERE / "rows.json").read_text("utf-8"))
    draw(found, HERE.parents[1] / "docs" / "race.png")
    print(table(found))
