"""Seen: a surface as an instrument shows it: finite apertures, a shared scale error, offsets of angles, a dark signal.

It holds no surface of its own, and no noise.
"""

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, above, forward, turned
from fitmat.measurements.instrument import Instrument
from fitmat.models.around.shown import AbstractShown
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import param

RINGS, SPOKES = 5, 11
"""Nodes of the cone rule along its radius and around its axis."""

_DENSE = 200


def _offset(symbol: str, of: str) -> Any:
    return param(
        -10.0, 10.0, symbol=symbol, unit="°", optional=True, starts=(0.0,),
        doc=f"what is to be added to every {of} that was read; 0 where its scale is right",
    )  # fmt: skip


class Seen(AbstractShown):
    r"""What an instrument reads of a base: its apertures, its calibration, its angles' offsets and its dark signal.

    .. math:: f = g \left( \frac{c_i(\theta_i + \delta_i)}{c_i(\theta_i)} \frac{\sum_k w_k
        f_b(\omega_{i,k}, \omega_{o,k}) c_{i,k} c_{o,k}} {\sum_k w_k c_{i,k} c_{o,k}} + \frac{b}{c_o} \right)

    The sum is the average of the BRDF over the two projected solid angles (Nicodemus et al. 1977, eq. 12), by a fixed
    rule of 55 nodes (`cone_rule`): a fit costs about 55 times as much as one with an ideal instrument. With apertures
    of half-angle A and B a lobe of slope α is exact to 0.2 % while A + B ≤ 2 α, to 2 % while A + B ≤ 3 α.

    The base is seen at θ_i + δ_i and θ_o + δ_o, the angles that were read with their offsets: in measurements of one
    plane θ_o is signed, positive on the mirror side. As for a tilt, the value is per irradiance at the θ_i that was
    read: hence the ratio of cosines, which readings beside a panel at the same angle do not have.

    Parameters: scale g, known to the calibration's standard deviation, where that is not 0; dark signal b in sr⁻¹ where
    it is not known; factor w of the half-angles, known to their error; offsets δ_i and δ_o in degrees, known to the
    angles' error. None where there is nothing to fit.

    Limits: for an ideal instrument the base itself; of a Lambertian base g k_d/π whatever the apertures. In one plane
    with one incidence only δ_i + δ_o is determined.

    Reference: F. E. Nicodemus et al., Geometrical considerations and nomenclature for reflectance, NBS 1977.
    """

    base: AbstractBRDF
    instrument: Instrument = eqx.field(static=True)
    scale: Scalar | None = param(
        1e-4, 1e4, symbol="g", scale="log", optional=True, starts=(1.0,),
        doc="error of the scale that all values share; 1 where the calibration is right",
    )  # fmt: skip
    dark: Scalar | None = param(
        0.0, 1.0, symbol="b", unit="1/sr", optional=True, starts=(0.0,),
        doc="dark signal and stray light, as f_r cosθ_o",
    )  # fmt: skip

    aperture: Scalar | None = param(
        0.1, 10.0, symbol="w", scale="log", optional=True, starts=(1.0,),
        doc="factor of the half-angles of source and receiver; 1 where they are as stated",
    )  # fmt: skip
    theta_i_offset: Scalar | None = _offset("δ_i", "θ_i")
    theta_o_offset: Scalar | None = _offset("δ_o", "θ_o")
    signed: bool = eqx.field(static=True, default=True)
    # Whether θ_o counts from the mirror side's to the light's, as in measurements of one plane; else from the normal.

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The module's formula."""
        cones = self.instrument.source + self.instrument.receiver > 0
        light, sensor, ratio = self._there(wi, wo)
        shown = (self._averaged(light, sensor) if cones else self.base(light, sensor)) * ratio
        shown += self._dark / jnp.maximum(wo[2], COS_MIN)
        return (1.0 if self.scale is None else self.scale) * jnp.where(above(wi, wo), shown, 0.0)

    def _there(self, wi: Vec3, wo: Vec3) -> tuple[Vec3, Vec3, Scalar | float]:
        """The directions in truth, and the cosine of the light's there over that where it was read."""
        if self.theta_i_offset is None or self.theta_o_offset is None:
            return wi, wo, 1.0
        moved = jnp.deg2rad(self.theta_i_offset), jnp.deg2rad(self.theta_o_offset)
        light, sensor = displaced(wi, wo, *moved, signed=self.signed)
        return light, sensor, jnp.maximum(light[2], 0.0) / jnp.maximum(wi[2], COS_MIN)

    @property
    def _dark(self) -> Scalar:
        return jnp.asarray(self.instrument.dark if self.dark is None else self.dark)

    def _averaged(self, wi: Vec3, wo: Vec3) -> Spectrum:
        rule = cone_rule(self.instrument.source, self.instrument.receiver)
        lights, sensors = (self._widened(part) @ _frame(w) for part, w in zip(rule, (wi, wo), strict=False))
        product = jnp.asarray(rule[2]) * lights[:, 2] * sensors[:, 2]
        return product @ jax.vmap(self.base)(lights, sensors) / jnp.maximum(jnp.sum(product), COS_MIN)

    def _widened(self, about: np.ndarray) -> jax.Array:
        """Directions about +z, their offsets from it as much wider as the half-angles are."""
        if self.aperture is None:
            return jnp.asarray(about)
        aside = jnp.asarray(about[:, :2]) * self.aperture
        up = jnp.sqrt(jnp.maximum(1.0 - jnp.sum(aside**2, axis=1, keepdims=True), 0.0))
        return jnp.concatenate([aside, up], axis=1)


