"""Radiance: the closest plastic or metal, whose lobe is Ward's with the bounded albedo, and rtrace's own values of it.

Holds no Fresnel term and no masking, as Radiance's rough materials have none.
"""

import importlib.util
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.errors import OutputError
from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import fraction, tangent
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.maths.directions import above
from fitmat.models.base import AbstractBRDF, AbstractLobe, evaluate
from fitmat.models.lobes.ward import WardBounded
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import AbstractRoughness, Anisotropic, Isotropic

WIDE, HIGH, RADIUS, SUN = 1000.0, 0.01, 1e-3, 0.01
"""Metres: of the box with the facets that are lit, of the eye above each, of a facet; degrees of the sun."""

LEAST = 1e-6
"""Values in sr⁻¹ below this count as this: Radiance leaves out highlights that are not worth using."""

PLANE = "(ux uy uz) of plastic2 and metal2 is azimuth 0 on a surface that faces +z; elsewhere put its tangent there."

OPTIONS = "-h -ab 0 -aa 0 -av 0 0 0 -dj 0 -ds 0 -dt 0 -dc 1 -st 1 -ss 0 -lr 0 -lw 0 -fad"
"""Of rtrace: nothing but the sun, no sampling."""


class WardMaterial(AbstractLobe):
    """Radiance's plastic and metal, and with two slopes plastic2 and metal2.

    f = c (1 − s)/π + s (1 + m (c − 1)) W,  W = exp(−tan²θ_h (cos²φ_h/α_u² + sin²φ_h/α_v²)) |H|²/(π α_u α_v (n·H)⁴)

    m is 0 for plastic, whose highlight is white, and 1 for metal.

    Parameters: color c, 0 to 1, per channel; specularity s, 0 to 1; metal m; alpha, or alpha_x, alpha_y and rotation.

    Reference: G. Ward, Radiance, src/rt/normal.c and aniso.c ("new W-G-M-D model").
    """

    label: ClassVar[str] = "radiance{roughness.suffix}"

    color: Spectrum = param(0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="RGB of the material")
    specularity: Scalar = fraction("s", 0.05, (0.03, 0.3, 0.9), "share of the light in the highlight")
    metal: Scalar = fraction("m", 0.0, (0.0,), "0 is plastic, 1 metal")
    roughness: AbstractRoughness = eqx.field(default_factory=Isotropic)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The diffuse part and the highlight."""
        white: dict[str, Any] = {"ks": jnp.ones(())}
        tint = self.specularity * (1.0 + self.metal * (self.color - 1.0))
        mirror = WardBounded(**white, roughness=self.roughness)(wi, wo)
        diffuse = self.color * (1.0 - self.specularity) / jnp.pi
        return jnp.where(above(wi, wo), diffuse + tint * mirror, 0.0)

    def width(self) -> Scalar:
        """The smaller slope."""
        return self.roughness.width()


def translated(chosen: Chosen) -> Closest:
    """The closest plastic or metal.

    Raises:
        ModelError: neither 1 nor 3 channels.
    """
    isotropic = chosen.model.isotropic
    held = {} if isotropic else {"rotation": tangent(chosen.model)}
    given: dict[str, Any] = {"color": np.full(coloured(chosen, "Radiance"), 0.5)}
    into = WardMaterial(**given, roughness=Isotropic() if isotropic else Anisotropic())
    return closest(chosen, into, [held | {"metal": metal} for metal in (0.0, 1.0)])


def primitive(found: AbstractBRDF | Closest, name: str = "material", frame: np.ndarray | None = None) -> str:
    """The material in Radiance's words.

    Args:
        found: A `WardMaterial`, or the closest.
        name: Identifier.
        frame: Axes of the surface in the world, (3, 3); None for those of the world.
    """
    model = found.model if isinstance(found, Closest) else found
    assert isinstance(model, WardMaterial)
    kind, rough = ("metal" if float(model.metal) else "plastic"), model.roughness
    numbers = [*np.broadcast_to(np.asarray(model.color), (3,)).tolist(), float(model.specularity)]
    if isinstance(rough, Anisotropic):
        turned = np.deg2rad(float(rough.rotation))
        axis = np.array([np.cos(turned), np.sin(turned), 0.0]) @ (np.eye(3) if frame is None else frame)
        numbers += [float(rough.alpha_x), float(rough.alpha_y)]
        kind, words = f"{kind}2", f"4 {' '.join(f'{x:.12g}' for x in axis)} ."
    else:
        numbers, words = [*numbers, float(rough.slopes[0])], "0"
    return f"void {kind} {name}\n{words}\n0\n{len(numbers)} {' '.join(map(repr, numbers))}\n"


def texts(name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
    """File names → texts: the material, called `material`."""
    lines = [*header, *([] if found.model.isotropic else [PLANE]), *found.intervals]
    return {f"{name}.rad": "".join(f"# {line}\n" for line in lines) + "\n" + primitive(found)}


def program() -> tuple[Path, Mapping[str, str]] | None:
    """The folder of rtrace and oconv, and what they need in the environment; None where there are none."""
    found = shutil.which("rtrace")
    if found is not None:
        return Path(found).parent, {}
    wheel = importlib.util.find_spec("pyradiance")
    if wheel is None or wheel.origin is None:
        return None
    place = Path(wheel.origin).parent
    return (place / "bin", {"RAYPATH": f".:{place / 'lib'}"}) if (place / "bin" / "rtrace").exists() else None


def difference(chosen: Chosen, found: Closest) -> Difference | None:
    """How far Radiance's values are from the model's; None without rtrace."""
    if program() is None:
        return None
    wi, wo = directions()
    values, executor = run(lambda name, frame: primitive(found, name, frame), *exact(wi, wo))
    return compared(values, evaluate(chosen.model, *exact(wi, wo)), wi, wo, executor, least=LEAST)


def run(
    words: Callable[[str, Float[np.ndarray, "3 3"]], str],
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
    *,
    beside: Mapping[str, str] | None = None,
) -> tuple[Float[np.ndarray, "n 3"], str]:
    """rtrace's values at pairs of directions: facets far apart, each turned so that one sun at +z is in its wi.

    Args:
        words: Identifier, and the axes of a facet in the world as rows → its material in Radiance's words.
        wi: Directions to the light.
        wo: Directions to the eye.
        beside: File names → texts, where the material looks for them.

    Raises:
        OutputError: a program does not end well.
    """
    found = program()
    assert found is not None
    frame = _frames(wi)
    place = np.random.default_rng(0).uniform(0.0, WIDE, wi.shape)
    eye = np.einsum("nij,nj->ni", frame, wo)
    omega = 4.0 * math.pi * math.sin(math.radians(SUN) / 4.0) ** 2
    scene = f"void light sun\n0\n0\n3{f' {1.0 / omega!r}' * 3}\nsun source sky\n0\n0\n4 0 0 1 {SUN}\n"
    for k, axes in enumerate(np.swapaxes(frame, 1, 2)):
        facet = f"facet{k}\n0\n0\n8 {_said(place[k])} {_said(axes[2])} 0 {RADIUS}\n"
        scene += f"{words(f'material{k}', axes)}material{k} ring {facet}"
    rays = "".join(f"{_said(p + HIGH * w)} {_said(-w)}\n" for p, w in zip(place, eye, strict=True))
    folder, more = found
    with tempfile.TemporaryDirectory(prefix="fitmat-radiance-") as name:
        for file, text in ({"scene.rad": scene} | dict(beside or {})).items():
            (Path(name) / file).write_text(text, encoding="utf-8")
        tree = Path(name) / "scene.oct"
        tree.write_bytes(_ended([folder / "oconv", "scene.rad"], b"", more, name))
        told = _ended([folder / "rtrace", *OPTIONS.split(), tree], rays.encode("ascii"), more, name)
        version = _ended([folder / "rtrace", "-version"], b"", more, name).decode("utf-8", "replace").split()[:2]
    values = np.frombuffer(told, "<f8").reshape(-1, 3)
    return values / np.maximum(wi[:, 2:], 1e-9), " ".join(["Radiance", *version[1:]])


def _frames(wi: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotations that turn each direction to +z; columns are the axes of a facet in the world."""
    side = np.where(np.abs(wi[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = np.cross(side, wi)
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(wi, x), wi], axis=1)


def _said(vector: np.ndarray) -> str:
    return " ".join(f"{x:.17g}" for x in vector)


def _ended(command: Sequence[Any], given: bytes, more: Mapping[str, str], folder: str) -> bytes:
    """Standard output of a program of Radiance that runs in a folder."""
    options: dict[str, Any] = {"capture_output": True, "check": True, "env": os.environ | dict(more), "cwd": folder}
    try:
        ended = subprocess.run(list(map(str, command)), input=given, **options)
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", b"") or str(error).encode()
        why = " ".join(said.decode("utf-8", "replace").split())[:200]
        raise OutputError(f"{command[0]} cannot run the material ({why}); leave it out with --no-verify.") from error
    return ended.stdout
