"""Handle and tunnel loops of surfaces of large genus."""

from __future__ import annotations

import numpy as np
import pytest

import shapes
from stretchmap import TetMesh, homology_basis
from stretchmap.homology.shortest_basis import ShortestBasis, searched
from stretchmap.homology.walks import joined_loops, shortest_cycles


def plate(rows, columns):
    """A plate of cubes with holes of one cube each, so that bars round these are one cube wide."""
    filled = np.ones((2 * rows + 1, 2 * columns + 1, 1), bool)
    filled[1::2, 1::2] = False
    return TetMesh(*shapes.cubes(filled))


def frames(n):
    """The edges of a block of n by n by n cubes, as bars."""
    filled = np.indices((2 * n + 1,) * 3) % 2
    return TetMesh(*shapes.cubes(filled.sum(axis=0) <= 1))


def shaken(solid, scale=0.1):
    shift = np.random.default_rng(0).uniform(-scale, scale, solid.V.shape)
    return TetMesh(solid.V + shift, solid.T)


def check_families(basis):
    """What bounds inside links nothing outside; both families are bases over the integers."""
    handles = np.array([basis.classes(loop) for loop in basis.handle_loops])
    tunnels = np.array([basis.classes(loop) for loop in basis.tunnel_loops])
    assert len(handles) == len(tunnels) == basis.genus
    assert not (handles @ basis.linking).any() and not (basis.linking @ tunnels.T).any()
    for found, lattice, dual in (
        (handles, basis.handle_classes, basis.tunnel_classes),
        (tunnels, basis.tunnel_classes, basis.handle_classes),
    ):
        change = found @ basis.intersection @ dual.T
        signs = lattice @ basis.intersection @ dual.T
        assert np.array_equal(np.abs(signs), np.eye(basis.genus, dtype=int))
        assert np.array_equal(change @ signs @ lattice, found)
        assert abs(np.linalg.slogdet(change.astype(float))[1]) < 1e-6


@pytest.mark.parametrize(
    ("solid", "genus", "length"),
    [(plate(6, 6), 36, 4.0), (plate(10, 10), 100, 4.0), (frames(2), 28, 4.0)],
    ids=["36", "100", "frames"],
)
def test_loops_of_many_bars_and_holes(solid, genus, length):
    """Round every bar and every hole there is a loop of four edges. Searches of the cover, which
    had taken memory that doubles with every second handle, would not end."""
    basis = homology_basis(solid.surface, solid)
    assert basis.genus == genus
    check_families(basis)
    for loop in (*basis.handle_loops, *basis.tunnel_loops):
        assert basis.length(loop) == pytest.approx(length)
    # Also in classes that many loops together make up.
    target = basis.classes(basis.handle_loops[0])
    assert basis.length(basis.shortest_loop(target)) == pytest.approx(length)
    assert basis.length(basis.loop_below(target, 50.0)) == pytest.approx(length)
    assert basis.loop_below(target, length) is None


@pytest.mark.parametrize("solid", [plate(1, 2), plate(3, 3), frames(1)], ids=["2", "9", "frames"])
def test_loops_of_small_genus_are_those_of_their_classes(solid):
    basis = homology_basis(solid.surface, solid)
    for loops, rows in (
        (basis.handle_loops, basis.handle_classes),
        (basis.tunnel_loops, basis.tunnel_classes),
    ):
        assert np.array_equal([basis.classes(loop) for loop in loops], rows)
    pairing = basis.tunnel_classes @ basis.intersection @ basis.handle_classes.T
    assert np.array_equal(pairing, np.eye(basis.genus, dtype=int))


@pytest.mark.parametrize("solid", [plate(1, 3), plate(2, 3), frames(1)], ids=["3", "6", "frames"])
def test_loops_are_no_longer_than_those_of_the_classes_of_the_basis(solid):
    solid = shaken(solid)
    basis = homology_basis(solid.surface, solid)
    check_families(basis)
    for loops, rows in (
        (basis.handle_loops, basis.handle_classes),
        (basis.tunnel_loops, basis.tunnel_classes),
    ):
        for loop, row in zip(loops, rows, strict=True):
            # By search of the cover, which is exact.
            exact = searched(basis, basis.classes(loop))
            assert basis.length(loop) == pytest.approx(basis.length(exact), rel=1e-12)
            least = basis.length(searched(basis, row))
            assert basis.length(loop) < least * (1 + 1e-12)


@pytest.mark.parametrize("target", [(1, 0, 0, 0), (1, 1, 0, 0), (2, 0, -1, 0), (1, -1, 1, 3)])
def test_shortest_walk_of_a_class_by_two_routes(target):
    solid = shaken(TetMesh(*shapes.cubes(shapes.DOUBLE)))
    basis = homology_basis(solid.surface, solid)
    cycles = shortest_cycles(basis.surface, basis.generators, np.array(target))
    assert np.array_equal(sum(basis.classes(cycle) for cycle in cycles), target)
    for cycle in cycles:
        assert len(set(cycle.tolist())) == len(cycle)
        exact = searched(basis, basis.classes(cycle))
        assert basis.length(cycle) == pytest.approx(basis.length(exact), rel=1e-12)
    joined = joined_loops(basis.surface, cycles)
    exact = searched(basis, np.array(target))
    walk = basis.shortest_loop(target)
    for loop in (joined, exact, walk):
        assert np.array_equal(basis.classes(loop), target)
    least = sum(basis.length(cycle) for cycle in cycles)
    assert least <= basis.length(exact) * (1 + 1e-12)
    assert basis.length(exact) <= basis.length(joined) * (1 + 1e-12)
    assert basis.length(walk) == pytest.approx(basis.length(exact), rel=1e-12)


def test_members_are_exchanged_only_where_a_basis_of_the_lattice_is_left():
    basis = ShortestBasis(np.array([[1, 0, 0], [0, 1, 0]]))
    loop = np.arange(3, dtype=np.int32)
    assert basis.offer(np.array([2, 1, 0]), loop, 5.0) == 1
    assert basis.offer(np.array([0, 0, 1]), loop, 1.0) == -1  # not of the lattice
    assert basis.offer(np.array([3, 1, 0]), loop, 4.0) == 0
    assert basis.offer(np.array([0, 2, 0]), loop, 1.0) == -1  # 6 of one and -4 of the other
    assert basis.offer(np.array([2, 1, 0]), loop, 5.0) == -1  # no shorter
    assert basis.rows.tolist() == [[3, 1, 0], [2, 1, 0]] and basis.lengths.tolist() == [4.0, 5.0]
