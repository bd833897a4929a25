"""What a Zemax file holds is read back as the model, dense around the mirror direction."""

from pathlib import Path

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.models.base import evaluate

ANGLES = 1e-5
"""Relative; angles have 10⁻⁷ degrees, on the flank of a lobe."""


def test_each_channel_is_a_file_that_is_read_back(tmp_path: Path) -> None:
    satin = fm.model("lambert+ggx", kd=np.array([0.1, 0.3, 0.5]), ks=np.ones(3), alpha=0.2)
    light = np.deg2rad([10.0, 60.0])
    made = fm.export(satin, "zemax", tmp_path / "out", name="m", theta_i=light, step=np.deg2rad(15.0))
    assert list(made.files) == ["m-r.bsdf", "m-g.bsdf", "m-b.bsdf", "export.json"]
    assert made.difference is not None
    assert made.difference.largest < ANGLES
    for k, label in enumerate("rgb"):
        back = fm.read(tmp_path / "out" / f"m-{label}.bsdf")
        kept = back.valid.all(axis=1)
        assert kept.sum() > 200
        own = evaluate(satin, back.wi[kept], back.wo[kept])
        assert np.abs(back.value[kept, 0] / own[:, k] - 1.0).max() < ANGLES
        assert np.abs(back.value[kept, 0] / own[:, k - 1] - 1.0).max() > 0.01
        assert back.wo[kept][:, 2].min() < 0.3


def test_a_brushed_sample_is_turned(tmp_path: Path) -> None:
    brushed = fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.4, rotation=30.0)
    fm.export(brushed, "zemax", tmp_path / "out", name="m", theta_i=np.array([0.5]), step=np.deg2rad(30.0))
    back = fm.read(tmp_path / "out" / "m.bsdf")
    kept = back.valid.all(axis=1)
    assert len(np.unique(np.round(back.phi_i[kept], 6))) == 6
    assert np.abs(back.value[kept] / evaluate(brushed, back.wi[kept], back.wo[kept]) - 1.0).max() < 10 * ANGLES


def test_a_name_is_a_comment_and_nothing_else(tmp_path: Path) -> None:
    name = 'TIS 5\nDataBegin "é'
    fm.export(fm.model("lambert"), "zemax", tmp_path / "out", name=name, step=np.deg2rad(30.0))
    (file,) = (tmp_path / "out").glob("*.bsdf")
    assert np.allclose(fm.read(file).value[fm.read(file).valid], 0.5 / np.pi)
    with pytest.raises(FitmatError, match=r"step .*0\.1 to 45 degrees"):
        fm.export(fm.model("lambert"), "zemax", step=5.0)
