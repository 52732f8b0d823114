"""A sample mapped by an installed stretchmap that needs only NumPy and SciPy: run it by itself.

Every wheel passes this before it is published.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import stretchmap as sm


def main() -> int:
    """Map a sample, save it, certify what was saved."""
    solid = sm.samples.vertebra_like(3000)
    result = sm.volume_map(solid)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.npz"
        result.save(path)
        certificate = sm.certify_file(path)
    print(f"stretchmap {sm.__version__}, Python {sys.version.split()[0]}: {result.stop_reason}")
    return 0 if certificate.certified and result.distortion.flips == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
