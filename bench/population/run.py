"""Real vertebrae to a mean and its modes: generalization and specificity in the unit of the files.

python bench/population/run.py                       # nine lumbar vertebrae, from three sources
python bench/population/run.py --sets vhm --out build/population/vhm
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

import stretchmap as sm
from stretchmap.plot.population_report import write_population_report

SETS = {
    "vhm": [f"vertebra_L{k}_vhm" for k in (1, 2, 3, 4)],
    "ssm": [f"vertebra_L{k}_ssm_16420" for k in (2, 3, 4, 5)],
    "tdem": ["vertebra_tdem"],
}
MESHES = Path(os.environ.get("STRETCHMAP_MESHES", "../shared/meshes"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", nargs="+", default=list(SETS), choices=SETS)
    parser.add_argument("--out", type=Path, default=Path("build/population/all"))
    parser.add_argument("--start", help="name of the first template")
    parser.add_argument("--along", default="smooth", choices=("smooth", "area"))
    parser.add_argument("--executor", default="serial")
    parser.add_argument("--rounds", type=int, default=4)
    options = parser.parse_args()
    solids = options.out / "solids"
    solids.mkdir(parents=True, exist_ok=True)
    for name in (name for group in options.sets for name in SETS[group]):
        path = solids / f"{name}.npz"
        if not path.exists():
            surface = sm.read_surface(MESHES / "surfaces" / f"{name}.ply")
            sm.write(path, sm.tetrahedralize(surface))
    found = sm.population.fit(
        solids, options.start, folder=options.out / f"run-{options.along}", scale=False,
        along=options.along, executor=options.executor, max_rounds=options.rounds,
    )  # fmt: skip
    print(found.summary())
    size = float(np.linalg.norm(np.ptp(found.mean.V, axis=0)))
    print(f"size of the mean {size:.2f}; distances below in the unit of the files")
    print("shape                     tets  along   distance    seconds  volume ratio SD")
    for r in found.records:
        if r["ok"]:
            fit = "-" if r["distance"] is None else f"{r['distance'] * size:.3f}"
            print(f"{r['name']:24} {r['n_tets']:6d}  {r['along']:6} {fit:>9}  {r['seconds']:9.1f}"
                  f"  {r['volume_ratio_std']:.3f}  {r['note'][:60]}")  # fmt: skip
        else:
            print(f"{r['name']:24} skipped: {r['error']}")
    print("modes  compactness  generalization  specificity")
    m = found.measures
    for k in range(len(m.compactness)):
        left = f"{m.generalization[k].mean():.3f}" if k < len(m.generalization) else "-"
        print(f"{k:5d}  {m.compactness[k]:11.3f}  {left:>14}  {m.specificity[k].mean():11.3f}")
    found.save(options.out / "population.npz")
    write_population_report(found, options.out / "report.html", "of lumbar vertebrae")


if __name__ == "__main__":
    main()
