"""The page and the pictures of `calibration.py`.

Simulates nothing.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import machine
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from fitmat.judgement.calibration import (
    FAMILY,
    LEVELS,
    LOG_LIKELIHOOD,
    RANKED_DRAWS,
    Calibration,
    coverage_limits,
    join,
)
from fitmat.judgement.multiplicity import adjusted_for_many
from fitmat.judgement.uniformity import band

BAND = 0.95
"""Simultaneous coverage of the bands in the pictures."""

LINE, BAD, SHADE = "#0072b2", "#d55e00", "0.88"

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#000000")
"""Of quantities: Okabe & Ito's, told apart by the colour-blind."""

PAGE = """# Are the intervals right?

Simulation-based calibration (Talts et al. 2018): {total:,} surfaces were drawn from a prior, measured by the likelihood
and fitted under that same prior. Where the program is right, a 95 % interval holds the truth 95 times in 100, and the
rank of the truth among {draws} posterior draws is uniform. Ranks are tested as a whole (Säilynoja, Bürkner & Vehtari
2022), also those of the log-likelihood, which notices what single parameters cannot (Modrák et al. 2023).

Three geometries, equally often each: one curve at 45°; four curves in the plane of incidence; two scans of the
hemisphere. Three noises, equally often each: {noises} of the value
that the prior's centre has. Priors, centre ± sd, cut off at the bounds, half-normal for the discrepancy:

{priors}

{verdict}

## Coverage

Percent of the simulations whose central interval holds the truth, with 95 % binomial limits; p of the uniformity of
the ranks. All {tests} p-values are one family (Holm 1979), which a right program fails with probability {family:g}.
A posterior that does not trust itself (Laplace: Pareto k̂ above 0.7; emcee: chains that do not agree) tells the user so
and is left out of the judgement; it says so from the data alone, which leaves ranks uniform.
{left_out}

{coverage}

![Ranks](calibration-ranks.png)

Cumulative ranks minus the diagonal, each with the band that holds the whole line in 95 of 100 cases; orange where it
leaves its own band, which one line in twenty does by chance: the p-values judge all together. The last row has a
planted fault.

![Coverage](calibration-coverage.png)

## By geometry and noise

Range of the coverage of 95 % intervals over the parameters and s, and the smallest p of the quantities; again one
family ({cell_tests} tests, {cell_verdict}).

{cells}

## Planted faults

The same fits, told another noise than there was: the check must notice. The discrepancy makes up for noise that is
missing, so that it and the log-likelihood give the fault away before the parameters do.

{faults}

## Again

    python benchmarks/calibration.py{again}

{machine}
"""


def write(found: Mapping[Any, Calibration], out: Path, priors: Mapping[str, Any], noises: Mapping[str, Any]) -> None:
    """`calibration.md` and its two pictures.

    Args:
        found: Cell → what came out of it.
        out: Folder.
        priors: Model → parameter → centre and sd.
        noises: Name → fraction and floor.
    """
    right = {cell: result for cell, result in found.items() if cell.told == 1.0}
    pooled = _grouped(right, lambda cell: (cell.model, cell.method))
    by_cell = _grouped(right, lambda cell: (cell.model, cell.geometry, cell.noise, cell.method))
    faulty = _grouped({c: r for c, r in found.items() if c.told != 1.0}, lambda cell: (cell.model, cell.told))
    wrong, wrong_cells = _rejected(pooled), _rejected(by_cell)
    page = PAGE.format(
        total=sum(len(result.trusted) for result in right.values()),
        draws=RANKED_DRAWS,
        priors="\n".join(f"- {name}: {_prior(given)}" for name, given in priors.items()),
        left_out=_left_out(pooled),
        noises=", ".join(f"{floor:g} sr⁻¹ and {name}" for name, (_, floor) in noises.items()),
        verdict=_verdict(wrong),
        tests=sum(len(result.quantities) for result in pooled.values()),
        family=FAMILY,
        coverage=_table(("model", "method", "quantity", *(f"{100 * x:g} %" for x in LEVELS), "p"), _coverage(pooled)),
        cell_tests=sum(len(result.quantities) for result in by_cell.values()),
        cell_verdict=f"rejected: {'; '.join(map(', '.join, wrong_cells)) or 'none'}",
        cells=_table(("model", "geometry", "noise", "method", "judged", "95 %", "smallest p"), _cells(by_cell)),
        faults=_table(("model", "σ told / true", "simulations", "95 %", "smallest p", "found"), _faults(faulty)),
        again=f" --rounds {1 + max(cell.part for cell in right)}",
        machine=machine.described(),
    )
    (out / "calibration.md").write_text(page, encoding="utf-8")
    rows = {f"{model}\n{method}": result for (model, method), result in pooled.items()}
    rows |= {f"{model}\nσ × {told:g} told": faulty[model, told] for model, told in list(faulty)[:1]}
    _pictures(rows, out)


