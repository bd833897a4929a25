"""Words of an examination: what the file is and whether it agrees with itself, as plain sentences.

It computes nothing; warnings are kept apart from description.
"""

from collections.abc import Sequence

import numpy as np

from fitmat.judgement.examination import phrases as say
from fitmat.judgement.examination.consistency import Agreement, Consistency
from fitmat.judgement.examination.coverage import NEAR, Coverage
from fitmat.judgement.examination.phrases import LISTED, Said
from fitmat.judgement.examination.value_range import ValueRange
from fitmat.measurements.samples import Measurements
from fitmat.text import visible

GRAZING = np.deg2rad(60.0)
"""Files that stay below this zenith angle say nothing of grazing reflection."""

Law = tuple[float, float] | None
"""Absolute (sr⁻¹) and relative noise of a channel, or None."""


def title(m: Measurements) -> Said:
    """How much there is, and what of it cannot be used."""
    channels = say.channels(m.channels) if len(m.channels) == 1 else f"{len(m.channels)} channels"
    if 1 < len(m.channels) <= LISTED:
        channels += f" ({', '.join(map(visible, m.channels))})"
    lines = [f"{m.source}: {say.count(m.n_samples, 'sample')}, {channels}."]
    lines += [f"Not used, {reason}: {say.count(count, 'row')}." for reason, count in m.masked.items()]
    empty = [name for name, used in zip(m.channels, m.valid.T, strict=True) if not used.any()]
    warnings = [f"Nothing can be used of {say.channels(empty)}: every value is masked."] if empty else []
    return Said([*warnings, *m.warnings], [*lines, *m.notes])


def geometry(where: Coverage) -> Said:
    """From where the light came, and where the sensor stood."""
    if not where.incidences:
        return Said([], ["Geometry: no usable sample."])
    first, last = where.theta_i[0], where.theta_i[-1]
    azimuths = len(where.phi_i)
    turned = f", from {azimuths} azimuths" if azimuths > 1 and not where.scattered else ""
    if where.scattered:
        reach = f"{say.degrees(first)} to {say.degrees(last)}"
        lit = f"incidence varies freely from {reach}; described at {_angles(where)}"
    elif len(where.theta_i) == 1:
        lit = f"lit at one angle of incidence, {say.degrees(first)}{turned}"
    else:
        more = f", of which {len(where.incidences)} are described" if len(where.incidences) < len(where.theta_i) else ""
        lit = f"lit at {len(where.theta_i)} angles of incidence, {_angles(where)}{more}{turned}"
    plane = "every sample lies in the plane of incidence" if where.in_plane else "also outside the plane of incidence"
    sensor = say.span([v for i in where.incidences for v in i.theta_o], say.degrees)
    lines = [f"Geometry: {lit}; {plane}.", f"Sensor: {sensor} from the normal{_steps(where)}."]
    nearest = say.span([i.nearest for i in where.incidences], say.degrees)
    share = say.span([i.covered for i in where.incidences], say.percent)
    lines += [
        f"Closest sample to the mirror direction: {nearest} away.",
        f"Within {say.degrees(NEAR)} of a sample lies {share} of the hemisphere, left and right taken as alike.",
    ]
    return Said([], lines + _silent(where))


def _steps(where: Coverage) -> str:
    steps = [i.step for i in where.incidences if i.step is not None]
    gaps = [i.gap for i in where.incidences if i.gap is not None]
    if where.scattered:
        return ""
    azimuths = (
        "" if where.in_plane else f", at {say.span([i.azimuths for i in where.incidences], str)} relative azimuths"
    )
    if not steps:
        return azimuths
    apart = say.span(steps, say.degrees)
    return f"{azimuths}; in the plane of incidence neighbours stand {apart} apart, at most {say.degrees(max(gaps))}"


