"""The match: how closely an empirical model reproduces a microfacet model fitted to the same measurements.

Judges two fits; draws nothing and prints nothing.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.brdf import LOBES, AbstractBRDF, lobe_names, surface
from fitmat.errors import FitmatError
from fitmat.measurement import Measurements
from fitmat.params import with_vector
from fitmat.posterior import Posterior
from fitmat.quadrature import incidence_rule, lobe_rule

DRAWS = 200
"""Posterior draws behind every interval of the match."""

ALBEDO_ANGLES = np.deg2rad(np.arange(0.0, 86.0, 5.0))
"""Incidence angles of the albedo curves, radians."""

AZIMUTHS = 4
"""Azimuths of incidence over half a turn, where a model is anisotropic."""

CLOSE, SIMILAR = 0.1, 0.3
"""Hemisphere distances up to which the verdict says "hardly differ" and "differ moderately"."""

ALBEDO_ERROR = 2e-3
"""Albedos above 1 by more than the quadrature's error are called impossible."""

STRONG_EVIDENCE = 10.0
"""ΔBIC from which the data clearly prefer one model (Kass & Raftery 1995: "very strong")."""


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A number with its 95 % posterior interval.

    Attributes:
        value: At the two best fits.
        ci95: 2.5 % and 97.5 % quantiles over posterior draws.
    """

    value: float
    ci95: tuple[float, float]


@dataclasses.dataclass(frozen=True, eq=False)
class Comparison:
    """The match of two fits.

    Attributes:
        empirical: Posterior of the empirical model.
        microfacet: Posterior of the microfacet model.
        hemisphere_distance: √(∫∫(f_P − f_M)² c_i c_o / ∫∫ f_M² c_i c_o), over all pairs of directions.
        measured_distance: The same over the incidence angles of the file.
        cube_root_distance: √(mean (∛(f_P c_i) − ∛(f_M c_i))²) over solid angle, in sr^(−1/3).
        albedo_gap_max: Largest |ρ_P − ρ_M| over incidence (channel mean), 0 to 85°.
        albedo_gap_sign: −1 where the empirical model reflects less there, else +1.
        albedo_gap_theta_i_deg: Where it occurs.
        implied_exponent: 2/α² − 2 of the microfacet lobe; None for lobes without alpha.
        fitted_exponent: Of the empirical lobe; None for lobes without exponent.
        delta_aicc: AICc of the empirical minus that of the microfacet fit; positive favours microfacet.
        delta_bic: The same for BIC.
        albedo_theta_i: Angles of the albedo curves, radians, (k,).
        albedo_empirical: Channel-mean directional albedo, rows low, best, high (95 %), (3, k).
        albedo_microfacet: The same.
    """

    empirical: Posterior
    microfacet: Posterior
    hemisphere_distance: Estimate
    measured_distance: Estimate
    cube_root_distance: Estimate
    albedo_gap_max: Estimate
    albedo_gap_sign: int
    albedo_gap_theta_i_deg: float
    implied_exponent: Estimate | None
    fitted_exponent: Estimate | None
    delta_aicc: float
    delta_bic: float
    albedo_theta_i: np.ndarray
    albedo_empirical: Float[np.ndarray, "3 k"]
    albedo_microfacet: Float[np.ndarray, "3 k"]

    @property
    def verdict(self) -> str:
        """The match in plain sentences; thresholds are `CLOSE`, `SIMILAR` and `STRONG_EVIDENCE`."""
        names = _lobe_title(self.empirical.fit.name), _lobe_title(self.microfacet.fit.name)
        distance = self.hemisphere_distance
        word = (
            "hardly differ"
            if distance.ci95[1] < CLOSE
            else "differ moderately"
            if distance.ci95[1] < SIMILAR
            else "differ strongly"
        )
        low, high = (100 * x for x in distance.ci95)
        gap, side = self.albedo_gap_max, "less" if self.albedo_gap_sign < 0 else "more"
        sentences = [
            f"{names[0]} and {names[1]} {word}: {100 * distance.value:.0f} % apart over the hemisphere "
            f"(95 % interval {low:.0f}–{high:.0f} %).",
            f"At {self.albedo_gap_theta_i_deg:.0f}° incidence {names[0]} reflects {100 * gap.value:.1f} % of the light "
            f"{side} than {names[1]} ({100 * gap.ci95[0]:.1f}–{100 * gap.ci95[1]:.1f} %).",
            _evidence(self.delta_bic, names),
            f"{names[0]} {self.empirical.fit.adequacy}; {names[1]} {self.microfacet.fit.adequacy}.",
        ]
        for name, albedo in zip(names, (self.albedo_empirical[1], self.albedo_microfacet[1]), strict=True):
            if albedo.max() > 1.0 + ALBEDO_ERROR:
                at = np.rad2deg(self.albedo_theta_i[np.argmax(albedo)])
                sentences.append(
                    f"{name} reflects more light than it receives (albedo {albedo.max():.2f} at {at:.0f}°)."
                )
        for fit in (self.empirical.fit, self.microfacet.fit):
            if fit.undetermined:
                loose = " and ".join(fit.undetermined)
                sentences.append(f"{fit.name} leaves {loose} undetermined: trust the intervals, not the values.")
        unsure = [p.fit for p in (self.empirical, self.microfacet) if p.fit.result in ("max_steps", "nonfinite")]
        sentences += [f"Do not rely on this match: the fit of {f.name} ended {f.result}." for f in unsure]
        return " ".join(sentences)

    def _repr_html_(self) -> str:
        return f"<p>{self.verdict}</p>"


def _lobe_title(name: str) -> str:
    return name.removeprefix("lambert+")


def _evidence(delta_bic: float, names: tuple[str, str]) -> str:
    if abs(delta_bic) < STRONG_EVIDENCE:
        return f"The data do not decide between them (ΔBIC {delta_bic:.0f})."
    return f"The data clearly prefer {names[1] if delta_bic > 0 else names[0]} (ΔBIC {abs(delta_bic):.0f})."


def is_empirical(name: str) -> bool:
    """Whether a model name has an empirical specular lobe."""
    return any(LOBES[part].kind == "empirical" for part in lobe_names(name))


def is_microfacet(name: str) -> bool:
    """Whether a model name has a lobe with a Fresnel term."""
    return any(LOBES[part].kind == "microfacet" for part in lobe_names(name))


def compare(one: Posterior, other: Posterior) -> Comparison:
    """The match between an empirical and a microfacet model, in either order.

    Args:
        one: Posterior (`laplace` or `sample`) of a fit.
        other: Posterior of the other fit to the same measurements.

    Returns:
        A `Comparison`; intervals come from independent draws of both posteriors.

    Raises:
        FitmatError: the two are not one empirical and one microfacet model, were fitted to different data, or are not
            finite.
    """
    empirical, microfacet = (one, other) if is_empirical(one.fit.name) else (other, one)
    if not (is_empirical(empirical.fit.name) and is_microfacet(microfacet.fit.name)):
        known = ", ".join(name for name, lobe in LOBES.items() if lobe.kind == "empirical")
        raise FitmatError(
            f"compare needs one empirical ({known}) and one microfacet model, got {one.fit.name} and {other.fit.name}."
        )
    for fit in (one.fit, other.fit):
        if not fit.finite:
            raise FitmatError(f"{fit.name}: the fit ended {fit.result}, there is nothing to compare; check the data.")
    if one.fit.measurements is not other.fit.measurements:
        raise FitmatError("compare needs two fits to the same Measurements object.")
    fits = empirical.fit, microfacet.fit
    draws = [np.vstack([p.fit.values, _by_scale(p)]) for p in (empirical, microfacet)]
    count = min(len(d) for d in draws)
    angles = jnp.asarray(_incidences(fits[0].measurements))
    pairs = jnp.asarray(draws[0][:count]), jnp.asarray(draws[1][:count])
    computed = _distances(fits[0].model, fits[1].model, pairs, angles)
    hemisphere, measured, cube, albedo_p, albedo_m = (np.asarray(part) for part in computed)
    gaps = albedo_p - albedo_m
    worst = int(np.argmax(np.abs(gaps[0])))
    return Comparison(
        empirical=empirical,
        microfacet=microfacet,
        hemisphere_distance=_estimate(hemisphere),
        measured_distance=_estimate(measured),
        cube_root_distance=_estimate(cube),
        albedo_gap_max=_estimate(np.abs(gaps).max(axis=1)),
        albedo_gap_sign=int(np.sign(gaps[0, worst])) or 1,
        albedo_gap_theta_i_deg=float(np.rad2deg(ALBEDO_ANGLES[worst])),
        implied_exponent=_parameter(microfacet, "alpha", lambda alpha: 2.0 / alpha**2 - 2.0),
        fitted_exponent=_parameter(empirical, "exponent", lambda n: n),
        delta_aicc=fits[0].aicc - fits[1].aicc,
        delta_bic=fits[0].bic - fits[1].bic,
        albedo_theta_i=ALBEDO_ANGLES,
        albedo_empirical=_band(albedo_p),
        albedo_microfacet=_band(albedo_m),
    )


def _by_scale(posterior: Posterior) -> np.ndarray:
    """Draws in the order of the shared scale, which has one true value for both models; else as they come."""
    values = posterior.thinned(DRAWS)[0]
    place = next((e.place for e in posterior.fit.entries if e.name == "scale"), None)
    return values if place is None else values[np.argsort(values[:, place.start])]


def _estimate(values: np.ndarray) -> Estimate:
    """The first entry with the quantiles of the others."""
    low, high = np.quantile(values[1:], [0.025, 0.975])
    return Estimate(float(values[0]), (float(low), float(high)))


def _band(curves: np.ndarray) -> np.ndarray:
    low, high = np.quantile(curves[1:], [0.025, 0.975], axis=0)
    return np.stack([low, curves[0], high])


def _parameter(posterior: Posterior, name: str, of) -> Estimate | None:
    place = next((e.place for e in posterior.fit.entries if e.name == name), None)
    if place is None:
        return None
    return _estimate(of(np.r_[posterior.fit.values[place], posterior.values[:, place].ravel()]))


def _incidences(m: Measurements) -> np.ndarray:
    """At most 16 of the measured incidence angles in radians, evenly spread."""
    angles = np.unique(np.round(m.theta_i[m.valid.any(axis=1)], 4))
    return angles[np.unique(np.linspace(0, len(angles) - 1, 16).astype(int))]


@eqx.filter_jit
def _distances(
    empirical: AbstractBRDF, microfacet: AbstractBRDF, values: tuple[Array, Array], angles: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Hemisphere, measured and cube-root distance (d,), and channel-mean albedos (d, k), of d pairs of draws."""
    theta, weight = (jnp.asarray(part) for part in incidence_rule())
    nodes = jnp.concatenate([theta, angles, jnp.asarray(ALBEDO_ANGLES)])
    hemisphere, measured = slice(0, len(theta)), slice(len(theta), len(theta) + len(angles))
    albedo = slice(len(theta) + len(angles), None)

    isotropic = surface(empirical).isotropic and surface(microfacet).isotropic
    turns = jnp.zeros(1) if isotropic else (jnp.arange(AZIMUTHS) + 0.5) * jnp.pi / AZIMUTHS

    def at(theta_i: Array, phi_i: Array, p: AbstractBRDF, m: AbstractBRDF) -> tuple[Array, ...]:
        """Integrals over ω_o: squared difference, square, squared root difference, solid angle, both albedos."""
        rule = lobe_rule(theta_i, jnp.minimum(p.width(), m.width()), phi_i=None if isotropic else phi_i)
        wi = rule.wi
        f_p, f_m = (jax.vmap(lambda wo, f=f: jnp.atleast_1d(f(wi, wo)))(rule.wo) for f in (p, m))
        solid = jnp.where(rule.weight > 0, rule.weight / jnp.maximum(rule.wo[:, 2], 1e-12), 0.0)
        roots = (jnp.cbrt(f_p * wi[2]) - jnp.cbrt(f_m * wi[2])) ** 2
        sums = rule.weight @ (f_p - f_m) ** 2, rule.weight @ f_m**2, solid @ roots, rule.weight @ f_p, rule.weight @ f_m
        difference, square, root, one, other = (part.mean() for part in sums)
        return difference, square, root, jnp.sum(solid), one, other

    def pair(both: tuple[Array, Array]) -> tuple[Array, Array, Array, Array, Array]:
        p, m = (surface(with_vector(f, v)) for f, v in zip((empirical, microfacet), both, strict=True))
        every = jax.vmap(lambda turn: jax.vmap(lambda t: at(t, turn, p, m))(nodes))(turns)
        difference, square, roots, solid, one, other = (part.mean(axis=0) for part in every)
        flat, cosines = weight / jnp.cos(theta), jnp.cos(angles)
        return (
            jnp.sqrt((weight @ difference[hemisphere]) / (weight @ square[hemisphere])),
            jnp.sqrt((cosines @ difference[measured]) / (cosines @ square[measured])),
            jnp.sqrt((flat @ roots[hemisphere]) / (flat @ solid[hemisphere])),
            one[albedo],
            other[albedo],
        )

    return jax.lax.map(pair, values)
