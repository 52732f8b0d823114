"""Sound files of every format that is read, what reads them, and what their headers announce."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from announced import (
    Counts,
    mesh_counts,
    msh_counts,
    npz_counts,
    obj_counts,
    off_counts,
    ply_counts,
    stl_counts,
    vtk_counts,
    vtu_counts,
)  # fmt: skip

import stretchmap as sm
from stretchmap.io import read_arrays
from stretchmap.io.numbers import read_numbers
from stretchmap.preparation.voxels import mask_surface, read_mask


@dataclass(frozen=True)
class Format:
    """How a file of a format is made, read and understood without its reader."""

    suffix: str
    make: Callable[[Path], None]
    read: Callable[[Path], Any]
    announced: Callable[[bytes], Counts] = lambda data: (None, None)


def _surface() -> sm.TriMesh:
    return sm.samples.torus_surface(8, 6)


def _solid() -> sm.TetMesh:
    return sm.samples.solid_torus(400)


def _written(**fields: Any) -> Callable[[Path], None]:
    """Written by the package."""

    def make(path: Path) -> None:
        mesh = _solid() if fields.get("solid") else _surface()
        data = fields.get("data", False)
        sm.write(
            path,
            mesh,
            point_data={"height": mesh.V[:, 2]} if data else None,
            cell_data={"region": np.arange(len(_elements(mesh)))} if data else None,
            corner_uv=np.zeros((mesh.n_faces, 3, 2)) if fields.get("uv") else None,
        )

    return make


def _elements(mesh: sm.TriMesh | sm.TetMesh) -> Any:
    return mesh.T if isinstance(mesh, sm.TetMesh) else mesh.F


def _by_meshio(name: str, **options: Any) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        import meshio

        solid = _solid()
        regions = np.arange(solid.n_tets, dtype=np.int32)
        mesh = meshio.Mesh(
            solid.V,
            [("tetra", solid.T)],
            # As text, meshio writes data of this format with names of types among the numbers.
            point_data={} if name.startswith("gmsh") else {"height": solid.V[:, 2]},
            cell_data={f"gmsh:{word}": [regions] for word in ("physical", "geometrical")}
            if name.startswith("gmsh")
            else {"region": [regions]},
        )
        mesh.write(path, file_format=name, **options)

    return make


def _by_pyvista(path: Path) -> None:
    _surface().to_pyvista().save(path)


def _by_trimesh(path: Path) -> None:
    _surface().to_trimesh().export(path)


def _text(make_text: Callable[[], str]) -> Callable[[Path], None]:
    return lambda path: path.write_text(make_text()) and None


def _text_ply() -> str:
    torus = _surface()
    head = f"ply\nformat ascii 1.0\nelement vertex {torus.n_vertices}\n"
    head += "property float x\nproperty float y\nproperty float z\nproperty uchar red\n"
    head += f"element face {torus.n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [f"{x:.6g} {y:.6g} {z:.6g} 7" for x, y, z in torus.V.tolist()]
    rows += ["3 " + " ".join(map(str, face)) for face in torus.F.tolist()]
    return head + "\n".join(rows) + "\n"


def _text_stl() -> str:
    torus = _surface()
    return (
        "solid t\n"
        + "".join(
            "facet normal 0 0 0\n outer loop\n"
            + "".join(f"  vertex {x:.6g} {y:.6g} {z:.6g}\n" for x, y, z in corners)
            + " endloop\nendfacet\n"
            for corners in torus.V[torus.F].tolist()
        )
        + "endsolid t\n"
    )


def _big_endian_ply(path: Path) -> None:
    torus = _surface()
    head = f"ply\nformat binary_big_endian 1.0\nelement vertex {torus.n_vertices}\n"
    head += "property double x\nproperty double y\nproperty double z\n"
    head += f"element face {torus.n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    face = np.zeros(torus.n_faces, [("n", "u1"), ("ids", ">i4", 3)])
    face["n"], face["ids"] = 3, torus.F
    path.write_bytes(head.encode() + torus.V.astype(">f8").tobytes() + face.tobytes())


def _numbers(path: Path) -> None:
    np.savetxt(path, _surface().V[:20], "%.6g", ",", header="x, y, z")


def _mask(path: Path) -> None:
    mask = np.zeros((8, 8, 5), np.uint8)
    mask[1:7, 1:7, 1:4] = 1
    mask[3:5, 3:5] = 0
    if path.suffix == ".npy":
        np.save(path, mask)
    else:
        np.savez(path, mask=mask, spacing=[0.5, 0.5, 1.0])


def _map(path: Path) -> None:
    """The map of a surface; read as the commands do, which look at all of it."""
    sm.conformal_map(_surface()).save(path)


def _map_of_solid(path: Path) -> None:
    solid = _solid()
    ids = np.arange(solid.n_tets)
    np.savez(path, V=solid.V, T=solid.T, image=2.0 * solid.V, torus=[3.0, 1.0], parent_tet=ids)


def _map_for_viewers(path: Path) -> None:
    archive = path.with_suffix(".npz")
    _map_of_solid(archive)
    sm.load_map(archive).save(path)


def _read_map(path: Path) -> Any:
    loaded = sm.load_map(path)
    loaded.summary()
    loaded.to_json(history=True)
    sm.certify_file(path)
    return loaded.mesh


def _read_mesh(path: Path) -> Any:
    read_arrays(path)
    return sm.read(path)


def _read_mask(path: Path) -> Any:
    mask, affine = read_mask(path)
    if mask.size > 10**6:
        raise RuntimeError("a mask larger than its file")
    return sm.TriMesh(*mask_surface(mask, np.eye(4) if affine is None else affine)[:2])


def _read_numbers(path: Path) -> Any:
    assert np.isfinite(read_numbers(path, {3: "x, y, z"})).all()


FORMATS: dict[str, Format] = {
    "obj": Format(".obj", _written(), _read_mesh, obj_counts),
    "obj texture": Format(".obj", _written(uv=True), _read_mesh, obj_counts),
    "off": Format(".off", _written(), _read_mesh, off_counts),
    "ply": Format(".ply", _written(data=True), _read_mesh, ply_counts),
    "ply text": Format(".ply", _text(_text_ply), _read_mesh, ply_counts),
    "ply big endian": Format(".ply", _big_endian_ply, _read_mesh, ply_counts),
    "stl": Format(".stl", _written(), _read_mesh, stl_counts),
    "stl text": Format(".stl", _text(_text_stl), _read_mesh, stl_counts),
    "npz": Format(".npz", _written(data=True), _read_mesh, npz_counts),
    "npz solid": Format(".npz", _written(data=True, solid=True), _read_mesh, npz_counts),
    "msh 2 text": Format(".msh", _by_meshio("gmsh22", binary=False), _read_mesh, msh_counts),
    "msh 2": Format(".msh", _by_meshio("gmsh22", binary=True), _read_mesh, msh_counts),
    "msh 4 text": Format(".msh", _by_meshio("gmsh", binary=False), _read_mesh),
    "msh 4": Format(".msh", _by_meshio("gmsh", binary=True), _read_mesh),
    "vtk text": Format(".vtk", _by_meshio("vtk42", binary=False), _read_mesh, vtk_counts),
    "vtk": Format(".vtk", _by_meshio("vtk42", binary=True), _read_mesh, vtk_counts),
    "vtk 5": Format(".vtk", _by_meshio("vtk51", binary=True), _read_mesh, vtk_counts),
    "vtu": Format(".vtu", _by_meshio("vtu"), _read_mesh, vtu_counts),
    "vtu text": Format(".vtu", _by_meshio("vtu", binary=False), _read_mesh, vtu_counts),
    "mesh": Format(".mesh", _written(solid=True), _read_mesh, mesh_counts),
    "xdmf": Format(".xdmf", _written(solid=True, data=True), _read_mesh),
    "vtp": Format(".vtp", _by_pyvista, _read_mesh),
    "vtk of a surface": Format(".vtk", _by_pyvista, _read_mesh),
    "glb": Format(".glb", _by_trimesh, _read_mesh),
    "map": Format(".npz", _map, _read_map, npz_counts),
    "map of a solid": Format(".npz", _map_of_solid, _read_map, npz_counts),
    "vtu map": Format(".vtu", _map_for_viewers, _read_map, vtu_counts),
    "vtk map": Format(".vtk", _map_for_viewers, _read_map, vtk_counts),
    "xdmf map": Format(".xdmf", _map_for_viewers, _read_map),
    "mask": Format(".npy", _mask, _read_mask),
    "mask archive": Format(".npz", _mask, _read_mask),
    "numbers": Format(".csv", _numbers, _read_numbers),
}


# Packages without which there is no sound file, or no reader.
_BY_MESHIO = {name for name in FORMATS if name.split()[0] in ("msh", "vtk", "vtu", "mesh", "xdmf")}
NEEDS = dict.fromkeys(_BY_MESHIO, "meshio") | dict.fromkeys(("vtp", "vtk of a surface"), "pyvista")
NEEDS |= {"glb": "trimesh", "mask": "skimage", "mask archive": "skimage"}
NEEDS |= dict.fromkeys((name for name in FORMATS if name.startswith("xdmf")), "h5py")


def sound(name: str) -> bytes:
    """A sound file of a format."""
    format_ = FORMATS[name]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"sound{format_.suffix}")
        format_.make(path)
        return path.read_bytes()


def misread(name: str, data: bytes, mesh: Any) -> str:
    """What a mesh that was read has other than its file announces; empty where nothing is."""
    if not isinstance(mesh, (sm.TriMesh, sm.TetMesh)):
        return ""
    if not np.isfinite(mesh.V).all():
        return "coordinates that are not finite"
    points, elements = FORMATS[name].announced(data)
    if points is not None and points != mesh.n_vertices:
        return f"{points} points announced, {mesh.n_vertices} read"
    found = len(_elements(mesh))
    solid = isinstance(mesh, sm.TetMesh)  # a surface may have more, its polygons being split
    if elements is not None and (found < elements or (solid and found > elements)):
        return f"{elements} elements announced, {found} read"
    return ""
