"""The cube every file of the corpus holds."""

from __future__ import annotations

import numpy as np

POINTS = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
QUADS = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
TRIANGLES = [[q[0], q[k], q[k + 1]] for q in QUADS for k in (1, 2)]
MIXED = [*QUADS[:3], *TRIANGLES[6:]]
