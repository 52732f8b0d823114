"""Pictures: what they show is checked on the artists, and that nothing overlaps on the canvas."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import plot, samples
from stretchmap.errors import ArrayError, FileFormatError, OptionError
from stretchmap.maps.history import IterationRecord
from stretchmap.plot import solids
from stretchmap.plot.painting import Scene, View, subdivided
from stretchmap.plot.pairs import _APART, _out_of_the_way
from stretchmap.plot.statistics import ratios_before
from stretchmap.plot.style import empty_figure

matplotlib = pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def volume():
    return sm.volume_map(samples.bumpy_torus(2500), max_iter=5)


@pytest.fixture(scope="module")
def area():
    return sm.area_map(samples.bumpy_torus(2500).surface)


@pytest.fixture(scope="module")
def registered():
    pair = samples.vertebra_pair(n_landmarks=30, n_tets=(3000, 4000))
    return sm.register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))


@pytest.fixture(scope="module")
def standard():
    """The identity of a solid torus, with the radii (3, 1)."""
    solid = samples.solid_torus(20_000, R=3.0, r=1.0)
    return a_map(solid, solid.V, sm.Torus(3.0, 1.0))


def texts(figure):
    """Bounding boxes of all text that is drawn, with its content."""
    figure.canvas.draw()
    shown = [text for legend in figure.legends for text in legend.get_texts()]
    for axes in figure.axes:
        shown += axes.texts
        shown.append(axes.title)
        shown += axes.get_legend().get_texts() if axes.get_legend() else []
        for axis in (axes.xaxis, axes.yaxis) if axes.axison else ():
            low, high = sorted(axis.get_view_interval())
            shown.append(axis.label)
            shown += [
                tick.label1 if tick.label1.get_visible() else tick.label2
                for tick, place in zip(
                    axis.get_major_ticks(), axis.get_majorticklocs(), strict=True
                )
                if low <= place <= high
            ]
    renderer = figure.canvas.get_renderer()
    return [
        (artist.get_text(), artist.get_window_extent(renderer))
        for artist in shown
        if artist.get_text().strip() and artist.get_visible()
    ]


@pytest.mark.parametrize("kind", plot.KINDS)
def test_no_text_overlaps_or_leaves_the_page(volume, area, registered, kind):
    having = [m for m in (volume, area, registered) if kind in plot.kinds(m)]
    assert having
    for result in having:
        figure = plot.picture(result, kind)
        boxes = texts(figure)
        assert boxes
        width, height = figure.canvas.get_width_height()
        for text, box in boxes:
            assert box.x0 >= -1 and box.y0 >= -1, text
            assert box.x1 <= width + 1 and box.y1 <= height + 1, text
        for (first, a), (second, b) in combinations(boxes, 2):
            across = min(a.x1, b.x1) - max(a.x0, b.x0)
            up = min(a.y1, b.y1) - max(a.y0, b.y0)
            assert min(across, up) <= 1.0, f"{first!r} overlaps {second!r}"


@pytest.mark.parametrize("kind", ["ratios", "convergence", "domain"])
def test_axes_are_labelled(volume, kind):
    figure = plot.picture(volume, kind)
    plain = [axes for axes in figure.axes if axes.axison]
    assert all(axes.get_ylabel() for axes in plain)
    assert any(axes.get_xlabel() for axes in plain)


def test_histograms_hold_every_element_and_name_both_maps(volume):
    figure = plot.ratios(volume)
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    sd = volume.distortion.element_std
    assert labels[0].startswith("harmonic map") and labels[1].startswith(f"final map: SD {sd:.3g}")
    for patch in figure.axes[0].patches[1::2]:
        assert patch.get_data().values.sum() == pytest.approx(100.0, abs=1e-6)


def test_ratios_before_are_those_of_the_harmonic_map(volume):
    before, name = ratios_before(volume)
    frozen = sm.volume_map(volume.mesh, c=0.0, max_iter=0, start=volume).distortion
    assert name == "harmonic map"
    assert np.average(before, weights=volume.mesh.tet_volumes) == pytest.approx(1.0)
    # With no step at all the map is what we gave, not the harmonic one, which preserves less.
    assert frozen.element_std < before.std()


def test_convergence_shows_every_record(volume):
    figure = plot.convergence(volume)
    drawn = sum(len(line.get_xdata()) for line in figure.axes[0].lines)
    assert drawn == sum(1 for record in volume.history if np.isfinite(record.energy))
    legend = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert legend == list(dict.fromkeys(record.stage for record in volume.history))


def test_convergence_survives_missing_values(volume, area):
    from dataclasses import replace

    bare = replace(area, history=(IterationRecord("odd", 0), IterationRecord("odd", 1)))
    plot.convergence(bare).canvas.draw()
    with pytest.raises(OptionError, match="no history"):
        plot.convergence(replace(area, history=()))


def test_the_chart_is_covered_without_gaps(area):
    figure = plot.domain(area)
    axes = figure.axes[0]
    axes.set_position([0, 0, 1, 1])
    axes.set_axis_off()
    axes.set_title("")
    figure.delaxes(figure.axes[1])
    figure.set_layout_engine("none")
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[2:-2, 2:-2, :3]
    white = (pixels == 255).all(axis=2).mean()
    assert white < 1e-3


def test_loops_of_a_mesh_of_genus_two():
    figure = plot.loops(samples.solid_double_torus(1))
    dotted = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 2]
    assert len(dotted) == 4


def test_a_map_without_a_torus_has_no_chart(volume):
    from dataclasses import replace

    bare = replace(volume, torus=None)
    for kind in ("domain", "checkerboard"):
        with pytest.raises(OptionError, match="names no torus"):
            plot.picture(bare, kind)
    plot.ratios(bare), plot.cutaway(bare)


def test_kinds_are_those_that_can_be_drawn(volume, area, registered):
    from dataclasses import replace

    lacking = {
        volume: {"registration"},
        area: {"registration", "cutaway", "levels"},
        registered: {"checkerboard", "domain", "levels"},
        replace(area, history=(), torus=None): set(plot.KINDS) - {"loops", "ratios"},
    }
    for result, kinds in lacking.items():
        assert set(plot.KINDS) - set(plot.kinds(result)) == kinds
        for kind in kinds:
            with pytest.raises((OptionError, ArrayError)):
                plot.picture(result, kind)


def test_a_sector_is_cut_out_by_planes(standard):
    front, opening = 0.3, 0.35
    pieces, kept = solids._Pieces.of(standard).opened(front, np.array([opening]))
    for angle in front + np.pi * opening * np.array([-1.0, 1.0]):
        x, y, _ = pieces.image.T
        height = (y * np.cos(angle) - x * np.sin(angle))[pieces.T]
        assert (height.max(axis=1) * height.min(axis=1)).min() > -1e-12
    x, y, _ = pieces.image[pieces.T[kept].ravel()].T
    turn = (np.arctan2(y, x) - front) / (2.0 * np.pi)
    assert np.abs(turn - np.round(turn)).min() > 0.5 * opening - 1e-9
    left = sm.TetMesh(pieces.image, pieces.T[kept])
    assert left.volume / standard.mesh.volume == pytest.approx(1.0 - opening, abs=5e-3)
    faces, tets = pieces.faces(kept)
    assert kept[tets].all() and len(faces) == left.surface.n_faces
    assert np.array_equal(pieces.source, pieces.image)


def test_shells_are_opened_in_steps(standard):
    parts = sm.partition(standard, 3, "s")
    pieces = solids._Pieces(np.hstack([parts.solid.V, parts.image]), parts.solid.T, parts.labels)
    openings = np.array([0.0, 0.2, 0.4])
    pieces, kept = pieces.opened(0.0, openings)
    volumes = sm.TetMesh(pieces.image, pieces.T).tet_volumes
    for part, opening in enumerate(openings):
        mine = pieces.parent == part
        share = volumes[mine & kept].sum() / volumes[mine].sum()
        assert share == pytest.approx(1.0 - opening, abs=5e-3)


@pytest.mark.parametrize("by, shown", [("s", 4), ("u", 4), ("v", 4)])
def test_every_part_is_in_the_picture_of_the_levels(volume, by, shown):
    figure = plot.levels(volume, shown, by)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(labels) == shown and all(label.endswith("25 %") for label in labels)
    colors = [patch.get_facecolor()[:3] for patch in figure.legends[0].get_patches()]
    for axes in figure.axes:
        painted = axes.collections[0].get_facecolors()[:, :3]
        for color in np.array(colors):
            # Light dims a color and leaves its hue.
            dimmed = painted @ color / np.linalg.norm(painted, axis=1) / np.linalg.norm(color)
            assert (dimmed > 1.0 - 1e-9).sum() > 10


def test_landmarks_have_numbers_and_rings_where_they_are_carried(registered):
    figure = plot.registration(registered)
    for row in (figure.axes[:2], figure.axes[2:]):
        numbers = [{int(text.get_text()) for text in axes.texts} for axes in row]
        assert all(numbers) and len(numbers[0] & numbers[1]) > 0.7 * len(numbers[0])
    either = {int(text.get_text()) for axes in figure.axes for text in axes.texts}
    assert len(either) > 25
    dots, rings = (c.get_offsets() for c in figure.axes[1].collections[1:3])
    assert np.allclose(dots, rings, atol=1e-6)
    assert len(plot.registration(sm.register(registered.mesh, registered.target)).axes) == 4


def test_numbers_keep_clear_of_dots_and_of_each_other():
    dots = np.random.default_rng(3).uniform(0.1, 0.9, (25, 2))
    places = _out_of_the_way(dots)
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert gaps[~np.eye(25, dtype=bool)].min() > 0.8 * _APART
    assert np.linalg.norm(places[:, None] - dots[None], axis=2).min() > 0.5 * _APART
    assert np.linalg.norm(places - dots, axis=1).max() < 4.0 * _APART


def test_a_point_behind_a_face_is_not_seen():
    face = np.array([[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]])
    scene = Scene(View(elevation=90.0, azimuth=0.0))
    scene.add_faces(face, np.ones((1, 3)))
    points = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5], [0.9, 0.9, -0.5], [0.0, 0.0, -0.05]])
    assert scene.visible(points, 0.1).tolist() == [False, True, True, True]


def test_a_scene_can_leave_room_for_what_comes_later():
    scene = Scene(View(elevation=90.0, azimuth=-90.0))
    scene.add_faces(
        np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]), np.ones((1, 3))
    )
    axes = empty_figure(1.0, 1.0).add_subplot()
    scene.draw(axes, np.array([[-4.0, -1.0, 0.0], [6.0, 3.0, 9.0]]))
    assert np.mean(axes.get_xlim()) == pytest.approx(1.0)
    assert np.mean(axes.get_ylim()) == pytest.approx(1.0)
    assert np.ptp(axes.get_xlim()) == pytest.approx(10.6)


def test_opposite_views_see_opposite_sides():
    view = View(31.0, 17.0)
    assert np.allclose(view.opposite().axes[2], -view.axes[2])


def test_wrong_requests_are_refused(volume, area, tmp_path):
    for result in (volume, area):
        for unknown in ("portrait", ["levels"], 3):
            with pytest.raises(OptionError, match="kind must be 'checkerboard'") as refused:
                result.plot(unknown)
            named = str(refused.value).split(", got")[0]
            assert {kind for kind in plot.KINDS if repr(kind) in named} == set(plot.kinds(result))
    with pytest.raises(ArrayError, match="solid"):
        plot.cutaway(area)
    with pytest.raises(OptionError):
        plot.cutaway(volume, color="red")
    with pytest.raises(OptionError, match="no option 'by'"):
        plot.picture(volume, "cutaway", by="s")
    with pytest.raises(OptionError, match="'s', 'u' or 'v'"):
        plot.levels(volume, by="w")
    with pytest.raises(OptionError, match="even"):
        plot.checkerboard(volume, cells=(5, 4))
    with pytest.raises(FileFormatError, match="gif"):
        plot.save(plot.convergence(volume), tmp_path / "x.gif")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_saved_pictures_are_what_they_say(volume, tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    plot.save(plot.convergence(volume), path)
    start = path.read_bytes()[:5]
    assert start.startswith({".png": b"\x89PNG", ".pdf": b"%PDF-", ".svg": b"<?xml"}[suffix])


def test_pieces_cover_a_triangle_and_keep_its_orientation():
    corners = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
    pieces = subdivided(corners, 5)
    a, b, c = pieces[:, 0], pieces[:, 1], pieces[:, 2]
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert len(pieces) == 25
    assert np.allclose(areas, 0.5 / 25)
    assert pieces.min() >= 0.0 and pieces.sum(axis=2).max() <= 1.0 + 1e-12


def test_the_nearer_face_is_painted_last_and_backs_are_left_out():
    square = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    near, far = square + np.array([0.0, 0.0, 1.0]), square
    view = View(elevation=90.0, azimuth=0.0)
    colors = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    scene = Scene(view)
    scene.add_faces(np.stack([near, far, near[::-1] + np.array([0.0, 0.0, 5.0])]), colors)
    figure = empty_figure(1.0, 1.0)
    axes = figure.add_subplot()
    scene.draw(axes)
    painted = axes.collections[0].get_facecolors()
    assert len(painted) == 2
    assert painted[-1][0] > 0.0 and painted[-1][2] == 0.0


def test_axes_of_a_view_are_a_right_handed_frame():
    frame = View(31.0, 17.0).axes
    assert np.allclose(frame @ frame.T, np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1.0)
