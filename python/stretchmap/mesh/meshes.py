"""Triangle and tet meshes: validated once at construction, immutable afterwards.

Points are ``(n, 3) float64``, faces ``(m, 3) int32``, tets ``(k, 4) int32``, all C-contiguous and
read-only. A tet is positively oriented when ``det(v1 - v0, v2 - v0, v3 - v0) > 0``; the faces of a
surface are when their normals point outward.
"""

from .solids import TetMesh
from .surfaces import TriMesh

__all__ = ["TetMesh", "TriMesh"]
