"""Coordinates (u, v, s) between meshes of one body and between bodies: origin, transfer, linearity.

python bench/population/coordinates.py --shapes 4 --tets 4000

The rule for the origin is tried on a body moved and renumbered, and on other meshes of a body
without mirror planes: how far the origin moves, and how far coordinates differ apart from that.
Transfer and linearity errors are those of Cobiveco (Schuler et al. 2021, arXiv 2102.02898):
positions of the vertices carried as a field to the vertices of the other mesh and back by
(u, v, s), as a share of the size; and along lines of one coordinate, the others held, how far the
share of the length passed is from linear in it.
"""

from __future__ import annotations

import argparse

import numpy as np

import stretchmap as sm

TWO_PI = 2.0 * np.pi


def turned(solid: sm.TetMesh, seed: int) -> sm.TetMesh:
    """Moved rigidly, its vertices in another order."""
    random = np.random.default_rng(seed)
    Q = np.linalg.qr(random.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    order = random.permutation(solid.n_vertices)
    rank = np.argsort(order).astype(np.int32)
    return sm.TetMesh(solid.V[order] @ Q.T + 3.0, rank[solid.T])


def skewed(n_tets: int) -> sm.TetMesh:
    """The sample vertebra bent, twisted and swollen on one side: no mirror plane is left."""
    solid = sm.samples.vertebra_like(n_tets)
    size = np.linalg.norm(np.ptp(solid.V, axis=0))
    x, y, z = (solid.V / size).T
    turn = 1.2 * z + 0.8 * x
    along, across = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    bent = [along * (1.0 + 0.5 * across), across, z + 0.6 * along * across + 0.3 * along]
    return sm.TetMesh(size * np.column_stack(bent), solid.T)


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Degrees between angles."""
    return np.degrees(np.abs(np.angle(np.exp(1j * (one - other)))))


def place(found: sm.VolumeMap, uvs: np.ndarray) -> np.ndarray:
    """Points of the source at coordinates from the origin on, s a share of r; NaN off the image."""
    origin = sm.origin_of(found)
    u, v = (origin.sign * uvs[:, :2] + [origin.u, origin.v]).T
    points = sm.PointMap(found, tolerance=0.02)
    return points.inverse(found.torus.xi(u, v, uvs[:, 2] * found.torus.r)).points


def coordinates(found: sm.VolumeMap, points: np.ndarray) -> np.ndarray:
    """From the origin on, s as a share of r."""
    uvs = sm.origin_of(found).coordinates(found.coordinates(points))
    uvs[:, 2] /= found.torus.r
    return uvs


def transfer(one: sm.VolumeMap, other: sm.VolumeMap) -> np.ndarray:
    """Errors of the vertices of one, told to those of the other and back; NaN where one is lost."""
    size = np.linalg.norm(np.ptp(one.mesh.V, axis=0))
    told = place(one, coordinates(other, other.mesh.V))
    at = place(other, coordinates(one, one.mesh.V))
    known = np.isfinite(at).all(axis=1)
    located = sm.PointMap(other, tolerance=0.02).forward(np.nan_to_num(at))
    back = np.einsum("nk,nkx->nx", located.weights, told[other.mesh.T[located.tets]])
    return np.where(known, np.linalg.norm(back - one.mesh.V, axis=1) / size, np.nan)


def linearity(found: sm.VolumeMap, axis: int) -> np.ndarray:
    """Largest departure from linear of the share of length passed, of lines of one coordinate."""
    steps, lines = 61, []
    for i in range(12):
        for j in range(4):
            uvs = np.zeros((steps, 3))
            run = np.linspace(0.0, 1.0, steps)
            others = [k for k in range(3) if k != axis]
            uvs[:, axis] = run * (TWO_PI if axis < 2 else 0.95)
            for k, value in zip(others, (i / 12, (j + 1) / 5), strict=True):
                uvs[:, k] = value * (TWO_PI if k < 2 else 1.0)
            points = place(found, uvs)
            if np.isfinite(points).all():
                passed = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
                lines.append(np.abs(passed / passed[-1] - run[1:]).max())
    return np.array(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shapes", type=int, default=4)
    parser.add_argument("--tets", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=11)
    options = parser.parse_args()
    bones = sm.samples.vertebra_population(options.shapes, options.seed, n_tets=options.tets)
    maps = [sm.volume_map(solid) for solid in bones.solids]
    print("origin: degrees (median) between coordinates of the same points")
    for i, (solid, found) in enumerate(zip(bones.solids, maps, strict=True)):
        copy = turned(solid, i)
        again = sm.volume_map(copy)
        order = np.random.default_rng(i)
        order.standard_normal((3, 3))
        order = order.permutation(solid.n_vertices)
        one = coordinates(found, solid.V[order])
        other = coordinates(again, copy.V)
        known = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
        du, dv = (np.median(difference(one[known, k], other[known, k])) for k in range(2))
        sure = ", ".join(f"{s:.3f}" for s in sm.origin_of(found).sureness)
        print(f"  bone {i} moved and renumbered: u {du:.2f}, v {dv:.2f}; moments {sure}")
    solid = skewed(options.tets)
    given, points = sm.volume_map(solid), solid.V[solid.T].mean(axis=1)
    for times in (1.5, 2, 4):
        other = sm.volume_map(skewed(int(times * options.tets)))
        one, two = coordinates(given, points), coordinates(other, points)
        ahead = np.exp(1j * (one - two)[np.isfinite(one + two).all(axis=1), :2])
        begin = ahead.mean(axis=0)
        rest = np.median(np.abs(np.angle(ahead / begin)), axis=0)
        (u, v), (du, dv) = np.degrees(np.abs(np.angle(begin))), np.degrees(rest)
        print(
            f"  {times:g} times as many tets: origin off by u {u:.1f}, v {v:.1f}; points apart "
            f"from that u {du:.1f}, v {dv:.1f}; "
            f"s {np.nanmedian(np.abs((one - two)[:, 2])):.3f} of r"
        )
    print("transfer there and back, % of the size: median, 95 %, worst")
    for i in range(1, len(maps)):
        errors = 100.0 * transfer(maps[0], maps[i])
        low, high, most = np.nanpercentile(errors, [50, 95, 100])
        lost = 100.0 * np.isnan(errors).mean()
        print(f"  bone 0 by bone {i}: {low:.2f}, {high:.2f}, {most:.2f}; {lost:.1f} % lost between")
    print("linearity, departure from linear as a share of the line: median, worst")
    for axis, name in enumerate("uvs"):
        lines = np.concatenate([linearity(found, axis) for found in maps])
        print(
            f"  {name}: {np.median(lines):.3f}, {lines.max():.3f} ({len(lines)} lines)", flush=True
        )


if __name__ == "__main__":
    main()
