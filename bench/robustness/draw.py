"""Draw random solids and write them to files.

    python bench/robustness/draw.py spiky 0 1 2 --out meshes [--size 0.5]

Writes meshes/spiky_0.npz and so on, `V` (n, 3) and `T` (k, 4).
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from families import families


def main(arguments: list[str] | None = None) -> int:
    """Write the files named."""
    known = families()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("family", choices=known)
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--out", type=Path, default=Path())
    parser.add_argument("--file", type=Path, help="of a single seed, instead of a folder")
    parser.add_argument("--size", type=float, default=1.0, help="factor of the number of tets")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in options.seeds:
        solid = known[options.family].draw(seed, options.size)
        path = options.file or options.out / f"{options.family}_{seed}.npz"
        temporary = path.with_name(f".{os.getpid()}_{path.name}")
        np.savez(temporary, V=solid.V, T=solid.T)
        os.replace(temporary, path)
        print(f"{path}: {solid.n_tets} tets", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
