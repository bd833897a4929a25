"""Ctrl-C of a texture: real signals to a real process, whose compiled calls are sleeps that nothing ends."""

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fitmat.batches import textures
from fitmat.batches.textures import fit_texture

SLEEPING = """
import sys, time

from fitmat.batches import textures
from fitmat.fitting.many.tiles import Work


def compiled(*_):
    print("computing", flush=True)
    time.sleep(60.0)


Work.fitted = compiled
textures.TILE = int(sys.argv.pop(1))
from fitmat.cli.main import main

main()
"""

SOON = 2.0
"""Seconds in which a command is to end."""

PATIENCE = 120
"""Seconds after which the test gives up."""

POINTS = 12


@pytest.fixture
def atlas(tmp_path: Path) -> Path:
    """Points of a Lambertian surface with a gloss that no formula made."""
    theta_o = np.linspace(-70.0, 75.0, 16)
    value = 0.1 + 0.2 * np.exp(-(((theta_o - 30.0) / 15.0) ** 2)) * np.linspace(1.0, 2.0, POINTS)[:, None]
    np.savez(tmp_path / "atlas.npz", value=value[..., None], theta_i=np.array(30.0), theta_o=theta_o)
    return tmp_path / "atlas.npz"


@pytest.mark.parametrize(("times", "kept"), [(1, 0), (1, 1), (2, 0)])
def test_ctrl_c_is_answered_soon_and_the_sentence_is_true(times: int, kept: int, atlas: Path, tmp_path: Path) -> None:
    """Once or twice, with a tile of six points that is kept already, or with none."""
    out, tile = tmp_path / "out", 6
    if kept:
        _leave_one_tile(atlas, out, tile)
    told = ["batch", str(atlas), "--out", str(out), "--models", "lambert", "--processes", "2"]
    command = [sys.executable, "-c", SLEEPING, str(tile), *told]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "computing\n"
            time.sleep(0.2)
            begun = time.monotonic()
            for _ in range(times):
                process.send_signal(signal.SIGINT)
                time.sleep(0.005)
            said = process.communicate(timeout=PATIENCE)[1]
            took = time.monotonic() - begun
        finally:
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in said
    assert took < SOON
    parts = list(out.glob("parts/*"))
    assert len(parts) == kept
    if times == 1:
        sentence = (
            f"fitmat: interrupted; 6 points are kept in {out}: the same command goes on."
            if kept
            else "fitmat: interrupted; this run kept no points, which it does 6 at a time."
        )
        assert said.splitlines()[-1] == sentence
        assert not list(out.glob(".fitmat-*"))
    else:
        assert "fitmat: interrupted" in said


def _leave_one_tile(atlas: Path, out: Path, tile: int) -> None:
    """As a run does that ends after its first tile."""
    calls = iter([textures.fit_many])

    def once(*given: Any, **told: Any) -> Any:
        for fit_many in calls:
            return fit_many(*given, **told)
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(textures, "TILE", tile)
        patch.setattr(textures, "fit_many", once)
        with pytest.raises(KeyboardInterrupt):
            fit_texture(atlas, out, "lambert", loss="default", masking=None, fixed={})