def _grouped(found: Mapping[Any, Calibration], key: Callable[[Any], tuple]) -> dict[tuple, Calibration]:
    groups: dict[tuple, list[Calibration]] = {}
    for cell, result in found.items():
        groups.setdefault(key(cell), []).append(result)
    return {name: join(parts) for name, parts in groups.items()}


def _rejected(groups: Mapping[tuple, Calibration]) -> list[tuple[str, ...]]:
    """Names of the group and the quantity of every test that falls, all groups being one family."""
    names = [(*map(str, group), quantity) for group, result in groups.items() for quantity in result.quantities]
    p = np.concatenate([result.p_values() for result in groups.values()])
    return [names[k] for k in np.flatnonzero(adjusted_for_many(np.asarray(p)) < FAMILY)]


def _verdict(wrong: Sequence[tuple[str, ...]]) -> str:
    if wrong:
        return f"**Not calibrated:** {'; '.join(', '.join(names) for names in wrong)}."
    return (
        "**Calibrated:** no test fails; the intervals are as sure as they say, as far as so many simulations can tell."
    )


def _prior(given: Mapping[str, tuple[float, float]]) -> str:
    return ", ".join(f"{name} {centre:g} ± {sd:g}" for name, (centre, sd) in given.items())


def _coverage(pooled: Mapping[tuple, Calibration]) -> Iterator[tuple[str, ...]]:
    for (name, method), result in pooled.items():
        hits, count = result.covered[result.trusted].sum(axis=0), int(result.trusted.sum())
        for k, (quantity, p) in enumerate(zip(result.quantities, result.p_values(), strict=True)):
            if quantity == LOG_LIKELIHOOD:
                yield (name, method, quantity, *("",) * len(LEVELS), f"{p:.2g}")
                continue
            limits = [coverage_limits(count, int(row[k])) for row in hits]
            shown = [
                f"{100 * row[k] / count:.1f} ({100 * low:.0f} – {100 * high:.0f})"
                for row, (low, high) in zip(hits, limits, strict=True)
            ]
            yield (name, method, quantity, *shown, f"{p:.2g}")


def _left_out(pooled: Mapping[tuple, Calibration]) -> str:
    """What becomes of the posteriors that do not trust themselves."""
    left = {names: result.covered[~result.trusted, -1] for names, result in pooled.items() if not result.trusted.all()}
    told = [
        f"{len(part)} of {len(pooled[name, method].trusted)} of {name} by {method}, whose 95 % intervals held "
        f"{100 * part.mean(axis=0).min():.0f} – {100 * part.mean(axis=0).max():.0f} % of the truths"
        for (name, method), part in left.items()
    ]
    return f"Left out: {'; '.join(told)}." if told else "None is left out."


def _range(result: Calibration) -> str:
    widest = 100 * result.coverage()[-1]
    return f"{widest.min():.0f} – {widest.max():.0f}"


