"""Conditions: what is known of a sample before a fit, or suspected of its mount, as models and fixed parameters.

It fits nothing; it turns "this is gold" and "it may be tilted" into what `fit` understands.
"""

import warnings

import numpy as np

from fitmat.errors import ModelError, ReadAs
from fitmat.measurements.samples import IN_PLANE, Measurements, default_channels
from fitmat.models import spectral
from fitmat.models.in_rgb import WAYS, fresnel_in_rgb
from fitmat.models.parameters import entries
from fitmat.models.refractive_index import channel_wavelengths, index
from fitmat.models.registry import LOBES, OVER, lobe_names, model
from fitmat.models.terms.film import Film
from fitmat.models.terms.fresnel import COS_82, Dielectric

FILM_APART = 0.05
"""How far the index of a named film may be from its law: 2 % of titanium dioxide's, and so of its thickness."""

EXACT = 1e-3
"""Of a film's index, from which its law's error is said to count: 0.05 nm of 50."""

OPTICAL = ("eta", "kappa", "f0", "f82", "substrate_eta", "substrate_kappa")
"""Parameters that the refractive index determines: of the surface, or of what lies under a film."""

OF_FILM = ("film_eta", "film_b", "film_kappa")
"""Parameters that the material of a film determines."""

Known = dict[str, dict[str, np.ndarray]]
"""Model name → parameter → value to hold."""


def of_material(name: str, material: str, channels: tuple[str, ...]) -> Known:
    """A model whose refractive index is held at the literature's: `ggx` and "Au" make ggx-conductor, η + iκ fixed.

    Every lobe with a Fresnel term takes the index. A metal in a lobe with the dielectric term turns it into
    `-conductor`. In r, g and b it is the index whose curve comes closest to what the channel sees of the spectrum
    (`spectral.channel_indices`); F0 and F82 are what it sees, at most 1. Where a single channel is taken, is said.

    Args:
        name: Of the model.
        material: As in `fitmat.models.refractive_index.index`.
        channels: Names of the channels, whose wavelengths count.

    Returns:
        One model, which may have another name, and what to hold.

    Raises:
        ModelError: no lobe has an index, the material is unknown, a channel has no wavelength, or a transparent
            material meets a conductor term.
    """
    indices = spectral.channel_indices(material, channels)
    eta, kappa = np.real(indices), np.imag(indices)
    metal = bool((kappa > spectral.ABSORBING).any())
    parts = lobe_names(name)
    bearers = [part for part in parts if "fresnel" in LOBES[part].parts]
    if not bearers:
        raise ModelError(f"--ior {material}: {name} has no lobe with a refractive index; use ggx or beckmann.")
    renamed = {
        part: f"{part}-conductor" if metal and LOBES[part].parts["fresnel"] is Dielectric else part for part in bearers
    }
    covers, base = parts[: name.count(OVER)], parts[name.count(OVER) :]
    name = OVER.join([*covers, "+".join(renamed.get(part, part) for part in base)])
    f0, f82 = np.minimum(spectral.seen_by(channels, material, np.array([1.0, COS_82])), 1.0)
    values: dict[str, np.ndarray] = dict(zip(OPTICAL, (eta, kappa, f0, f82, eta, kappa), strict=True))
    names = {e.name: e for e in entries(model(name, channels=len(channels)))}
    known = {}
    for part in renamed.values():
        own = {key for key in LOBES[part].defaults() if key in values}
        if "kappa" in own and not metal:
            raise ModelError(f"--ior {material} does not absorb light: use the lobe without -conductor or -belcour.")
        for key in own:
            entry = names.get(f"{part}.{key}") or names[key]
            value = np.maximum(values[key], entry.param.lower)  # the κ of glass under a film
            known[entry.name] = value if entry.size == len(channels) else np.mean(value, keepdims=True)
    if set(channels) == set(spectral.RGB):
        _say_what_rgb_cannot_hold(material, {key.rpartition(".")[2] for key in known})
    elif channels == default_channels(1):
        _say_where(f"--ior {material}", channels, indices)
    return {name: known}


