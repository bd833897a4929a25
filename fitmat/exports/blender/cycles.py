"""Cycles: a material run in Blender, where there is one, as facets under a sun, and what they send to the eye.

It knows no material: code goes in that makes one, values come out.
"""

import json
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fitmat.errors import OutputError
from fitmat.exports.verification import Difference, compared
from fitmat.maths.directions import from_angles
from fitmat.models.base import AbstractBRDF, evaluate

SUNS, SIZE = 12, 32
"""Angles between light and eye, and facets a side of a picture under each."""

LEAST = 1e-7
"""Values in sr⁻¹ below this count as this: Cycles drops light from a sun that adds less."""

LOWEST = 3e-3
"""Cosine of the largest zenith angle, 89.83°."""

PATIENCE = 600.0
"""Seconds after which it is stopped."""

Facets = tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k n 4 3"]]


def program() -> str | None:
    """The path of Blender; None where there is none."""
    return shutil.which("blender")


def facets(seed: int = 0) -> Facets:
    """Directions to suns, (k, 3), and the corners of facets under each, (k, n, 4, 3), in single precision.

    The eye is at +z and sees each facet fill one unit square. A third of the normals lie anywhere between light and
    eye, a third about the half vector, slopes evenly in their logarithm from 10⁻³ to 2, a third is grazing for one.
    """
    rng, count = np.random.default_rng(seed), SIZE * SIZE
    angle = np.deg2rad(np.concatenate([[0.0, 2.0], np.linspace(15.0, 170.0, SUNS - 2)]))
    light = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    place = np.arange(SIZE) - 0.5 * (SIZE - 1.0)
    middle = np.stack([a.ravel() for a in np.meshgrid(place, place)], axis=1)
    corner = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    every = []
    for sun in light:
        n = _normals(rng, sun, count)
        height = -(n[:, None, :2] * corner).sum(axis=2) / n[:, 2:]
        flat = middle[:, None] + corner
        every.append(np.concatenate([flat, height[..., None]], axis=2))
    return light, np.array(every).astype(np.float32)


def _normals(rng: np.random.Generator, sun: np.ndarray, count: int) -> Float[np.ndarray, "n 3"]:
    """Unit normals that see the sun and the eye."""
    eye, many = np.array([0.0, 0.0, 1.0]), 20 * count
    half = (sun + eye) / np.linalg.norm(sun + eye)
    side = np.array([0.0, 1.0, 0.0])
    peak, light = (np.stack([np.cross(side, w), side, w]) for w in (half, sun))
    cosine = rng.uniform(-1.0, 1.0, many), rng.uniform(LOWEST, 0.17, many), rng.uniform(LOWEST, 0.17, many)
    slope = np.exp(rng.uniform(np.log(1e-3), np.log(2.0), many))
    anywhere, low, lower = (from_angles(np.arccos(c), rng.uniform(0.0, 2.0 * np.pi, many)) for c in cosine)
    about = from_angles(np.arctan(slope), rng.uniform(0.0, 2.0 * np.pi, many)) @ peak
    every = np.stack([anywhere, about, low, about, lower @ light, anywhere], axis=1).reshape(-1, 3)
    return every[(every @ eye > LOWEST) & (every @ sun > LOWEST)][:count]


def frames(light: Float[np.ndarray, "k 3"], corners: Float[np.ndarray, "k n 4 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Directions to light and eye in the frame of each facet, (kn, 3), its tangent along its first edge."""
    along, across = (corners[:, :, k].astype(float) - corners[:, :, 0] for k in (1, 3))
    n = np.cross(along, across)
    n /= np.linalg.norm(n, axis=2)[..., None]
    t = along / np.linalg.norm(along, axis=2)[..., None]
    frame = np.stack([t, np.cross(n, t), n], axis=2)
    wi = np.einsum("knij,kj->kni", frame, light).reshape(-1, 3)
    return wi, frame[..., 2].reshape(-1, 3)


def run(code: str, beside: Mapping[str, str] | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """Values in sr⁻¹ of a material at pairs of directions, these, (n, 3) each, and what ran it; needs Blender.

    Args:
        code: Python for Blender that makes `material`; `FOLDER` is where what is beside it lies.
        beside: File names → texts.

    Raises:
        OutputError: Blender does not end well.
    """
    light, corners = facets()
    found = program()
    with tempfile.TemporaryDirectory(prefix="fitmat-blender-") as name:
        folder = Path(name)
        for file, text in (beside or {}).items():
            (folder / file).write_text(text, encoding="utf-8")
        np.save(folder / "facets.npy", corners)
        told = {"code": code, "size": SIZE, "lights": light.tolist()}
        (folder / "told.json").write_text(json.dumps(told), encoding="utf-8")
        script = str(files("fitmat.exports.blender").joinpath("scene.py"))
        command = [str(found), "--background", "--factory-startup", "--python", script, "--", name]
        _ended(command)
        if not (folder / "values.npy").exists():
            raise OutputError(f"{found} made no values of the material. Leave it out with --no-verify.")
        values = np.load(folder / "values.npy").reshape(-1, 3)
        version = (folder / "version").read_text()
    wi, wo = frames(light, corners)
    return values / wi[:, 2:], wi, wo, f"Blender {version}, Cycles"


def _ended(command: list[str]) -> None:
    """Runs a command to its end."""
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise OutputError(f"{command[0]} cannot run the material ({error}); leave it out with --no-verify.") from error
    if ended.returncode:
        last = " ".join(ended.stderr.strip().splitlines()[-1:])
        raise OutputError(f"{command[0]} cannot run the material ({last}); leave it out with --no-verify.")


def difference(model: AbstractBRDF, code: str, beside: Mapping[str, str] | None = None) -> Difference | None:
    """How far Cycles' values of a material are from a model's; None without Blender."""
    if program() is None:
        return None
    values, wi, wo, executor = run(code, beside)
    return compared(values, evaluate(model, wi, wo), wi, wo, executor, least=LEAST)
