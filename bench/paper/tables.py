"""One function per table: our figures beside the paper's, as rows of cells."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise, permutations
from typing import Any

import published

import stretchmap as sm
from stretchmap.mesh.meshes import TetMesh
from stretchmap.registration.suggest import landmarks_between
from stretchmap.resample.hexes import hex_mesh

Rows = Iterator[tuple[Any, ...]]
Meshes = dict[str, TetMesh]

# All steps of Algorithm 5.1 asked for, whatever they gain.
EXACT = sm.VolumeOptions(tol=0.0)


def table_3_1(meshes: Meshes) -> Rows:
    """Loop lengths; the paper's unit is not stated, so the ratio of the two is compared."""
    yield ("mesh", "handle", "tunnel", "ratio", "paper's ratio", "s", "paper s")
    for name, solid in meshes.items():
        start = time.perf_counter()
        basis = sm.homology_basis(solid.surface)
        handle, tunnel = (basis.length(basis.handle_loops[0]), basis.length(basis.tunnel_loops[0]))
        seconds = time.perf_counter() - start
        short, long = sorted((handle, tunnel))
        paper = published.LOOPS.get(name)
        yield (
            name, f"{handle:.4g}", f"{tunnel:.4g}", f"{long / short:.3f}",
            f"{paper[1] / paper[0]:.3f}" if paper else "-", f"{seconds:.2f}",
            f"{paper[2]}" if paper else "-",
        )  # fmt: skip


def table_6_1(meshes: Meshes) -> Rows:
    """Conformal energy (6.1) for a surface of area one."""
    yield ("mesh", "E_C", "paper E_C", "s", "paper s")
    for name, solid in meshes.items():
        start = time.perf_counter()
        result = sm.conformal_map(solid.surface)
        seconds = time.perf_counter() - start
        energy = result.conformal_energy
        paper = published.CONFORMAL.get(name, ("-", "-"))
        yield (name, f"{energy:.4e}", paper[0], f"{seconds:.2f}", paper[1])


def table_6_2(meshes: Meshes) -> Rows:
    """Area-preserving maps, measured on the polyhedral image."""
    yield (
        "mesh", "D_area", "paper", "ring mean", "paper", "ring SD", "paper", "face SD", "face min",
        "face max", "flips", "paper", "angle mean", "s",
    )  # fmt: skip
    for name, solid in meshes.items():
        start = time.perf_counter()
        d = sm.area_map(solid.surface).distortion
        seconds = time.perf_counter() - start
        paper = published.AREA.get(name, ("-",) * 4)
        yield (
            name, f"{d.total_distortion:.4f}", paper[0], f"{d.ring_mean:.4f}", paper[1],
            f"{d.ring_std:.4f}", paper[2], f"{d.element_std:.4f}", f"{d.ratio_min:.3f}",
            f"{d.ratio_max:.3f}", d.flips, paper[3], f"{d.angle_mean:.2f}", f"{seconds:.2f}",
        )  # fmt: skip


def table_6_3(meshes: Meshes) -> Rows:
    """Algorithm 5.1, 20 steps, by c."""
    yield (
        "mesh", "c", "D_volume", "paper", "ring mean", "paper", "ring SD", "paper", "flips",
        "paper", "energy fell at every step", "s", "paper s",
    )  # fmt: skip
    for name, solid in meshes.items():
        boundary = sm.area_map(solid.surface)
        for c in (0, 1, 10):
            result = sm.volume_map(solid, c=c, max_iter=20, start=boundary, options=EXACT)
            d, energies = result.distortion, [record.energy for record in result.history]
            falls = all(b < a for a, b in pairwise(energies))
            paper = published.VOLUME.get(name, {}).get(c, ("-",) * 5)
            yield (
                name, c, f"{d.total_distortion:.4f}", paper[0], f"{d.ring_mean:.4f}", paper[1],
                f"{d.ring_std:.4f}", paper[2], d.flips, paper[3], "yes" if falls else "NO",
                f"{result.seconds['vsem']:.2f}", paper[4],
            )  # fmt: skip


