"""Words for what the values of a file show: albedo, peaks, levels and prospects, as plain sentences.

It computes nothing; warnings are kept apart from description.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from fitmat.judgement.examination import phrases as say
from fitmat.judgement.examination.features import DEEP, Level, Peak, Tilt
from fitmat.judgement.examination.implied_albedo import ImpliedAlbedo
from fitmat.judgement.examination.phrases import Said
from fitmat.judgement.examination.prospects import Prospect
from fitmat.text import with_error

VAGUE = np.deg2rad(5.0)
"""A peak that is placed no better than this (three standard deviations) is not placed."""


def albedos(found: Sequence[ImpliedAlbedo], channels: Sequence[str]) -> Said:
    """What the samples add up to."""
    if not found:
        return Said([], ["Implied albedo: cannot be judged, too few samples at every incidence."])
    said = Said([], [])
    for a in found:
        if a.too_large.any():
            k = int(np.nanargmax(np.where(a.too_large, a.value, -np.inf)))
            where = f" in {say.channels(channels[k : k + 1])}" if len(channels) > 1 else ""
            said.warnings.append(
                f"At {say.degrees(a.theta_i)} incidence the values{where} add up to an albedo of "
                f"{with_error(float(a.value[k]), float(a.error[k]))}{_as_round(a)}, more light than falls on the "
                "sample. Is it the BRDF in sr⁻¹, without cosine (a reflectance factor is π times larger), and is the "
                "scale right?"
            )
    said.warnings.extend(_contradictions(found, channels))
    listed = "; ".join(f"{_albedo(a)} at {say.degrees(a.theta_i)}" for a in found)
    share = say.span([a.covered for a in found], say.percent)
    assumed = [a for a in found if a.assumed]
    which = "" if len(assumed) == len(found) else f" at {', '.join(say.degrees(a.theta_i) for a in assumed)}"
    how = f", from {share} of the hemisphere (projected)"
    if assumed:
        how += f"; the lobe is taken to be round about the mirror direction{which}, since one plane shows no more, and "
        how += "the rest as dark"
    if len(assumed) < len(found):
        how += "; what lies beyond all samples is taken to be as bright as the nearest, and lies in the ± as a whole"
    said.lines.append(f"Implied albedo: {listed}{how}.")
    return said


def _contradictions(found: Sequence[ImpliedAlbedo], channels: Sequence[str]) -> Iterator[str]:
    """Where the file says another sum than that of its values, the worst channel of each incidence."""
    doubted = [a for a in found if a.contradicted.any()]
    if not doubted:
        return
    parts = []
    for a in doubted:
        k = int(np.nanargmax(np.where(a.contradicted, np.abs(a.value - a.stated), -np.inf)))
        where = f" in {say.channels(channels[k : k + 1])}" if len(channels) > 1 else ""
        added = with_error(float(a.value[k]), float(a.error[k]))
        parts.append(f"at {say.degrees(a.theta_i)}{where} it says {a.stated[k]:.3g}, and they add up to {added}")
    yield (
        "The file states how much of the light is scattered in all (TIS), and its values add up to something else: "
        f"{'; '.join(parts)}{_as_round(doubted[0]) if all(a.assumed for a in doubted) else ''}. "
        "Is the cosine missing in one of them, or was the TIS taken from other values?"
    )


def _as_round(a: ImpliedAlbedo) -> str:
    return " (if the lobe is round about the mirror direction)" if a.assumed else ""


def _albedo(a: ImpliedAlbedo) -> str:
    value = a.value[np.isfinite(a.value)]
    if len(value) == 1:
        return with_error(float(value[0]), float(np.nanmax(a.error)))
    return f"{value.min():.2g}–{value.max():.2g} by channel"


def peaks(found: Sequence[Peak], lean: Tilt | None, *, judged: bool) -> Said:
    """Where the curves peak; the clearest channel of each incidence."""
    if not found:
        why = "no curve in the plane of incidence stands out" if judged else "no curve in the plane of incidence"
        return Said([], [f"Peak: cannot be placed, {why}."])
    best: dict[float, Peak] = {}
    for p in found:
        if p.theta_i not in best or p.error < best[p.theta_i].error:
            best[p.theta_i] = p
    said = Said([], [])
    for p in best.values():
        width = f"; {say.degrees(p.width)} wide at half its height" if p.width is not None else ""
        said.lines.append(f"Peak at {say.degrees(p.theta_i)} incidence: {_placed(p)}{width}.")
    coarse = [p for p in best.values() if not p.resolved and not p.at_end]
    if coarse:
        which = ", ".join(say.degrees(p.theta_i) for p in coarse)
        said.warnings.append(
            f"The peak at {which} incidence is narrower than two angular steps: its height and width depend on where "
            "the samples fall. Measure it in finer steps, or expect a broad interval for the gloss."
        )
    if lean is not None and lean.certain:
        side = "mirror" if lean.angle > 0 else "light"
        said.warnings.append(
            "The peaks are shifted alike at every incidence, as by a sample that leans "
            f"{say.degrees(abs(lean.angle))} ± {say.degrees(lean.error)} towards the {side} side in its mount: try "
            "--tilt."
        )
    return said


def _placed(p: Peak) -> str:
    if p.at_end and abs(p.offset) < 3 * p.error:
        return "in the mirror direction, where the curve ends"
    if p.at_end:
        return f"the largest value lies at the end of the curve, {say.degrees(abs(p.offset))} from the mirror direction"
    if not math.isfinite(p.error):
        return f"the largest value lies {say.degrees(abs(p.offset))} from the mirror direction"
    if 3 * p.error > VAGUE:
        return f"too flat to be placed, the largest value lies {say.degrees(abs(p.offset))} from the mirror direction"
    if abs(p.offset) < 3 * p.error:
        return f"in the mirror direction, to within {say.degrees(3 * p.error)}"
    side = "beyond" if p.offset > 0 else "short of"
    return f"the largest value lies {say.degrees(abs(p.offset))} ± {say.degrees(p.error)} {side} the mirror direction"


def levels(found: Sequence[Level]) -> Said:
    """What the curves fall to."""
    if not found:
        return Said([], [])
    each = {v.theta_i: v for v in sorted(found, key=lambda v: v.below)}
    level = say.span([v.value for v in found], say.two_digits)
    angles = ", ".join(say.degrees(theta_i) for theta_i in sorted(each))
    diffuse = say.span([np.pi * v.value for v in found], say.two_digits)
    sentence = (
        f"Away from the mirror direction the values level off at about {level} sr⁻¹ (at {angles} incidence), which as "
        f"diffuse reflection is an albedo of {diffuse}"
    )
    deepest = max(found, key=lambda v: v.below)
    instrumental = [v for v in found if v.instrumental]
    if instrumental and len(instrumental) * 2 > len(found):
        return Said(
            [f"{sentence}. They grow like 1/cosθ_o there, as the constant signal of a detector does: it may be the "
             "instrument's floor, not the sample."], []
        )  # fmt: skip
    if deepest.below > DEEP:
        return Said(
            [f"{sentence}. That is {np.log10(deepest.below):.1f} decades below the peak: stray light or the "
             "instrument's floor is as likely; compare with a measurement of the beam without a sample."], []
        )  # fmt: skip
    return Said([], [sentence + "."])


def prospects(found: Sequence[Prospect], *, noise_known: bool) -> Said:
    """What a fit could determine: one sentence for each model, and for each gloss where it makes a difference."""
    lines = []
    for name in dict.fromkeys(p.model for p in found):
        alike: dict[tuple[str, ...], list[list[Prospect]]] = {}
        for gloss in dict.fromkeys(p.gloss for p in found if p.model == name):
            ours = [p for p in found if p.model == name and p.gloss == gloss]
            alike.setdefault(tuple(p.verdict for p in ours), []).append(ours)
        lines += [_foreseen(name, group) for group in alike.values()]
    if lines and not noise_known:
        lines[0] += " This assumes a noise of 2 % + 0.001 sr⁻¹."
    return Said([], lines)


def _foreseen(name: str, glosses: list[list[Prospect]]) -> str:
    """One sentence on materials whose verdicts are the same."""
    shapes = [next(p for p in ours if p.name in ("alpha", "exponent")) for ours in glosses]
    whichever = say.one_of([p.gloss for p in shapes])
    kinds = []
    for verdict in ("determined", "weakly determined", "not determined"):
        listed = []
        for same in zip(*glosses, strict=True):
            if same[0].verdict == verdict:
                sds = [p.sd for p in same if p.sd is not None]
                listed.append(same[0].name + (f" ±{say.percent_range(sds)}" if sds else ""))
        kinds += [f"{verdict}: {', '.join(listed)}"] if listed else []
    sizes = say.one_of([f"{p.value:g}" for p in shapes])
    return f"{name} on a {whichever} plastic ({shapes[0].symbol} = {sizes}): {'; '.join(kinds)}."