def displaced(wi: Any, wo: Any, of_light: Any, of_sensor: Any, *, signed: bool) -> tuple[Any, Any]:
    """Pairs of directions at other zenith angles, of one pair or of many; NumPy's arrays or JAX's.

    Args:
        wi: Unit vectors to the light.
        wo: Unit vectors to the sensor.
        of_light: What is added to θ_i, radians; broadcasts with (..., 1).
        of_sensor: The same of θ_o.
        signed: Whether θ_o is signed, positive on the mirror side.
    """
    ahead = forward(wi, wo)
    return turned(wi, -ahead, of_light), turned(wo, ahead if signed else -forward(wo, wo), of_sensor)


def _frame(w: Vec3) -> Float[jax.Array, "3 3"]:
    """Rows: two tangents and w, the shortest rotation of the axes to w = +z (Duff et al. 2017, JCGT 6(1)).

    The tangents of two mirror directions have the same x and y, so that equal offsets from both turn the half vector
    the same way.
    """
    x, y, z = w
    a = -1.0 / (1.0 + jnp.maximum(z, 0.0))
    return jnp.stack([jnp.stack([1.0 + x * x * a, x * y * a, -x]), jnp.stack([x * y * a, 1.0 + y * y * a, -y]), w])


@functools.lru_cache
def cone_rule(
    source: float, receiver: float
) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k 3"], Float[np.ndarray, " k"]]:
    """Pairs of directions about two axes +z that average a BRDF over a source's and a receiver's cone.

    A specular lobe depends on the sum c of the two offsets from the axes only (it turns the half vector). c is
    distributed as the sum of two uniform discs: its density is the area in which discs of radius A and B at distance
    |c| overlap. The rule is Gauss's for that density in |c|², times equal angles, c shared out as A² : B².

    Args:
        source: A, radians.
        receiver: B, radians; A + B > 0.

    Returns:
        Unit vectors to the light and to the sensor, and weights that sum to 1.
    """
    offset, weight = _gauss(*_overlap(source, receiver), RINGS)
    angle = 2.0 * np.pi * (np.arange(SPOKES) + 0.5 * (np.arange(RINGS) % 2)[:, None]) / SPOKES
    share = source**2 / (source**2 + receiver**2)

    def about(radius: np.ndarray) -> np.ndarray:
        sin = np.sin(radius)[:, None]
        height = np.broadcast_to(np.cos(radius)[:, None], angle.shape)
        return np.stack([sin * np.cos(angle), sin * np.sin(angle), height], axis=-1).reshape(-1, 3)

    return about(share * offset), about((1.0 - share) * offset), np.repeat(weight, SPOKES) / SPOKES


def _overlap(a: float, b: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes |c| and weights of the density of the sum of two uniform discs of radius a and b; weights sum to 1."""
    low, high = sorted((a, b))
    x, w = np.polynomial.legendre.leggauss(_DENSE)
    inner, outer = 0.5 * (x + 1.0) * (high - low), high - low + (x + 1.0) * low
    first = np.arccos(np.clip((outer**2 + low**2 - high**2) / np.maximum(2 * outer * low, 1e-300), -1, 1))
    second = np.arccos(np.clip((outer**2 + high**2 - low**2) / (2 * outer * high), -1, 1))
    kite = (high + low + outer) * (high + low - outer) * (outer - high + low) * (outer + high - low)
    lens = low**2 * first + high**2 * second - 0.5 * np.sqrt(np.maximum(kite, 0.0))
    whole = np.pi * (low**2 if low > 0 else 1.0)
    nodes = np.concatenate([inner, outer])
    weights = np.concatenate([0.5 * (high - low) * w * inner * whole, low * w * outer * lens])
    return nodes, weights / weights.sum()


def _gauss(nodes: np.ndarray, weights: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The Gauss rule in the square of the nodes, by Stieltjes' procedure (Gautschi 2004, sec. 2.2) and Golub–Welsch."""
    scale = nodes.max() ** 2
    u = nodes**2 / scale
    before, now, norm = np.zeros_like(u), np.ones_like(u), 1.0
    diagonal, off = np.zeros(count), np.zeros(count)
    for k in range(count):
        square = np.sum(weights * now**2)
        diagonal[k] = np.sum(weights * u * now**2) / square
        off[k] = square / norm
        before, now, norm = now, (u - diagonal[k]) * now - (off[k] if k else 0.0) * before, square
    beside = np.sqrt(off[1:])
    roots, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
    return np.sqrt(scale * roots), vectors[0] ** 2