def table_6_4(meshes: Meshes) -> Rows:
    """Algorithm 5.1 with c = 10 after 0, 1, 5, 10 and 20 steps."""
    yield ("mesh", "steps", "energy", "D_volume", "paper", "ring SD", "paper", "flips", "paper")
    for name, solid in meshes.items():
        boundary = sm.area_map(solid.surface)
        for steps in (0, 1, 5, 10, 20):
            result = sm.volume_map(solid, c=10, max_iter=steps, start=boundary, options=EXACT)
            d = result.distortion
            paper = published.STEPS.get(name, {}).get(steps, ("-",) * 4)
            yield (
                name, steps, f"{result.history[-1].energy:.4f}", f"{d.total_distortion:.4f}",
                paper[0], f"{d.ring_std:.4f}", paper[2], d.flips, paper[3],
            )  # fmt: skip


def certified(meshes: Meshes) -> Rows:
    """The paper's two columns, ours by its algorithm, and the certified maps."""
    yield (
        "mesh", "method", "flips", "certified", "ring SD", "D_volume", "tet mean abs(ratio-1)",
        "tet SD", "min ratio", "angle mean", "steps", "s",
    )  # fmt: skip
    for name, solid in meshes.items():
        for c in (0, 10):
            paper = published.VOLUME.get(name, {}).get(c)
            if paper:
                cells = ("-",) * 4
                yield (
                    name,
                    f"paper, c = {c}",
                    paper[3],
                    "-",
                    paper[2],
                    paper[0],
                    *cells,
                    20,
                    paper[4],
                )
        runs: dict[str, dict[str, Any]] = {
            "vsem, c = 0": {"c": 0, "max_iter": 20, "options": EXACT},
            "vsem, c = 10": {"c": 10, "max_iter": 20, "options": EXACT},
            "frozen": {"boundary": "frozen", "keep_best": True},
            "glide": {"boundary": "glide", "keep_best": True},
        }
        for method, options in runs.items():
            start = time.perf_counter()
            result = sm.volume_map(solid, **options)
            yield (name, method, *map_cells(result), f"{time.perf_counter() - start:.1f}")


def table_7_1(meshes: Meshes) -> Rows:
    """Partition in fifths at the levels that divide the solid torus, and at corrected ones."""
    yield (
        "mesh", "1/5", "2/5", "3/5", "4/5", "worst fifth by s", "by u", "by v",
        "after correction",
    )  # fmt: skip
    for name, solid in meshes.items():
        result = default_map(solid)
        parts = [sm.partition(result, 5, by) for by in "suv"]
        paper = published.SHELLS.get(name)
        if paper:
            yield (f"{name}, paper", *(percent(error) for error in paper), *("-",) * 4)
        yield (
            name, *(percent(abs(error)) for error in parts[0].cumulative_errors),
            *(percent(abs(part.uncorrected_errors).max()) for part in parts),
            f"{max(abs(part.errors).max() for part in parts):.1e}",
        )  # fmt: skip


def tradeoff(meshes: Meshes) -> Rows:
    """Between shape and volume."""
    yield (
        "mesh", "balance", "certified", "tet SD", "mean abs(ratio-1)", "smallest ratio",
        "angle mean", "angle max", "s",
    )  # fmt: skip
    for name, solid in meshes.items():
        for balance in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
            start = time.perf_counter()
            result = sm.volume_map(solid, balance=balance, keep_best=True)
            seconds = time.perf_counter() - start
            d = result.distortion
            yield (
                name, balance, "yes" if result.certificate.certified else "no",
                f"{d.element_std:.4f}", f"{d.element_error_mean:.4f}", f"{d.ratio_min:.3f}",
                f"{d.angle_mean:.3f}", f"{d.angle_max:.1f}", f"{seconds:.1f}",
            )  # fmt: skip


