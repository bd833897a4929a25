"""Planning: a design as the command line shows it, with its picture.

It chooses nothing itself.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from fitmat._types import Progress
from fitmat.judgement.design.design import MATCH, Design, Proposal, next_angles
from fitmat.match.kinds import is_microfacet
from fitmat.measurements.reader import read
from fitmat.models.parameters import assignments
from fitmat.reports.pictures import write_picture
from fitmat.studies.plan import plan
from fitmat.text import plain, text_table
from fitmat.uncertainty.laplace import laplace_each
from fitmat.uncertainty.posterior import Posterior

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def fitted(
    sources: Sequence[Path],
    reading: Mapping[str, Any],
    models: str,
    fixed: Sequence[str],
    seed: int,
    progress: Progress,
) -> list[Posterior]:
    """The posteriors around which the next measurements are looked for.

    Args:
        sources: Files to read, as one measurement.
        reading: Arguments of `fitmat.read`.
        models: Names, with commas between them.
        fixed: What `--fix` says.
        seed: Of the draws.
        progress: Called with what is done next.

    Raises:
        FitmatError: as `fitmat.read` and `fitmat.fit`.
    """
    measurements = read(sources, **reading)
    jobs = plan(models, measurements, fixed=assignments(fixed, "--fix"))
    return laplace_each(measurements, jobs, seed=seed, progress=progress)


def propose(
    posteriors: Sequence[Posterior],
    target: str | None,
    *,
    kind: Literal["sample", "curve"] = "sample",
    count: int = 5,
) -> Design:
    """Find the next measurements.

    Args:
        posteriors: Of fits to the same measurements; the design is for the first that has the target, the microfacet
            model first, and for "match" against the next.
        target: A parameter, "match", or None for all parameters.
        kind: Single samples or whole curves.
        count: How many.

    Raises:
        FitmatError: as `next_angles`.
    """
    ordered = sorted(posteriors, key=lambda p: not is_microfacet(p.fit.name))
    having = [p for p in ordered if any(target == e.name for e in p.fit.entries)]
    first = (having or ordered)[0]
    against = next((p for p in ordered if p is not first), None) if target == MATCH else None
    return next_angles(first, target=target, against=against, kind=kind, count=count)


def draw(found: Design, picture: Path) -> None:
    """Draw what each of the next measurements is worth.

    Raises:
        OutputError: as `write_picture`.
    """

    def drawn() -> "Figure":
        from fitmat.reports import plot

        ax = plot.new_axes(5.6, 4.4)
        plot.design(found, ax)
        return cast("Figure", ax.figure)

    write_picture(drawn, picture)


def as_json(found: Design) -> str:
    """The design as one JSON object; angles in degrees."""
    return json.dumps(plain(as_dict(found)), indent=2, ensure_ascii=False, allow_nan=False)


def as_dict(found: Design) -> dict[str, Any]:
    """The design, ready for JSON."""
    return {
        "file": found.fit.measurements.source,
        "model": found.fit.name,
        "against": None if found.rival is None else found.rival.name,
        "for": found.target,
        "kind": found.kind,
        "sd_before": _deviations(found, found.sd),
        "proposals": [
            {
                "theta_i_deg": np.rad2deg(p.theta_i),
                "phi_i_deg": np.rad2deg(p.phi_i),
                "theta_o_deg": np.rad2deg(p.theta_o),
                "phi_deg": np.rad2deg(p.phi),
                "repeats": p.repeats,
                "gain": p.gain,
                "sd_after": _deviations(found, p.sd),
            }
            for p in found.proposals
        ],
    }


def _deviations(found: Design, sd: np.ndarray) -> dict[str, dict[str, Any]]:
    kinds = zip(found.names, sd, found.fit.coordinates.log, strict=True)
    return {name: {"sd": float(s), "of": "ln" if ratio else "value"} for name, s, ratio in kinds}


def as_text(found: Design) -> str:
    """Plain words, then a line for each proposal: where, and how well things are known before → after."""
    lines = [("", "light", "sensor", "azimuth", *([] if found.rival else ["known to"]), _gain_heading(found))]
    before = found.sd
    for k, proposal in enumerate(found.proposals):
        known = [] if found.rival else [_known(found, before, proposal.sd)]
        gain = f"{proposal.gain:.1f} sd" if found.rival else f"{proposal.gain:.3g} times"
        lines.append((f"{k + 1}.", *_where(proposal), *known, gain))
        before = proposal.sd
    return text_table(_caption(found), lines)


def _gain_heading(found: Design) -> str:
    return "models apart" if found.rival else "sharper"


def _caption(found: Design) -> str:
    thing = "sample" if found.kind == "sample" else "curve"
    first = found.proposals[0]
    if found.rival is not None:
        return (
            f"To tell {found.fit.name} from {found.rival.name}, measure next where they differ most for what the worse "
            f"of them expects; each {thing} counts those before it."
        )
    what = f"{found.target} of {found.fit.name}" if found.target else f"all parameters of {found.fit.name}"
    light, sensor, _ = _where(first)
    caption = f"For {what}, the {thing} that tells most: light at {light}, sensor at {sensor}."
    return f"{caption} Expected, if the model is right; each line counts those before it."


def _where(p: Proposal) -> tuple[str, str, str]:
    angles = np.rad2deg(p.theta_o)
    turned = f" (azimuth {np.rad2deg(p.phi_i):.0f}°)" if p.phi_i else ""
    sensor = (
        f"{angles[0]:.1f}°" if len(angles) == 1 else f"{angles.min():.0f} to {angles.max():.0f}°, {len(angles)} angles"
    )
    return f"{np.rad2deg(p.theta_i):.0f}°{turned}", sensor, f"{np.rad2deg(p.phi):.0f}°"


def _known(found: Design, before: np.ndarray, after: np.ndarray) -> str:
    """sd before → after of the target, or of the parameter that gains most."""
    owned = [k for k, n in enumerate(found.names) if found.target in (n, n.rpartition(" ")[0])]
    k = max(owned or range(len(after)), key=lambda k: before[k] / after[k])
    log = found.fit.coordinates.log[k]
    return f"{found.names[k]} ± {_amount(before[k], log)} → ± {_amount(after[k], log)}"


def _amount(sd: float, log: bool) -> str:
    """A percentage of what is positive, a factor where that would mislead, else the number."""
    if not log:
        return f"{sd:.2g}"
    return f"{100 * sd:.2g} %" if sd < 0.5 else f"a factor {np.exp(min(sd, 20.0)):.2g}"
