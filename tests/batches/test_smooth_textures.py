"""Smoothed textures: the file and the maps hold what the arrays give, nothing is fitted again, files have none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import fitmat as fm
from fitmat.batches import textures
from fitmat.batches.textures import fit_texture
from fitmat.cli.application import app
from fitmat.errors import FitmatError, OutputError

SAMPLES, SHAPE = 20, (6, 7)

TOLD: dict[str, Any] = {"loss": "gaussian", "fixed": {"ks": 1.0, "eta": 1.5}}


@pytest.fixture
def atlas(tmp_path: Path) -> Path:
    """Roughness grows to the right, as does noise; two points were not measured."""
    rng = np.random.default_rng(1)
    theta_o = np.linspace(-60.0, 75.0, SAMPLES)
    wi, wo = fm.directions(np.full(SAMPLES, 30.0), degrees=True), fm.directions(theta_o, 180.0, degrees=True)
    value = np.empty((*SHAPE, SAMPLES, 1))
    for row, column in np.ndindex(*SHAPE):
        made = fm.model("lambert+ggx", channels=1, kd=0.3 + 0.02 * row, alpha=0.2 + 0.02 * column, eta=1.5)
        value[row, column] = fm.evaluate(made, wi, wo)
    sigma = 0.1 * value
    value += sigma * rng.normal(size=value.shape)
    value[2, 3:5] = np.nan
    path, told = tmp_path / "atlas.npz", {"theta_i": np.array(30.0), "theta_o": theta_o}
    np.savez(path, value=value, sigma=sigma, **told)
    return path


def arrays(atlas: Path) -> Any:
    with np.load(atlas) as kept:
        return dict(kept)


def test_the_file_holds_what_the_arrays_give(atlas: Path, tmp_path: Path) -> None:
    told = arrays(atlas)
    wi = fm.directions(np.full(SAMPLES, 30.0), degrees=True)
    wo = fm.directions(told["theta_o"], 180.0, degrees=True)
    direct = fm.fit_many(wi, wo, told["value"], sigma=told["sigma"], smooth="alpha", **TOLD)
    found = fit_texture(atlas, tmp_path / "out", smooth=["alpha"], **TOLD)
    kept = arrays(tmp_path / "out" / "texture.npz")
    np.testing.assert_array_equal(kept["alpha"], direct["alpha"])
    np.testing.assert_array_equal(kept["alpha_smooth"], direct.smoothed["alpha"].value)
    np.testing.assert_array_equal(kept["alpha_smooth_sd"], direct.smoothed["alpha"].sd)
    assert np.argwhere(kept["alpha_inferred"]).tolist() == [[2, 3], [2, 4]]
    assert "kd_smooth" not in kept
    assert str(direct.smoothed["alpha"]) in str(found)


def test_maps_are_drawn_from_smoothed_values(atlas: Path, tmp_path: Path) -> None:
    """Points that were not measured have what neighbours tell; of kd, which is not smoothed, the median."""
    found = fit_texture(atlas, tmp_path / "out", smooth="alpha", **TOLD)
    smooth = found.fits.smoothed["alpha"].value
    rough = np.asarray(Image.open(found.maps[1]), float)[..., 1] / 255.0
    np.testing.assert_allclose(rough**2, smooth, atol=0.005)
    assert np.abs(rough**2 - found.fits["alpha"])[found.fits.result == "converged"].max() > 0.02
    base = np.asarray(Image.open(found.maps[0]), float)[..., 0] / 255.0
    decoded = np.where(base <= 0.04045, base / 12.92, ((base + 0.055) / 1.055) ** 2.4)
    there = found.fits.result == "converged"
    np.testing.assert_allclose(decoded[there], found.fits["kd"][there, 0], atol=0.005)
    np.testing.assert_allclose(decoded[2, 3:5], np.median(found.fits["kd"][there, 0]), atol=0.005)


def test_nothing_is_fitted_again(atlas: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder's result is another, which takes force; the tiles are not."""
    out = tmp_path / "out"
    plain = fit_texture(atlas, out, **TOLD)
    monkeypatch.setattr(textures, "fit_many", None)
    with pytest.raises(OutputError, match="which would be lost"):
        fit_texture(atlas, out, smooth="alpha", **TOLD)
    found = fit_texture(atlas, out, smooth="alpha", force=True, **TOLD)
    assert found.earlier == np.prod(SHAPE)
    np.testing.assert_array_equal(found.fits.values, plain.fits.values)
    assert fit_texture(atlas, out, smooth="alpha", **TOLD).earlier == np.prod(SHAPE)
    assert fit_texture(atlas, out, force=True, **TOLD).earlier == np.prod(SHAPE)
    assert "alpha_smooth" not in arrays(out / "texture.npz")


def test_the_command_smooths_and_says_so(atlas: Path, tmp_path: Path) -> None:
    words = [
        "batch",
        str(atlas),
        "--loss",
        "gaussian",
        "--fix",
        "ks=1",
        "--fix",
        "eta=1.5",
        "--out",
        str(tmp_path / "out"),
    ]
    ran = CliRunner().invoke(app, [*words, "--smooth", "alpha"])
    assert ran.exit_code == 0, ran.output
    assert "alpha, smoothed: neighbours are taken to differ by" in ran.output
    last = (
        "texture.mtlx, of the smoothed alpha; 2 of 42 points, whose fits are not determined, have the others' median of"
    )
    assert f"{last} kd in them" in " ".join(ran.output.split())
    both = CliRunner().invoke(app, [*words, "--smooth", "alpha,kd", "--force"])
    assert both.output.rstrip().endswith("texture.mtlx, of the smoothed kd, alpha")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("ks", r"smooth ks \(--smooth\): it is held"),
        ("etta", r"smooth etta \(--smooth\): no model of lambert\+ggx has it"),
    ],
)
def test_what_cannot_be_smoothed_is_said_before_anything(names: str, message: str, atlas: Path, tmp_path: Path) -> None:
    with pytest.raises(FitmatError, match=message):
        fit_texture(atlas, tmp_path / "out", smooth=names, **TOLD)
    assert not (tmp_path / "out").exists()


def test_files_and_points_have_no_neighbours(atlas: Path, tmp_path: Path) -> None:
    told = arrays(atlas)
    told |= {name: told[name].reshape(-1, SAMPLES, 1) for name in ("value", "sigma")}
    np.savez(atlas, **told)
    with pytest.raises(FitmatError, match=r"smooth alpha .*42 surfaces have no rows and columns"):
        fit_texture(atlas, tmp_path / "out", smooth="alpha", **TOLD)
    refused = CliRunner().invoke(app, ["batch", str(tmp_path / "a.csv"), "--smooth", "alpha"])
    assert refused.exit_code == 1
    assert "--smooth alpha for files, expected a texture (.npz, .zarr) or --lights" in str(refused.exception)