def grids(meshes: Meshes) -> Rows:
    """Hexahedral grids of two sizes, from maps between shape and volume."""
    yield (
        "mesh", "hexahedra", "not valid when pulled back", "after", "least scaled Jacobian",
        "mean", "below 0.2", "0.3", "0.5", "SD of volume ratios", "error of the volume",
        "grid to surface", "surface to grid", "farthest point moved", "s",
    )  # fmt: skip
    for name, solid in meshes.items():
        result = sm.volume_map(solid, balance=0.5)
        for count in (5_000, 40_000):
            start = time.perf_counter()
            grid = hex_mesh(result, n_hexahedra=count)
            seconds = time.perf_counter() - start
            worst = grid.scaled_jacobians
            yield (
                name, len(grid.H), grid.n_pulled_back_invalid, grid.n_invalid,
                f"{worst.min():.3f}", f"{worst.mean():.3f}",
                *(percent((worst < limit).mean()) for limit in (0.2, 0.3, 0.5)),
                f"{grid.volume_ratios.std():.3f}", percent(abs(grid.volume / solid.volume - 1.0)),
                percent(grid.grid_to_surface), percent(grid.surface_to_grid), percent(grid.moved),
                f"{seconds:.1f}",
            )  # fmt: skip


def registrations(meshes: Meshes) -> Rows:
    """Each vertebra onto the others, without landmarks and with 36 found by a rule."""
    yield (
        "source", "target", "landmarks", "landmark error", "certified", "flips", "ratio mean",
        "ratio SD", "D_volume", "min ratio", "s",
    )  # fmt: skip
    yield ("paper", "paper", 38, "-", "-", "-", *published.REGISTRATION, "-", "-")
    vertebrae = {name: solid for name, solid in meshes.items() if name.startswith("vertebra")}
    for (source, first), (target, second) in permutations(vertebrae.items(), 2):
        marks = None
        for _ in range(2):
            start = time.perf_counter()
            result = sm.register(first, second, marks, boundary="frozen", keep_best=True)
            seconds = time.perf_counter() - start
            d = result.distortion
            yield (
                source, target, len(result.landmarks), f"{result.landmark_error:.1e}",
                "yes" if result.certificate.certified else "no", d.flips, f"{d.ring_mean:.4f}",
                f"{d.ring_std:.4f}", f"{d.total_distortion:.4f}", f"{d.ratio_min:.3f}",
                f"{seconds:.1f}",
            )  # fmt: skip
            if marks is None:
                marks = landmarks_between(result, 36)


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{100.0 * share:.3f} %"


@lru_cache
def default_map(solid: TetMesh) -> sm.volume.VolumeMap:
    """The map a user gets without options, or the best one found, computed once."""
    return sm.volume_map(solid, keep_best=True)


def map_cells(result: sm.volume.VolumeMap) -> tuple[Any, ...]:
    """Flips, certificate, distortion and steps of a volume map."""
    d = result.distortion
    return (
        d.flips, "yes" if result.certificate.certified else "no", f"{d.ring_std:.4f}",
        f"{d.total_distortion:.4f}", f"{d.element_error_mean:.4f}", f"{d.element_error_std:.4f}",
        f"{d.ratio_min:.3f}", f"{d.angle_mean:.2f}",
        sum(1 for record in result.history if record.iteration > 0),
    )  # fmt: skip


def all_solids(meshes: Meshes) -> Rows:
    """The default map of every mesh given."""
    yield (
        "mesh", "tets", "flips", "certified", "ring SD", "D_volume", "tet mean abs(ratio-1)",
        "tet SD", "min ratio", "angle mean", "steps", "s",
    )  # fmt: skip
    for name, solid in meshes.items():
        start = time.perf_counter()
        result = sm.volume_map(solid, keep_best=True)
        yield (name, len(solid.T), *map_cells(result), f"{time.perf_counter() - start:.1f}")


TABLES: dict[str, tuple[str, Callable[[Meshes], Rows]]] = {
    "3.1": ("Table 3.1: loops", table_3_1),
    "6.1": ("Table 6.1: conformal maps", table_6_1),
    "6.2": ("Table 6.2: area-preserving maps", table_6_2),
    "6.3": ("Table 6.3: Algorithm 5.1 by c", table_6_3),
    "6.4": ("Table 6.4: Algorithm 5.1 by steps", table_6_4),
    "certified": ("Certified maps", certified),
    "tradeoff": ("Between shape and volume: balance", tradeoff),
    "grids": ("Hexahedral grids", grids),
    "registration": ("Registration of vertebrae", registrations),
    "7.1": ("Table 7.1: relative errors of the volumes of nested shells", table_7_1),
}
