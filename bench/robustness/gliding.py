"""All ordered pairs of nine vertebrae, the boundary held where it was matched, and gliding.

    python bench/robustness/gliding.py ../shared/meshes/surfaces
    python bench/robustness/gliding.py ../shared/meshes/surfaces --only L1_vhm --write

A record and a map are kept per pair and way; what has a record is not run again. Where both
directions of a pair are there, their inverse consistency is printed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import report
from registrations import ROOT, solids
from task import load, write_json

import stretchmap as sm

WAYS = ("frozen", "glide")


def measured(files: dict[str, Path], pair: tuple[str, str], way: str, out: Path) -> dict[str, Any]:
    """The record of a pair, made unless it is there."""
    stem = out / f"{pair[0]}-{pair[1]}-{way}"
    record = stem.with_suffix(".json")
    if not record.exists():
        source, target = (load(str(files[name])) for name in pair)
        clock, processor = time.perf_counter(), time.process_time()
        result = sm.register(source, target, boundary=way, keep_best=True)
        seconds, used = time.perf_counter() - clock, time.process_time() - processor
        result.save(stem.with_suffix(".npz"))
        found = result.distortion
        write_json(
            record,
            {
                "pair": f"{pair[0]} to {pair[1]}",
                "asked": way,
                "boundary": result.boundary,
                "tets": source.n_tets,
                "certified": bool(result.certificate.certified),
                "flips": int(found.flips),
                "ring_std": found.ring_std,
                "total_distortion": found.total_distortion,
                "element_std": found.element_std,
                "surface_distance": result.surface_distance,
                "volume": found.image_total / target.volume,
                "seconds": seconds,
                "processor_seconds": used,
            },
        )
    return json.loads(record.read_text())


def consistency(pairs: list[tuple[str, str]], way: str, out: Path) -> np.ndarray:
    """Median, 95 % and largest distance after there and back, one row per pair done both ways."""
    rows = []
    for pair in pairs:
        files = [out / f"{a}-{b}-{way}.npz" for a, b in (pair, pair[::-1])]
        if all(file.exists() for file in files):
            there, back = (sm.load_map(file) for file in files)
            rows.append(np.nanpercentile(sm.inverse_consistency(there, back), [50, 95, 100]))
    return np.array(rows).reshape(-1, 3)


def table(records: dict[str, list[dict[str, Any]]]) -> str:
    """A row per pair, then the quartiles."""
    columns = [("ring_std", ".4f"), ("total_distortion", ".4f"), ("element_std", ".3f"),
               ("surface_distance", ".3f"), ("processor_seconds", ".1f")]  # fmt: skip
    words = ["ratio SD", "D_volume", "tet ratio SD", "distance", "processor s"]
    rows = []
    for both in zip(*(records[way] for way in WAYS), strict=True):
        sure = "yes" if both[1]["certified"] else f"no: {both[1]['flips']} flips"
        cells = [both[1]["pair"], sure, both[1]["boundary"]]
        for key, form in columns:
            cells += [format(r[key], form) for r in both]
        rows.append(cells)
    for name, share in (("median", 50), ("90 %", 90), ("worst", 100)):
        cells = [name, "", ""]
        for key, form in columns:
            cells += [
                format(np.percentile([r[key] for r in records[way]], share), form) for way in WAYS
            ]
        rows.append(cells)
    head = ["pair", "certified", "boundary"]
    for word in words:
        head += [f"{word}, held", "gliding"]
    return report.markdown(head, rows)


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, and return 1 if a registration is not certified."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of the vertebra surfaces")
    parser.add_argument("--only", default="", help="pairs whose name contains this")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "robustness")
    parser.add_argument("--write", action="store_true", help="update the documentation")
    parser.add_argument("--done", action="store_true", help="only what has its records")
    options = parser.parse_args(arguments)
    files = solids(options.folder, options.out)
    out = options.out / "gliding"
    out.mkdir(parents=True, exist_ok=True)
    pairs = [p for p in permutations(files, 2) if options.only in f"{p[0]} to {p[1]}"]
    if options.done:
        pairs = [p for p in pairs if all((out / f"{p[0]}-{p[1]}-{w}.json").exists() for w in WAYS)]
    records: dict[str, list[dict[str, Any]]] = {way: [] for way in WAYS}
    for pair in pairs:
        for way in WAYS:
            found = measured(files, pair, way, out)
            records[way].append(found)
            print(
                f"{found['pair']:32} {found['boundary']:6} certified {found['certified']} ratio SD "
                f"{found['ring_std']:.4f} D_volume {found['total_distortion']:.4f} processor s "
                f"{found['processor_seconds']:.1f}",
                flush=True,
            )
    text = f"{len(pairs)} of {len(files) * (len(files) - 1)} pairs.\n\n{table(records)}"
    for way in WAYS:
        rows = consistency(pairs, way, out)
        if len(rows):
            middle = 100.0 * np.median(rows, axis=0)
            text += (
                f"\nThere and back, boundary {way}: median {middle[0]:.2f} %, 95 % {middle[1]:.2f} "
                f"%, worst {middle[2]:.1f} % of the size (medians of {len(rows)} pairs).\n"
            )
    print(text)
    if options.write:
        report.put(ROOT / "docs" / "results.md", "gliding", text)
    return int(not all(r["certified"] for r in records["glide"]))


if __name__ == "__main__":
    sys.exit(main())
