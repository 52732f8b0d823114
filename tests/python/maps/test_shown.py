"""What notebooks and the interpreter show of results."""

from __future__ import annotations

import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.base.tables import html
from stretchmap.errors import OptionError


@pytest.fixture(scope="module")
def result():
    return sm.volume_map(samples.bumpy_torus(1500))


def test_the_interpreter_shows_one_short_line(result):
    shown = repr(result)
    assert shown.startswith("VolumeMap(") and "tets" in shown and "converged" in shown
    assert len(shown) < 100 and len(repr(sm.conformal_map(result.mesh.surface))) < 100


def test_every_result_is_one_short_line(result):
    solid, surface = result.mesh, result.mesh.surface
    energy = sm.energies.VolumeStretch(solid)
    everything = (
        *(solid, surface, result, result.certificate, result.distortion, result.torus),
        *(sm.partition(result, 3), sm.homology_basis(surface, solid), solid.diagnose()),
        *(sm.compare(solid, {"here": result}), sm.hex_mesh(result, sections=12), sm.morph(result)),
        *(sm.harmonic_forms(surface), sm.holomorphic_forms(surface)),
        *(energy, energy.elements(solid.V, 0)),
    )
    for item in everything:
        shown = repr(item)
        assert shown.startswith(type(item).__name__ + "(") and "\n" not in shown
        assert len(shown) < 100, shown
    assert repr(result.certificate) == "Certificate(certified)"
    assert "not certified: " in repr(sm.certify(solid, -solid.V))


def test_notebooks_show_tables(result):
    parts = sm.partition(result, 3)
    basis = sm.homology_basis(result.mesh.surface)
    diagnosis = result.mesh.diagnose()
    comparison = sm.compare(result.mesh, {"here": result})
    everything = (result, result.distortion, result.certificate, parts, basis, diagnosis)
    for item in (*everything, comparison, result.mesh, result.mesh.surface):
        shown = item._repr_html_()
        assert shown.startswith("<table>") and shown.endswith("</table>")
        assert shown.count("<tr>") == shown.count("</tr>") >= 2
    assert "<th>flips</th><td>0</td>" in result._repr_html_()


def test_names_of_a_user_do_not_become_markup():
    assert "<b>" not in html("<b>bold</b>  1")


def test_a_map_draws_itself(result):
    pytest.importorskip("matplotlib")
    for kind in ("ratios", "convergence"):  # one after the other: no module may take a name over
        drawn = result.plot(kind)
        assert drawn.axes and drawn._repr_png_().startswith(b"\x89PNG")
    first = [axes.get_title() for axes in result.plot(sm.plot.kinds(result)[0]).axes]
    assert [axes.get_title() for axes in result.plot().axes] == first
    with pytest.raises(OptionError, match="kind must be"):
        result.plot("portrait")