def _silent(where: Coverage) -> list[str]:
    """What no fit can learn from these directions."""
    lines = []
    if len(where.theta_i) == 1:
        lines.append(
            "One angle of incidence only: how reflection grows with it (Fresnel's η beside the weight k_s) rests on "
            "the shape of one curve."
        )
    if where.grazing < GRAZING:
        lines.append(f"Nothing beyond {say.degrees(where.grazing)} from the normal: grazing reflection is not seen.")
    if where.in_plane and len(where.phi_i) == 1:
        lines.append("One plane only: a lean of the sample across it, and anisotropy, are not seen.")
    return lines


def values(ranges: Sequence[ValueRange], channels: Sequence[str]) -> Said:
    """How far the values reach."""
    lowest = [r.lowest for r in ranges if r.lowest is not None]
    highest = [r.highest for r in ranges if r.highest is not None]
    if not highest:
        return Said([], ["Values: none."])
    decades = [r.decades for r in ranges if r.decades is not None]
    negative = sum(r.negative for r in ranges)
    reach = f"{min(lowest):.3g} to {max(highest):.3g} sr⁻¹" if lowest else f"up to {max(highest):.3g} sr⁻¹"
    span = f", {say.span(decades, lambda d: f'{d:.1f}')} decades" if decades else ""
    lines = [f"Values: {reach}{span}" + (f"; {negative} negative." if negative else "; none negative.")]
    cut = [(r, name) for r, name in zip(ranges, channels, strict=True) if r.clipped]
    warnings = []
    if cut:
        most = max(r.clipped for r, _ in cut)
        where = f" in {say.channels([name for _, name in cut])}" if len(channels) > 1 else ""
        warnings.append(
            f"The smallest value occurs exactly {most} times{where}: values were probably cut off there; "
            "mask them, they are no measurements."
        )
    return Said(warnings, lines)


def noise(sentence: str, laws: Sequence[Law]) -> Said:
    """The noise; for many channels its range instead of a list."""
    known = [law for law in laws if law is not None]
    if not known:
        return Said([], [sentence])
    absolute, relative = zip(*known, strict=True)
    found = f"{say.span(relative, say.percent)} of the value + {say.span(absolute, say.two_digits)} sr⁻¹"
    origin = "as given in the file" if "given" in sentence else "estimated from neighbouring angles"
    return Said([], [f"Noise, {origin}: {found}" + (", by channel." if len(known) > 1 else ".")])


def consistency(found: Consistency) -> Said:
    """Whether what should be equal is."""
    subjects = (
        ("Reciprocity", found.reciprocity, "with light and sensor exchanged"),
        ("Left and right", found.sides, "mirrored at the plane of incidence"),
        ("Azimuth of incidence", found.azimuths, "that differ in the azimuth of incidence only"),
    )
    causes = (
        "the cosine of a wrong angle, a beam larger than the sample, or a drift does this",
        "a lean across the plane, a shifted azimuth or a brushed surface does this",
        "the sample is anisotropic or leans in its mount: try a model ending in -aniso, or --tilt",
    )
    said, silent = Said([], []), []
    for (name, agreement, pairs), cause in zip(subjects, causes, strict=True):
        if not agreement.judged:
            silent.append(f"{name.lower()} ({say.count(agreement.pairs, 'pair')})")
        elif agreement.differ:
            said.warnings.append(f"{name}: {_compared(agreement, pairs)}; {cause}.")
        else:
            said.lines.append(f"{name}: {_compared(agreement, pairs)}.")
    if silent:
        said.lines.append(f"Cannot be judged, for want of pairs of samples that should agree: {', '.join(silent)}.")
    return said


def _compared(found: Agreement, pairs: str) -> str:
    differ = "differ" if found.differ else "agree"
    size = ""
    if found.median is not None and found.worst is not None:
        median, worst = (say.percent(float(np.expm1(part))) for part in (found.median, found.worst))
        size = f" (median difference {median}, worst {worst})"
    noise = ", noise unknown" if found.noise is None else f", {found.noise:.2g} × the noise"
    return f"{found.pairs} pairs of values {pairs} {differ}{size}{noise}"


def _angles(where: Coverage) -> str:
    return ", ".join(say.degrees(i.theta_i) for i in where.incidences)
