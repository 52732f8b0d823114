"""Solids of the families registered on copies of their own, deformed and remeshed, and back.

    python bench/robustness/copies.py
    python bench/robustness/copies.py --families bottles spiky --seeds 0:10 --write

A copy is stretched, waved and bent smoothly, without regard to volumes, and prepared anew with 0.7
to 1.4 times the faces. Records, limits and resumption as in `run`. Copies that lose their hole or
a tenth of their volume in preparation are left out, and named.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path
from typing import Any

import cases
import numpy as np
import pool
import report
from families import families
from numpy.typing import NDArray

import stretchmap as sm
from stretchmap.errors import StretchmapError

ROOT = Path(__file__).resolve().parents[2]
SEEDS = "4101:4104"
_LEAST_FACES = 800
_LOST = 0.1  # share of the volume
_NEEDLES = "stretched"  # isotropic triangles do not make a copy of what is a hundredth as thick


def deformed(points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Points (n, 3) of a solid, scaled to extent one, stretched, waved and bent."""
    x = (points - points.mean(axis=0)) / np.ptp(points, axis=0).max()
    x = x @ (np.eye(3) + 0.17 * rng.normal(size=(3, 3))).T
    for _ in range(4):
        wave, way = rng.normal(size=3), rng.normal(size=3)
        wave *= 2 * np.pi * rng.uniform(0.3, 1.0) / np.linalg.norm(wave)
        way *= 0.25 / np.linalg.norm(wave) / np.linalg.norm(way)
        x = x + np.sin(x @ wave + rng.uniform(0, 2 * np.pi))[:, None] * way
    radius = 1.0 / rng.uniform(0.2, 0.6)
    angle, rest = x[:, 0] / radius, radius - x[:, 1]
    return np.stack([np.sin(angle) * rest, radius - np.cos(angle) * rest, x[:, 2]], axis=1)


def copy_of(solid: sm.TetMesh, seed: int) -> sm.TetMesh:
    """A copy of another shape, with a mesh of its own.

    Raises
    ------
    ValueError
        If it is not the same solid any more.
    StretchmapError
        As `stretchmap.prepare`.
    """
    rng = np.random.default_rng([seed, 17])
    skin = solid.surface
    bent = sm.TriMesh(deformed(skin.V, rng), skin.F)
    n_faces = max(_LEAST_FACES, int(skin.n_faces * rng.uniform(0.7, 1.4)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        copy = sm.prepare(bent, faces=n_faces).solid
    if abs(copy.volume / bent.volume - 1.0) > _LOST:
        raise ValueError("preparation loses more than a tenth of the volume")
    return copy


def pair_of(name: str, seed: int, size: float) -> tuple[sm.TetMesh, sm.TetMesh]:
    """A solid of a family and its copy."""
    solid = families()[name].draw(seed, size)
    return solid, copy_of(solid, seed)


def files_of(name: str, seed: int, size: float, folder: Path) -> tuple[Path, Path] | None:
    """Both, drawn where they are not there; None, with the reason printed, if there is no copy."""
    files = tuple(folder / f"{name}_{seed}_{size:g}_{which}.npz" for which in ("solid", "copy"))
    if not all(file.exists() for file in files):
        try:
            pair = pair_of(name, seed, size)
        except (StretchmapError, ValueError) as error:
            print(f"{name} {seed} left out: {str(error).partition(':')[0]}")
            return None
        folder.mkdir(parents=True, exist_ok=True)
        for file, solid in zip(files, pair, strict=True):
            np.savez(file, V=solid.V, T=solid.T)
    return files[0], files[1]


def job_of(name: str, seed: int, files: tuple[Path, Path], back: bool, options: Any) -> dict:
    """What `register_task` has to know."""
    source, target = files[::-1] if back else files
    stem = options.out / "copies" / f"{name}_{seed}_{options.size:g}{'_back' if back else ''}"
    return {
        "kind": "register",
        "group": name,
        "name": f"{seed}{' back' if back else ''}",
        "seed": seed,
        "size": options.size,
        "mesh": str(source),
        "target": str(target),
        "landmarks": 0,
        "guide": "",
        "record": f"{stem}.json",
        "map": None,
        "per_element": 1e-3 * options.limit,
    }


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, and return 1 if a registration is not certified."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--families", nargs="*", default=[], choices=families(), metavar="NAME")
    parser.add_argument("--seeds", default=SEEDS, help="tune, report, all, a:b or a,b,c")
    parser.add_argument("--size", type=float, default=0.3, help="factor of the number of tets")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--limit", type=float, default=1.0, help="processor ms per element")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "robustness")
    parser.add_argument("--again", action="store_true", help="run also what has a record")
    parser.add_argument("--write", action="store_true", help="update the documentation")
    options = parser.parse_args(arguments)
    options.out = options.out.resolve()
    (options.out / "copies").mkdir(parents=True, exist_ok=True)
    jobs = []
    for name in options.families or [f for f in families() if f != _NEEDLES]:
        for seed in cases.seeds_of(options.seeds):
            files = files_of(name, seed, options.size, options.out / "meshes")
            if files is not None:
                jobs += [job_of(name, seed, files, back, options) for back in (False, True)]
    records = pool.run_all(
        [cases.Case(job["group"], job["name"], Path(job["mesh"])) for job in jobs],
        jobs,
        processes=options.jobs,
        threads=options.threads,
        script=Path(__file__).with_name("register_task.py"),
        again=options.again,
    )
    return report.finish(records, "copies" if options.write else None)


if __name__ == "__main__":
    sys.exit(main())
