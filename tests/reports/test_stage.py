"""What a page has for the ball, of fits of all kinds; and a real page in Chromium."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.exports.glsl import browser
from fitmat.models.around.shown import surface
from fitmat.models.parameters import vector
from fitmat.reports import ball
from fitmat.studies.findings import find
from fitmat.studies.study import Study

ANGLES = np.deg2rad([10.0, 40.0, 60.0]), np.deg2rad(np.arange(-75.0, 76.0, 15.0))


def data(truth: str, fitted: str, channels: int = 1, **told: Any) -> tuple[fm.Fit, dict[str, Any]]:
    """A fit to a simulated surface, and what a page has for its ball, as JSON gives it back."""
    model = fm.model(truth, channels=channels)
    made = fm.simulate(model, *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    fit = fm.fit(made, fitted, **told)
    posterior = fm.laplace(fit, seed=0)
    return fit, json.loads(json.dumps(ball.data(Study((find(posterior, ()),))), allow_nan=False))


@pytest.mark.study
def test_sliders_begin_at_the_fit_and_hold_the_interval() -> None:
    """One number for each slider's place in the vector; ranges hold fit and interval; draws spread about the fit."""
    fit, found = data("lambert+ggx", "lambert+ggx", channels=3)
    (model,) = found["models"]
    assert model["fit"] == pytest.approx(vector(surface(fit.model)), rel=1e-6)
    places = [p["start"] + k for p in model["parameters"] for k in range(len(p["channels"]))]
    assert places == list(range(len(model["fit"])))
    draws = np.array(model["draws"])
    assert draws.shape == (ball.DRAWS, len(model["fit"]))
    for p in model["parameters"]:
        for k, (low, high) in enumerate(p["intervals"]):
            value, drawn = model["fit"][p["start"] + k], draws[:, p["start"] + k]
            assert p["low"] <= low <= value <= high <= p["high"], p["symbol"]
            assert 0.7 < np.mean((drawn >= low) & (drawn <= high)) <= 1.0, p["symbol"]
    assert np.array(found["colours"]).reshape(3, 3) == pytest.approx(np.eye(3), abs=2e-3)
    assert (found["channels"], found["why"]) == (["r", "g", "b"], [])


@pytest.mark.study
def test_the_middle_of_many_channels_is_drawn_grey() -> None:
    fit, found = data("lambert", "lambert", channels=31)
    (model,) = found["models"]
    assert model["fit"] == pytest.approx([vector(fit.model)[15]], rel=1e-6)
    assert found["words"] == "Colours: 16 of 31 channels, drawn grey."
    assert np.array(found["colours"]).reshape(3, 3).sum(axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=2e-3)


@pytest.mark.study
def test_what_cannot_be_moved_or_drawn_is_said() -> None:
    """Numbers that a shader holds; a mount, which is no part of the material; a loss without a posterior."""
    _, found = data("ggx", "ggx-kc")
    (model,) = found["models"]
    assert model["held"] == "The shader holds numbers made from alpha, eta: fixed at the fit, and no draws."
    assert model["draws"] == []
    assert [p["uniform"] for p in model["parameters"]] == ["ggx_kc_ks", None, None]
    _, found = data("lambert", "lambert", loss="log10")
    (model,) = found["models"]
    assert (model["draws"], model["held"]) == ([], "")
    assert model["parameters"][0]["intervals"] == [[model["fit"][0]] * 2]


@pytest.mark.study
def test_a_real_page_draws_ball_and_lobes(tmp_path: Path) -> None:
    """Without a word in the browser's console: its policy allows the scripts, and nothing fails."""
    if (program := browser.program()) is None:
        pytest.skip("no Chromium: pages are opened where a program called chromium or chrome is found")
    made = fm.simulate(fm.model("lambert+ggx", channels=3), *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    page = fm.report(fm.study(made, ["lambert+blinn-phong", "lambert+ggx"], sampling=False), tmp_path / "run")
    flags = (
        *browser.FLAGS,
        "--window-size=1280,6000",
        "--enable-logging=stderr",
        f"--user-data-dir={tmp_path}/profile",
    )
    ended = subprocess.run([program, *flags, page.as_uri()], capture_output=True, timeout=300, check=True)
    shown, logged = ended.stdout.decode(), ended.stderr.decode("utf-8", "replace")
    assert re.findall(r".*CONSOLE.*", logged) == []
    section = re.search(r'<section id="ball"( hidden)?.*?</section>', shown, re.DOTALL)
    assert section is not None
    assert section[1] is None
    assert section[0].count("<canvas") == 8
    assert section[0].count("<polyline") == 2
    assert section[0].count("<circle") > 2 * 30
    assert section[0].count('type="range"') == 7 + 8 + 1 + 1 + 4 + 2 + 1 + 2
    assert "Exposure ×" in section[0]
