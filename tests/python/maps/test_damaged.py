"""Damaged and forged map files are told, whatever is wrong with them."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

import stretchmap as sm
from shapes import torus
from stretchmap.errors import FileFormatError, StretchmapError

V, F = torus()
SOUND = {"V": V, "F": F, "image": 2.0 * V, "torus": np.array([2.0, 0.8])}
RECORD = {
    "stage": "sem", "iteration": 1, "energy": 2.0, "step": 1.0, "residual": None, "flips": 0,
    "ring_std": 0.25, "element_std": 0.5, "seconds": 1.0,
}  # fmt: skip


def packed(**arrays):
    file = io.BytesIO()
    np.savez_compressed(file, **SOUND | arrays)
    return file.getvalue()


@pytest.mark.parametrize(
    "meta",
    [
        "{", "[]", "3", '"text"', "[" * 100_000, '{"a": ' * 2000 + "1" + "}" * 2000,
        '{"a": NaN}', '{"seconds": 3}', '{"seconds": {"a": "b"}}', '{"seconds": {"a": true}}',
        '{"kind": ["map"]}', '{"converged": "yes"}', '{"stop_reason": {}}', '{"history": 3}',
        '{"added_vertices": "3"}', '{"added_vertices": -1}', '{"boundary_splits": 1.5}',
        '{"history": [3]}', '{"history": [{}]}', '{"history": {"a": 1}}',
        json.dumps({"history": [RECORD | {"iteration": "one"}]}),
        json.dumps({"history": [RECORD | {"flips": 0.5}]}),
        json.dumps({"history": [RECORD | {"energy": "low"}]}),
        json.dumps({"history": [RECORD | {"stage": None}]}),
    ],
)  # fmt: skip
def test_forged_scalars(tmp_path, meta):
    path = tmp_path / "map.npz"
    path.write_bytes(packed(meta=np.array(meta)))
    with pytest.raises(FileFormatError, match=r"map\.npz"):
        sm.load_map(path)


def test_sound_scalars(tmp_path):
    path = tmp_path / "map.npz"
    path.write_bytes(packed(meta=np.array(json.dumps({"history": [RECORD], "mine": {"a": [1]}}))))
    loaded = sm.load_map(path)
    assert loaded.history[0].energy == 2.0 and loaded.to_dict()["mine"] == {"a": [1]}
    assert "mine" in loaded.summary()


@pytest.mark.parametrize(
    "arrays",
    [
        {"torus": np.array([1.0, 2.0])}, {"torus": np.array(["a", "b"])}, {"torus": np.ones(3)},
        {"angles": np.ones((3, 2))}, {"angles": np.full((len(V), 2), np.nan)},
        {"image": V.astype("U8")}, {"image": V[1:]}, {"image": V + 1j}, {"meta": np.ones(3)},
        {"V": np.array(b"points")}, {"F": F.astype(float)}, {"F": F + 1000},
    ],
)  # fmt: skip
def test_arrays_that_are_no_map(tmp_path, arrays):
    path = tmp_path / "map.npz"
    path.write_bytes(packed(**arrays))
    with pytest.raises(StretchmapError):
        sm.load_map(path)


def test_cut_and_changed_bytes(tmp_path):
    """Wherever a byte is lost or changed: the file is refused, or means what it did."""
    data = packed(meta=np.array(json.dumps({"history": [RECORD]})))
    path = tmp_path / "map.npz"
    rng = np.random.default_rng(0)
    cases = [data[:k] for k in rng.integers(0, len(data), 60)]
    for k in rng.integers(0, len(data), 400):
        cases.append(data[:k] + bytes([data[k] ^ int(rng.integers(1, 256))]) + data[k + 1 :])
    refused = 0
    for case in cases:
        path.write_bytes(case)
        try:
            loaded = sm.load_map(path)
        except StretchmapError:
            refused += 1
            continue
        assert np.array_equal(loaded.image, SOUND["image"])
        assert np.array_equal(loaded.mesh.V, V)
    assert refused > 300


def test_an_archive_that_claims_more_than_there_is_memory(tmp_path):
    path = tmp_path / "bomb.npz"
    path.write_bytes(packed())
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("more.npy", b"")
        archive.getinfo("more.npy").file_size = 1 << 50
    for read in (sm.load_map, sm.read, sm.certify_file):
        with pytest.raises(FileFormatError, match="more than there is memory"):
            read(path)
