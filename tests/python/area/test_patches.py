"""Faces that look inward, turned with the rest of the surface held."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import stretchmap as sm
from small_handles import eased, small_handle, start_of
from stretchmap import _core
from stretchmap.area import finer, patches
from stretchmap.area.finer import Finer, mapped_finer
from stretchmap.area.finish import Pace, Steps, approach_areas, unfold_faces
from stretchmap.area.patches import turn_in_patches
from stretchmap.area.route import Made
from stretchmap.area.work import Work


def approached(seed: int) -> tuple[Finer, _core.area.SurfaceNewton, Pace]:
    """A surface with areas nearly right and faces that look inward."""
    start = Finer.wrapped(*eased(small_handle(seed, 3.6))).fitted(3.0)
    assert start is not None
    newton = start.newton()
    _, pace = approach_areas(newton, 10, None)
    assert newton.inward()
    return start, newton, pace


def test_a_patch_is_what_lies_round_faces() -> None:
    start = start_of(sm.samples.torus_surface(30, 20))
    faces = start.level.surface.F
    inside = set(faces[7])
    for rings in (1, 2, 3):
        patch = _core.area.SurfacePatch(start.newton(), [7], rings)
        near = np.isin(faces, list(inside)).any(axis=1)
        assert patch.n_faces == near.sum() and set(patch.vertices) == set(faces[near].ravel())
        assert inside <= set(patch.vertices[patch.held == 0])
        assert set(patch.vertices[patch.held == 1]) == set(patch.vertices) & set(faces[~near].flat)
        inside = set(patch.vertices)


def test_what_a_patch_encloses_is_free() -> None:
    """A vertex with all its faces in the patch, none of which is given."""
    start = start_of(sm.samples.torus_surface(30, 20))
    faces = start.level.surface.F
    vertex = 100
    link = np.setdiff1d(faces[(faces == vertex).any(axis=1)], vertex)
    around = np.isin(faces, link).sum(axis=1) == 2
    seeds = np.flatnonzero(around & ~(faces == vertex).any(axis=1))
    patch = _core.area.SurfacePatch(start.newton(), seeds, 1)
    assert patch.held[patch.vertices == vertex] == [0] and patch.held.any()


def test_a_patch_of_everything_takes_the_same_steps() -> None:
    start = start_of(sm.samples.bumpy_torus(1000).surface)
    newton = start.newton()
    patch = _core.area.SurfacePatch(newton, list(range(start.level.surface.n_faces)), 1)
    part = _core.area.SurfaceNewton(patch.problem, start.angles[patch.vertices])
    assert not patch.held.any()
    weights = _core.area.SurfaceWeights(shape=0.1, chart=1.0)
    for _ in range(3):
        taken, other = newton.step(weights), part.step(weights)
        assert taken.after == pytest.approx(other.after, rel=1e-9) and taken.after < taken.before
    assert np.allclose(part.angles, newton.angles[patch.vertices], atol=1e-6)


def test_what_is_held_stays() -> None:
    start = start_of(sm.samples.bumpy_torus(1000).surface)
    patch = _core.area.SurfacePatch(start.newton(), [0, 100], 3)
    before = start.angles[patch.vertices]
    part = _core.area.SurfaceNewton(patch.problem, before, patch.held)
    weights = _core.area.SurfaceWeights(shape=0.1, chart=1.0)
    taken = [part.step(weights) for _ in range(3)]
    assert taken[0].step == 1.0 and taken[0].after < taken[0].before
    # The model is good: what is held is no part of it.
    assert taken[2].decrement < 0.1 * taken[0].decrement
    moved = np.linalg.norm(part.angles - before, axis=1)
    assert (moved[patch.held == 1] == 0.0).all() and (moved[patch.held == 0] > 0.0).all()


def test_the_last_few_faces_are_turned_in_patches(monkeypatch) -> None:
    monkeypatch.setattr(patches, "_WHOLE", 1.0)  # these surfaces are small
    in_patches, on_the_whole = [], []
    for seed in range(6):
        start, newton, pace = approached(seed)
        few, before = newton.inward(), newton.angles
        whole = start.level.newton(before, start.ratio)
        work = Work(start.level.surface.n_faces, 1e9, 40)
        records = turn_in_patches(newton, None, pace, work)
        assert newton.least_facing() > 0.0 and newton.inward() == [] and work.left < 1e9
        assert {record.stage for record in records} == {"untangle"} and records[-1].flips == 0
        patch = _core.area.SurfacePatch(newton, few, 16)
        outside = np.setdiff1d(np.arange(len(before)), patch.vertices[patch.held == 0])
        assert len(outside) and (newton.angles[outside] == before[outside]).all()
        unfold_faces(whole, 60, None, pace)
        assert whole.least_facing() > 0.0
        in_patches.append(newton.measures().face_std)
        on_the_whole.append(whole.measures().face_std)
    assert np.mean(in_patches) < 0.7 * np.mean(on_the_whole)


def test_what_patches_turn_takes_no_steps_on_the_whole(monkeypatch) -> None:
    start, newton, pace = approached(1)
    near = dataclasses.replace(start, angles=newton.angles)
    assert near.added.n_split > 0
    monkeypatch.setattr(Finer, "approached", lambda self, *_: (self, pace, []))
    monkeypatch.setattr(patches, "_WHOLE", 1.0)

    def on_the_whole(*_: object) -> None:
        raise AssertionError("patches serve here")

    monkeypatch.setattr(finer, "unfold_faces", on_the_whole)
    most_faces, asked = Work.most_faces, []

    def counted(self: Work, steps: int, *, last: bool = False) -> int:
        asked.append(last)
        return most_faces(self, steps, last=last)

    monkeypatch.setattr(Work, "most_faces", counted)
    work = Work(near.level.surface.n_faces, 1e9, 40)
    made = Made(near.angles, 0.0, near.ratio, [])
    found = mapped_finer(near, made, Steps(5, 5e-3, 1.2), 0.01, False, None, work)
    assert found is not None and found[1].newton().least_facing() > 0.0
    records = [record for record in found[0].history if record.stage == "untangle"]
    assert records and all(np.isnan(record.element_std) for record in records)
    assert asked and all(asked)  # rounds add few faces, and there may be more of them


def test_patches_as_large_as_the_surface_are_left_alone(monkeypatch) -> None:
    _, newton, pace = approached(0)
    before = newton.angles
    monkeypatch.setattr(patches, "_WHOLE", 0.0)
    assert turn_in_patches(newton, None, pace, Work(1, 1e9, 40)) == []
    assert (newton.angles == before).all() and newton.inward()
