"""Examination: what a file of measurements is like before any fit, in numbers; `words` says it.

It fits no model, repairs nothing and draws nothing.
"""

import dataclasses
import html
import os
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.judgement.examination import finding_words, words
from fitmat.judgement.examination.consistency import Agreement, Consistency, consistency
from fitmat.judgement.examination.coverage import Coverage, coverage, mirror_frame
from fitmat.judgement.examination.features import Level, Peak, Tilt, level, peak, tilt
from fitmat.judgement.examination.implied_albedo import ImpliedAlbedo, implied_albedo
from fitmat.judgement.examination.phrases import Said
from fitmat.judgement.examination.prospects import ASSUMED, Prospect, prospects
from fitmat.judgement.examination.value_range import ValueRange, value_range
from fitmat.measurements.noise import Noise, channel_laws, measured_noise
from fitmat.measurements.reader import measurements_of
from fitmat.measurements.samples import Measurements
from fitmat.text import brief, plain

MOST_ESTIMATED = 100_000
"""Rows times channels above which a noise that the file does not give is not estimated from neighbours."""

MOST_CURVES = 2000
"""Curves (incidences times channels) whose peak and level are looked for; of more, evenly chosen channels."""

DEFAULT_STEP = float(np.deg2rad(1.0))
"""Of files without curves, radians."""