def _cells(by_cell: Mapping[tuple, Calibration]) -> Iterator[tuple[str, ...]]:
    for (*names, method), result in sorted(by_cell.items(), key=lambda item: item[0][0]):
        judged = f"{result.trusted.sum()} of {len(result.trusted)}"
        yield (*names, method, judged, _range(result), f"{result.p_values().min():.2g}")


def _faults(faulty: Mapping[tuple, Calibration]) -> Iterator[tuple[str, ...]]:
    for (name, told), result in faulty.items():
        found = ", ".join(result.faults()) or "no"
        yield name, f"{told:g}", str(result.trusted.sum()), _range(result), f"{result.p_values().min():.2g}", found


def _table(headings: Sequence[str], rows: Iterator[tuple[str, ...]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _pictures(rows: Mapping[str, Calibration], out: Path) -> None:
    width = max(len(result.quantities) for result in rows.values())
    figure, axes = plt.subplots(
        len(rows), width, figsize=(2.3 * width, 1.9 * len(rows)), squeeze=False, sharex=True, layout="constrained"
    )
    for line, (name, result) in zip(axes, rows.items(), strict=True):
        line[0].set_ylabel(name, fontsize=8)
        for ax in line[len(result.quantities) :]:
            ax.set_axis_off()
        for k, quantity in enumerate(result.quantities):
            ranks_figure(line[k], result.ranks[result.trusted, k]).set_title(quantity, fontsize=9)
    figure.supxlabel("rank of the truth / draws: fraction of draws below it", fontsize=9)
    figure.savefig(out / "calibration-ranks.png", dpi=110)
    figure, line = plt.subplots(1, len(rows), figsize=(2.6 * len(rows), 3.0), squeeze=False, layout="constrained")
    line = line[0]
    for ax, (name, result) in zip(line, rows.items(), strict=True):
        coverage_figure(ax, result).set_title(name, fontsize=8)
        if "told" not in name:
            ax.set_ylim(-15.0, 10.0)
    line[0].set_ylabel("truths inside − level (percentage points)", fontsize=8)
    figure.supxlabel("level of the central interval (%)", fontsize=9)
    figure.savefig(out / "calibration-coverage.png", dpi=110)
    plt.close("all")


def ranks_figure(ax: Axes, ranks: np.ndarray) -> Axes:
    """Cumulative ranks minus the diagonal, with their simultaneous band; orange where they leave it."""
    z, limits = band(len(ranks), RANKED_DRAWS, BAND)
    below = np.searchsorted(np.sort(ranks), np.arange(1, RANKED_DRAWS + 1)) / len(ranks)
    outside = bool(((below < limits[0] - 1e-12) | (below > limits[1] + 1e-12)).any())
    ax.fill_between(z, limits[0] - z, limits[1] - z, color=SHADE, linewidth=0)
    ax.plot(z, below - z, color=BAD if outside else LINE, linewidth=1.2)
    ax.axhline(0.0, color="0.5", linewidth=0.5)
    ax.tick_params(labelsize=7)
    return ax


def coverage_figure(ax: Axes, result: Calibration) -> Axes:
    """Coverage minus level of every central interval of ranks; one line for each quantity, with pointwise limits."""
    levels = np.arange(1, RANKED_DRAWS // 2 + 1) * 2.0 / (RANKED_DRAWS + 1)
    off = np.abs(2.0 * result.ranks[result.trusted] - RANKED_DRAWS) / (RANKED_DRAWS + 1)
    count = len(off)
    error = 1.96 * np.sqrt(levels * (1 - levels) / count)
    ax.fill_between(100 * levels, -100 * error, 100 * error, color=SHADE, linewidth=0)
    for k, quantity in enumerate(result.quantities):
        inside = (off[:, k, None] < levels).mean(axis=0)
        ax.plot(100 * levels, 100 * (inside - levels), linewidth=1.0, label=quantity, color=COLOURS[k])
    ax.axhline(0.0, color="0.5", linewidth=0.5)
    ax.legend(fontsize=6, frameon=False, loc="lower left")
    ax.tick_params(labelsize=7)
    return ax