def of_film(name: str, material: str, channels: tuple[str, ...]) -> dict[str, np.ndarray]:
    """What a named film holds of a model: film_eta and film_b, Cauchy's law closest to the literature's η, and κ.

    Least squares at the channels' wavelengths, B ≥ 0; κ is their mean. How far that is from the literature is said,
    and where a single channel is taken.

    Args:
        name: Of a model with a film.
        material: As in `fitmat.models.refractive_index.index`.
        channels: Names of the channels, which are wavelengths.

    Returns:
        Parameter → value to hold; none of a model without a film.

    Raises:
        ModelError: the material is unknown, or its index follows no such law to `FILM_APART`.
    """
    films = [part for part in lobe_names(name) if LOBES[part].parts.get("fresnel") is Film]
    if not films:
        return {}
    um = 1e-3 * channel_wavelengths(channels)
    found = index(material, 1e3 * um)
    if channels == default_channels(1):
        _say_where(f"--film {material}", channels, found)
    basis = np.stack([np.ones_like(um), um**-2.0], axis=1)
    a, b = np.linalg.lstsq(basis, np.real(found), rcond=None)[0] if len(um) > 1 else (0.0, -1.0)
    if b < 0.0:
        a, b = np.mean(np.real(found)), 0.0
    kappa = float(np.mean(np.imag(found)))
    apart = float(np.abs(a + b * um**-2.0 + 1j * kappa - found).max())
    law = f"η = {a:.4g} + {b:.3g}/λ² (λ in µm), κ = {kappa:.2g}"
    if apart > FILM_APART:
        raise ModelError(
            f"--film {material}: its index is {apart:.2g} from {law}, expected {FILM_APART:g} at most: a film's index "
            "follows Cauchy's law here, its κ is one number. Leave out what it absorbs, or hold film_eta, film_b and "
            "film_kappa by --fix."
        )
    share = apart / abs(found).min()
    unsure = f" As much as {share:.1%} of the thickness is not in its interval." if share > EXACT else ""
    warnings.warn(f"--film {material}: held {law}, off by {apart:.2g} at most.{unsure}", ReadAs, stacklevel=2)
    values = dict(zip(OF_FILM, (a, b, kappa), strict=True))
    names = {e.name for e in entries(model(name))}
    return {
        key if key in names else f"{part}.{key}": np.array([value]) for part in films for key, value in values.items()
    }


def _say_where(flag: str, channels: tuple[str, ...], indices: np.ndarray) -> None:
    """Warn with `ReadAs` that a channel without a wavelength is taken at one."""
    (nm,), (index_,) = channel_wavelengths(channels), indices
    taken = f"taken at {nm:g} nm, η = {index_.real:.4g}, κ = {index_.imag:.3g}"
    elsewhere = "for another, --wavelengths of fitmat simulate, or the name of a table's column, as brdf_633"
    warnings.warn(f"{flag}: {taken}, as the one channel has no wavelength; {elsewhere}.", ReadAs, stacklevel=3)


def _say_what_rgb_cannot_hold(material: str, held: set[str]) -> None:
    """Warn with `ReadAs` of what becomes of the material's colour with three numbers a term."""
    way = "f82" if "f82" in held else "schlick" if "f0" in held else "closest"
    apart, angle = fresnel_in_rgb(material).worst(way)
    warnings.warn(
        f"--ior {material}: Fresnel in RGB by {WAYS[way]}, r, g, b being linear sRGB. What three numbers cannot hold "
        f"looks like ΔE2000 = {apart:.1f} at most, at {angle:.0f}° (D65; 1 is just noticeable).",
        ReadAs,
        stacklevel=2,
    )


def tilted(name: str, measurements: Measurements) -> Known:
    """A model on a sample whose normal may lean; the lean that the measurements cannot show is held at 0.

    In measurements of one plane, turned or not about the normal by 180°, only the lean within it counts to first
    order.

    Raises:
        ModelError: the plane is not at azimuth 0 or 90°, so that neither axis can be held.
    """
    azimuths = measurements.phi_i[measurements.theta_i > IN_PLANE] % np.pi
    spread = np.ptp((azimuths - azimuths[:1] + np.pi / 2) % np.pi) if len(azimuths) else 0.0
    if not measurements.in_plane.all() or spread > IN_PLANE:
        return {f"tilt{OVER}{name}": {}}
    plane = float((azimuths[0] + IN_PLANE) % np.pi - IN_PLANE) if len(azimuths) else 0.0
    across = {"tilt_y": abs(plane) < 2 * IN_PLANE, "tilt_x": abs(plane - np.pi / 2) < 2 * IN_PLANE}
    if not any(across.values()):
        raise ModelError(
            f"{measurements.source}: all measurements lie in one plane at azimuth {np.rad2deg(plane):.1f}°; a tilt can "
            "be fitted there only if that is 0° or 90°. Turn the azimuths of the file."
        )
    return {f"tilt{OVER}{name}": {axis: np.zeros(1) for axis, held in across.items() if held}}


def prepare_known(
    names: list[str], measurements: Measurements, *, ior: str | None, tilt: bool, film: str | None = None
) -> Known:
    """The models of a study with what is known of the sample; models without an index or a film stay as they are.

    Raises:
        ModelError: as `of_material`, where no model has an index, `of_film`, where none has a film, and `tilted`.
    """
    known: Known = {name: {} for name in names}
    if ior is not None:
        bearing = [n for n in names if any("fresnel" in LOBES[part].parts for part in lobe_names(n))]
        made = {n: of_material(n, ior, measurements.channels) for n in bearing or names}
        known = {new: held for n in names for new, held in made.get(n, {n: {}}).items()}
    if film is not None:
        made = {name: of_film(name, film, measurements.channels) for name in known}
        refuse_no_film(film, made)
        known = {name: held | made[name] for name, held in known.items()}
    if tilt:
        known = {new: held | more for n, held in known.items() for new, more in tilted(n, measurements).items()}
    return known


def refuse_no_film(film: str, held: Known) -> None:
    """Stop where a film is named and no model has one."""
    if not any(held.values()):
        raise ModelError(f"--film {film}: none of {', '.join(held)} has a film; use ggx-film or lambert+ggx-film.")
