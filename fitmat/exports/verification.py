"""Verification: a shader run over many directions, and how far its values are from the model's own.

It writes no shader; what a difference means is said by whoever exports.
"""

import base64
import dataclasses
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.errors import OutputError
from fitmat.exports.glsl import browser
from fitmat.maths.directions import from_angles, mirror, relative_azimuth, zenith
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.text import brief

PAGE = "evaluate.html", "shader.js"
"""What runs a shader, and the script in it."""

Uniforms = Mapping[str, float | Sequence[float]]
"""Values by the names of a shader's uniforms."""

SHAPE = 128, 96
"""Pixels: one for each pair of directions."""

LEAST = 1e-20
"""Values in sr⁻¹ below this count as this: numbers of single precision end at 1e-38, their products before."""

TOLERANCE = 2e-3
"""Relative difference up to which single precision explains it, for alpha from 0.01 and exponents up to 4,000."""

STEEPEST = 89.9
"""Degrees: the largest zenith angle tried."""


@dataclasses.dataclass(frozen=True, eq=False)
class Difference:
    """Of the values of an export from the model's own, |f′ − f|/f.

    Attributes:
        largest: Over all directions and channels.
        mean: Over those above the surface.
        theta_i_deg: Where it is largest.
        theta_o_deg: The same.
        phi_deg: Azimuth between the two there; 180 is the mirror side.
        count: Pairs of directions.
        beyond: How many of them are further apart than `TOLERANCE`.
        executor: Program and version.
        over: Which directions these are.
        how: What the executor did.
    """

    largest: float
    mean: float
    theta_i_deg: float
    theta_o_deg: float
    phi_deg: float
    count: int
    beyond: int
    executor: str
    over: str = "grazing and mirror peak included"
    how: str = "Executed in"

    __repr__ = brief

    @property
    def words(self) -> str:
        """The same in two sentences, each on a line."""
        place = f"theta_i {self.theta_i_deg:.1f}, theta_o {self.theta_o_deg:.1f}, phi {self.phi_deg:.0f} degrees"
        return (
            f"{self.how} {self.executor} over {self.count} directions, {self.over}.\n"
            f"Relative difference from the model at most {self.largest:.1e} ({place}), {self.mean:.1e} on average."
        )