@dataclasses.dataclass(frozen=True, eq=False)
class Examination:
    """What a file is like.

    Attributes:
        measurements: The file.
        sigma: Its noise in sr⁻¹, given, estimated or assumed, (n, c).
        noise: What is known of the noise, per channel: (absolute in sr⁻¹, relative), or None.
        noise_words: The same as a sentence.
        values: Per channel.
        coverage: From where it was measured.
        consistency: Whether what should be equal is.
        albedos: What the samples of each incidence add up to; only where they suffice.
        peaks: Of each incidence and channel that has one.
        levels: Constants that curves fall to.
        tilt: The lean that the peaks have in common; None where they do not say.
        prospects: What a fit could determine.
    """

    measurements: Measurements
    sigma: Float[np.ndarray, "n c"]
    noise: tuple[tuple[float, float] | None, ...]
    noise_words: str
    values: tuple[ValueRange, ...]
    coverage: Coverage
    consistency: Consistency
    albedos: tuple[ImpliedAlbedo, ...]
    peaks: tuple[Peak, ...]
    levels: tuple[Level, ...]
    tilt: Tilt | None
    prospects: tuple[Prospect, ...]

    __repr__ = brief

    @property
    def warnings(self) -> list[str]:
        """What the owner of the file should look into before a fit; sentences."""
        return [sentence for said in self._said() for sentence in said.warnings]

    def lines(self) -> list[str]:
        """The whole examination as plain sentences: what it is, warnings, description."""
        first, *rest = self._said()
        description = [sentence for said in rest for sentence in said.lines]
        return [first.lines[0], *(f"WARNING: {text}" for text in self.warnings), *first.lines[1:], *description]

    def _said(self) -> list[Said]:
        m = self.measurements
        return [
            words.title(m),
            words.geometry(self.coverage),
            words.values(self.values, m.channels),
            words.noise(self.noise_words, self.noise),
            finding_words.albedos(self.albedos, m.channels),
            words.consistency(self.consistency),
            finding_words.peaks(self.peaks, self.tilt, judged=any(i.in_plane for i in self.coverage.incidences)),
            finding_words.levels(self.levels),
            finding_words.prospects(self.prospects, noise_known=any(law is not None for law in self.noise)),
        ]

    def __str__(self) -> str:
        """The lines."""
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        return "<br>".join(html.escape(line) for line in self.lines())

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types: angles in degrees, values in sr⁻¹, None for what is not known."""
        m = self.measurements
        found = {
            "file": m.source,
            "samples": m.n_samples,
            "masked": m.masked,
            "notes": list(m.notes),
            "warnings": self.warnings,
            "geometry": _geometry(self.coverage),
            "channels": {name: self._channel(k) for k, name in enumerate(m.channels)},
            "noise": self.noise_words,
            "consistency": {
                field.name: _agreement(getattr(self.consistency, field.name))
                for field in dataclasses.fields(self.consistency)
            },
            "tilt": None
            if self.tilt is None
            else {"angle_deg": np.rad2deg(self.tilt.angle), "sd_deg": np.rad2deg(self.tilt.error)},
            "prospects": [dataclasses.asdict(p) for p in self.prospects],
        }
        return plain(found)

    def _channel(self, k: int) -> dict[str, Any]:
        """What is known of one channel."""
        absolute, relative = self.noise[k] or (None, None)
        return {
            **dataclasses.asdict(self.values[k]),
            "decades": self.values[k].decades,
            "noise_absolute": absolute,
            "noise_relative": relative,
            "implied_albedo": [
                {
                    "theta_i_deg": np.rad2deg(a.theta_i),
                    "value": a.value[k],
                    "error": a.error[k],
                    "covered": a.covered,
                    "assumes_round_lobe": a.assumed,
                    "stated": a.stated[k],
                }
                for a in self.albedos
            ],
            "peaks": [_degrees(p) for p in self.peaks if p.channel == k],
            "levels": [_degrees(v) | {"instrumental": v.instrumental} for v in self.levels if v.channel == k],
        }


def examine(measurements: Measurements | str | os.PathLike[str]) -> Examination:
    """Describe a file of measurements before any fit.

    Args:
        measurements: From `fitmat.read`, or a file that needs no options; up to some million rows, of which large
            files use an even part.

    Returns:
        An `Examination`; print it.

    Example:
        >>> import fitmat as fm, numpy as np
        >>> print(examine(fm.from_arrays(np.full(3, 0.5), [-0.5, 0.0, 0.5], [0.1, 0.1, 0.3])))  # doctest: +SKIP
    """
    measurements = measurements_of(measurements)
    noise = _noise(measurements)
    laws = tuple(channel_laws(measurements, noise)) if noise.known else (None,) * len(measurements.channels)
    looked = _looked(measurements, noise)
    return dataclasses.replace(looked, noise=laws, prospects=prospects(measurements, laws))


def warnings(measurements: Measurements, noise: Noise, *, tilted: bool = False) -> tuple[str, ...]:
    """What the owner of a file should look into before believing a fit to it: those of `examine`, as sentences.

    Args:
        measurements: From `fitmat.read`.
        noise: Theirs, by `measured_noise`, which takes its time.
        tilted: Whether a lean of the sample is fitted, so that there is no need to speak of it.
    """
    looked = _looked(measurements, _noise(measurements, noise))
    return tuple(dataclasses.replace(looked, tilt=None if tilted else looked.tilt).warnings)


def _looked(m: Measurements, noise: Noise) -> Examination:
    """Everything but the laws of the noise and the prospects, which warn of nothing."""
    where = coverage(m)
    agreement = consistency(m, noise.sigma, mirror_frame(m.wi, m.wo), known=noise.known, step=_step(where))
    summed = [implied_albedo(m, noise.sigma, incidence) for incidence in where.incidences]
    every = np.arange(len(m.channels))[:: -(-len(m.channels) * max(len(where.incidences), 1) // MOST_CURVES)]
    curves = [(incidence, int(k)) for incidence in where.incidences for k in every if not where.scattered]
    peaks = [p for curve in curves if (p := peak(m, noise.sigma, *curve)) is not None]
    return Examination(
        measurements=m,
        sigma=noise.sigma,
        noise=(),
        noise_words=noise.words,
        values=tuple(value_range(m.value[m.valid[:, k], k]) for k in range(len(m.channels))),
        coverage=where,
        consistency=agreement,
        albedos=tuple(a for a in summed if a is not None),
        peaks=tuple(peaks),
        levels=tuple(v for curve in curves if (v := level(m, noise.sigma, *curve)) is not None),
        tilt=tilt(peaks),
        prospects=(),
    )


def _step(where: Coverage) -> float:
    """Typical angular step, radians."""
    steps = [i.step for i in where.incidences if i.step]
    return float(np.median(steps)) if steps and not where.scattered else DEFAULT_STEP


def _noise(m: Measurements, known: Noise | None = None) -> Noise:
    """As `measured_noise`, but not from the neighbours in very large files, and `ASSUMED` where nothing is known."""
    if m.sigma is not None or m.value.size <= MOST_ESTIMATED:
        found = known or measured_noise(m)
        if found.known:
            return found
        because = found.words
    else:
        because = "Noise unknown: not given, and not estimated in a file as large as this."
    relative, absolute = ASSUMED
    return Noise(np.hypot(absolute, relative * np.abs(m.value)), False, because)


def _geometry(where: Coverage) -> dict[str, Any]:
    return {
        "theta_i_deg": np.rad2deg(where.theta_i),
        "scattered": where.scattered,
        "phi_i_deg": np.rad2deg(where.phi_i),
        "in_plane": where.in_plane,
        "largest_zenith_deg": np.rad2deg(where.grazing),
        "incidences": [incidence.as_dict() for incidence in where.incidences],
    }


def _agreement(found: Agreement) -> dict[str, Any]:
    return dataclasses.asdict(found) | {"judged": found.judged}


_ANGLES = ("theta_i", "phi_i", "offset", "error", "width")


def _degrees(thing: Peak | Level) -> dict[str, Any]:
    """A peak or a level with its angles in degrees, named so."""
    angles = _ANGLES if isinstance(thing, Peak) else ("theta_i",)
    found = {k: v for k, v in dataclasses.asdict(thing).items() if k != "channel"}
    return {f"{k}_deg" if k in angles else k: v if k not in angles or v is None else np.rad2deg(v)
            for k, v in found.items()}  # fmt: skip
