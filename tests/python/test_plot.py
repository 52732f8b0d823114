"""Pictures: what they show is checked on the artists, and that nothing overlaps on the canvas."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import plot, samples
from stretchmap._painting import Scene, View, subdivided
from stretchmap.errors import ArrayError, FileFormatError, OptionError
from stretchmap.results import IterationRecord

matplotlib = pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def volume():
    return sm.volume_map(samples.bumpy_torus(2500), max_iter=5)


@pytest.fixture(scope="module")
def area():
    return sm.area_map(samples.bumpy_torus(2500).surface)


def texts(figure):
    """Bounding boxes of all text that is drawn, with its content."""
    figure.canvas.draw()
    shown = []
    for axes in figure.axes:
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
def test_no_text_overlaps_or_leaves_the_page(volume, area, kind):
    for result in (volume, area):
        if kind == "cutaway" and result is area:
            continue
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
    sd = volume.distortion.element_sd
    assert labels[0].startswith("harmonic map") and labels[1].startswith(f"final map: SD {sd:.3g}")
    for patch in figure.axes[0].patches[1::2]:
        outline = patch.get_xy()
        heights = outline[1:-1:2, 1]
        assert heights.sum() == pytest.approx(100.0, abs=1e-6)


def test_ratios_before_are_those_of_the_harmonic_map(volume):
    before, name = plot._ratios_before(volume)
    frozen = sm.volume_map(
        volume.solid, c=0.0, max_iter=0, start=volume.image, torus=volume.torus
    ).distortion
    assert name == "harmonic map"
    assert np.average(before, weights=volume.solid.tet_volumes) == pytest.approx(1.0)
    # With no step at all the map is what we gave, not the harmonic one, which preserves less.
    assert frozen.element_sd < before.std()


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


def test_wrong_requests_are_refused(volume, area, tmp_path):
    with pytest.raises(OptionError, match="known are"):
        plot.picture(volume, "portrait")
    with pytest.raises(ArrayError, match="solid"):
        plot.cutaway(area)
    with pytest.raises(OptionError):
        plot.cutaway(volume, colour="red")
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
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    scene = Scene(view)
    scene.add_faces(np.stack([near, far, near[::-1] + np.array([0.0, 0.0, 5.0])]), colours)
    figure = plot._figure(1.0, 1.0)
    axes = figure.add_subplot()
    scene.draw(axes)
    painted = axes.collections[0].get_facecolors()
    assert len(painted) == 2
    assert painted[-1][0] > 0.0 and painted[-1][2] == 0.0


def test_axes_of_a_view_are_a_right_handed_frame():
    frame = View(31.0, 17.0).axes
    assert np.allclose(frame @ frame.T, np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1.0)