def directions(seed: int = 0) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Pairs of directions in single precision, (n, 3): everywhere, about the mirror peak, grazing, singular, below.

    About the peak the slope of the half vector is spread evenly in its logarithm, from 10⁻⁵ to 2, so that a lobe of
    any width is met in its core and in its tail.
    """
    rng, count = np.random.default_rng(seed), SHAPE[0] * SHAPE[1]
    singular = _singular()
    even, grazing, retro = 4096, 2048, 512
    peak = count - even - grazing - retro - len(singular[0])
    tops = np.cos(np.deg2rad(STEEPEST))
    cos = np.concatenate(
        [
            rng.uniform(tops, 1.0, even + peak + retro),
            rng.uniform(tops, np.cos(np.deg2rad(80.0)), grazing),
        ]
    )
    wi = from_angles(np.arccos(cos), rng.uniform(0.0, 2.0 * np.pi, len(cos)))
    slope, turn = np.exp(rng.uniform(np.log(1e-5), np.log(2.0), len(wi))), rng.uniform(0.0, 2.0 * np.pi, len(wi))
    h = from_angles(np.arctan(slope), turn)
    wo = 2.0 * np.sum(wi * h, axis=1)[:, None] * h - wi
    wo[:even] = from_angles(np.arccos(rng.uniform(-0.02, 1.0, even)), rng.uniform(0.0, 2.0 * np.pi, even))
    back = slice(even + peak, even + peak + retro)
    wo[back] = mirror(wo[back])
    wi, wo = (np.concatenate([a, b]).astype(np.float32) for a, b in zip((wi, wo), singular, strict=True))
    return wi, wo


def _singular() -> tuple[np.ndarray, np.ndarray]:
    """Exact mirror, normal and equal directions, in and out of the planes of the axes."""
    theta, phi = np.deg2rad([0.0, 1e-3, 10.0, 45.0, 80.0, 89.0, STEEPEST]), np.deg2rad([0.0, 45.0, 90.0, 200.0])
    wi = from_angles(*(a.ravel() for a in np.meshgrid(theta, phi)))
    up = np.tile([0.0, 0.0, 1.0], (len(wi), 1))
    return np.concatenate([wi, wi, wi, up]), np.concatenate([mirror(wi), wi, up, wi])


def difference(model: AbstractBRDF, source: str) -> Difference | None:
    """How far a source's `brdf` is from its model; None without a browser.

    Args:
        model: Of one or three channels.
        source: In GLSL ES 3.00, with a function `vec3 brdf(vec3 wi, vec3 wo)`.

    Raises:
        OutputError: the browser does not run, or the source does not compile.
    """
    program = browser.program()
    if program is None:
        return None
    wi, wo = directions()
    (values,), executor = run([source], wi, wo, program)
    return compared(values, evaluate(model, *exact(wi, wo)), wi, wo, executor)


def run(
    sources: Sequence[str],
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
    program: str,
    *,
    uniforms: Sequence[Uniforms] | None = None,
) -> tuple[list[Float[np.ndarray, "n 3"]], str]:
    """Values of each source at pairs of directions in single precision, as many as `SHAPE` has, and what ran them."""
    padded = [np.pad(w, ((0, 0), (0, 1))).astype("<f4").tobytes() for w in (wi, wo)]
    each = zip(sources, uniforms or [{}] * len(sources), strict=True)
    told: dict[str, Any] = {"width": SHAPE[0], "height": SHAPE[1]}
    told["sources"] = [{"text": text, "uniforms": values} for text, values in each]
    told |= {name: base64.b64encode(w).decode("ascii") for name, w in zip(("wi", "wo"), padded, strict=True)}
    given = json.dumps(told).replace("<", "\\u003c")  # which would end the script
    page, script = (files("fitmat.exports.glsl").joinpath(name).read_text(encoding="utf-8") for name in PAGE)
    page = page.replace("SHADER", script, 1).replace("GIVEN", given, 1)
    found = json.loads(browser.written(page, program))
    for one in (found, *found.get("sources", [])):
        if "error" in one:
            raise OutputError(f"{program}: the shader cannot be run ({' '.join(one['error'].split())}).")
    pixels = [np.frombuffer(base64.b64decode(one["values"]), "<f4").reshape(-1, 3) for one in found["sources"]]
    version = re.search(r"\w*Chrom\w*/[\d.]+", found["browser"])
    return [p.astype(float) for p in pixels], version[0] if version else program


def exact(wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]) -> list[Float[np.ndarray, "n 3"]]:
    """Unit vectors in double precision of directions in single."""
    return [w / np.linalg.norm(w, axis=1)[:, None] for w in (wi.astype(float), wo.astype(float))]


def compared(
    found: Float[np.ndarray, "n 3"],
    expected: Float[np.ndarray, "n c"],
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
    executor: str,
    *,
    least: float = LEAST,
) -> Difference:
    """Values of an export beside the model's own; what is not finite differs infinitely."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(found - expected) / np.maximum(np.abs(expected), least)
    apart = np.where(np.isfinite(apart), apart, np.inf).max(axis=1)
    worst, lit = int(np.argmax(apart)), (wi[:, 2] > 0) & (wo[:, 2] > 0)
    light, eye = (w[worst : worst + 1] for w in exact(wi, wo))
    theta_i, theta_o, phi = (np.rad2deg(a[0]) for a in (zenith(light), zenith(eye), relative_azimuth(light, eye)))
    beyond = int(np.count_nonzero(apart > TOLERANCE))
    ends = float(apart[worst]), float(apart[lit].mean())
    return Difference(*ends, float(theta_i), float(theta_o), float(phi), len(wi), beyond, executor)
