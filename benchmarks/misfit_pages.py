"""The page and the picture of `misfit.py`.

Measures nothing.
"""

import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import machine
import matplotlib.pyplot as plt
import numpy as np
from wrong_truths import FAMILIES, RIGHT, SPLITS

from fitmat.judgement.calibration import coverage_limits

LINE, BAD, SHADE = "#0072b2", "#d55e00", "0.88"

POOLED, CELL, TRUE = (90.0, 99.0), 80.0, (93.0, 97.0)
"""Percent: coverage of all families together, of any cell at least, and of the right model."""

WIDTH = 1.1
"""Widths of the right model's intervals over those of the likelihood, at most."""

Line = Mapping[str, Any]

PAGE = """# Do the intervals hold when the model is wrong?

{surfaces:,} surfaces that neither default model describes, each measured by two laboratories at other angles (noise
{noise}). If the intervals are honest, that of the difference of the two results holds 0 in 95 of 100 cases. The truth
will not serve for this: a wrong model has none, and each set of angles has a best fit of its own. Compared are the
parameters that both determine and that lie on no bound, ks·F0, albedos at 20, 50 and 70°, and the match's distance; of
{spheres} surfaces also what an eye sees of the difference of the two models on a lit sphere, mean ΔE2000.

{families}

{verdict}

## By split

Percent of the differences whose 95 % interval holds 0, over all families and quantities; beside it what it would be if
the misfit of every sample were its own, as in a likelihood with an independent discrepancy. Limits: 95 % binomial, of
as many surfaces (the quantities of one surface are hardly independent).

Interleaved laboratories have almost the same misfit, which cancels in their difference: the likelihood alone, of which
no honest interval may fall short, covers {alone} % there. An interval is about what another range of incidences gives,
for a laboratory does not know with whom it will be compared: where two share a range it is wider than their difference
needs, and one that were as narrow as that would not hold low against high.

{splits}

![Coverage](misfit.png)

## By family

The same for each family and split; a cell is one of these.

{cells}

## By quantity

{quantities}

{weak}

A misfit that one of the parameters can imitate leaves no residual from which its size could be known. What only the
other laboratory's incidences show is extrapolated: of the distance of the match the part beyond one's own incidences
counts as known to a standard deviation of a half, of ΔE nothing is added, and a lobe that was seen at low incidences
alone has its reflectance, ks·F0, but hardly ks and eta apart.

## The right model

{right} surfaces of {right_name}, each laboratory by itself against the truth. Width: of the interval over that of the
likelihood alone, mean; wider: share of the measurements whose intervals changed at all.

{truths}

## By emcee

{chains} cases were sampled as well. Where draws are widened, those of the chain and those of the Gaussian must give the
same intervals: standard deviations of the widened differences, emcee's over Laplace's, median {ratio} (5 to 95 %:
{ratio_range}).

## Again

    python benchmarks/misfit.py {options}

{machine}
"""


def write(found: Sequence[Line], out: Path, options: str) -> None:
    """`misfit.md` and its picture, from what `misfit.judged` found with these options."""
    laplace = [line for line in found if line["method"] == "laplace"]
    wrong, right = _rows(laplace, right=False), _rows(laplace, right=True)
    ratios = _ratios(found)
    page = PAGE.format(
        surfaces=len({row["case"] for row in wrong}),
        spheres=len({row["case"] for row in wrong if row["quantity"] == "match ΔE2000"}),
        noise="1 % + 5e-4 sr⁻¹",
        families="\n".join(f"- **{name}**: {words}" for name, words in FAMILIES.items()),
        verdict=_verdict(wrong, right),
        alone=f"{_percent(_of(wrong, split='interleaved'), 'plain'):.1f}",
        splits=_table(("split", "surfaces", "covered", "if independent", "times wider, median"), _by_split(wrong)),
        cells=_table(("family", *SPLITS), _by_cell(wrong)),
        quantities=_table(("quantity", *SPLITS, "if independent, all splits"), _by_quantity(wrong)),
        weak=_weak(wrong),
        right=len({row["case"] for row in right}),
        right_name=RIGHT,
        truths=_table(("quantity", "covered", "likelihood alone", "width", "wider"), _truths(right)),
        chains=len({line["case"] for line in found if line["method"] == "emcee"}),
        ratio=f"{statistics.median(ratios):.3f}" if ratios else "–",
        ratio_range=" to ".join(f"{x:.2f}" for x in np.quantile(ratios, [0.05, 0.95])) if ratios else "–",
        options=options,
        machine=machine.described(),
    )
    (out / "misfit.md").write_text(page, encoding="utf-8")
    _picture(wrong, out)


def _rows(lines: Iterable[Line], *, right: bool) -> list[dict[str, Any]]:
    """One for each quantity of each case."""
    kept = [line for line in lines if (line["family"] == RIGHT) == right]
    return [row | {key: line[key] for key in ("case", "family", "split")} for line in kept for row in line["rows"]]


def _percent(rows: Sequence[Line], kind: str = "wide") -> float:
    return 100.0 * float(np.mean([row[kind] for row in rows])) if rows else float("nan")


def _of(rows: Sequence[Line], **given: str) -> list[Line]:
    return [row for row in rows if all(row[key] == value for key, value in given.items())]


def _verdict(wrong: Sequence[Line], right: Sequence[Line]) -> str:
    """Whether the intervals hold, and where they are wider than they need be."""
    splits = {split: _percent(_of(wrong, split=split)) for split in SPLITS}
    cells = {(f, s): _percent(_of(wrong, family=f, split=s)) for f in FAMILIES for s in SPLITS}
    true, width = _percent(right), float(np.mean([row["wide sd"] / row["plain sd"] for row in right] or [np.nan]))
    missed = [f"{s}, {x:.1f} %" for s, x in splits.items() if not x >= POOLED[0]]
    missed += [f"{f}, {s}, {x:.1f} %" for (f, s), x in cells.items() if not x >= CELL]
    missed += [f"the right model, {true:.1f} %"] if not TRUE[0] <= true <= TRUE[1] else []
    missed += [f"widths of the right model, × {width:.2f}"] if not width <= WIDTH else []
    wide = [f"{s} ({x:.1f} %)" for s, x in splits.items() if x > POOLED[1]]
    verdict = "**They do not hold**" if missed else "**They hold**"
    words = (
        f"{verdict}: {min(splits.values()):.1f}–{max(splits.values()):.1f} % of each split, at least "
        f"{min(cells.values()):.0f} % of each family in each split; {true:.1f} % of the right model, whose widths are "
        f"× {width:.2f}. Wanted are {POOLED[0]:g}–{POOLED[1]:g} %, {CELL:g} %, {TRUE[0]:g}–{TRUE[1]:g} % and at most "
        f"× {WIDTH:g}."
    )
    words += f" Missed: {'; '.join(missed)}." if missed else ""
    return words + (f" Wider than they need be: {'; '.join(wide)}." if wide else "")


def _by_split(rows: Sequence[Line]) -> Iterator[tuple[str, ...]]:
    for split in SPLITS:
        part = _of(rows, split=split)
        if not part:
            continue
        count = len({row["case"] for row in part})
        low, high = coverage_limits(count, round(count * _percent(part) / 100.0))
        wider = statistics.median(row["wide sd"] / max(row["plain sd"], 1e-300) for row in part)
        covered = f"{_percent(part):.1f} ({100 * low:.0f} – {100 * high:.0f})"
        yield split, str(count), covered, f"{_percent(part, 'plain'):.1f}", f"{wider:.1f}"


def _by_cell(rows: Sequence[Line]) -> Iterator[tuple[str, ...]]:
    for family in FAMILIES:
        parts = [_of(rows, family=family, split=split) for split in SPLITS]
        yield family, *(f"{_percent(part):.0f} ({_percent(part, 'plain'):.0f})" for part in parts)


def _by_quantity(rows: Sequence[Line]) -> Iterator[tuple[str, ...]]:
    for quantity in sorted({row["quantity"] for row in rows}):
        every = _of(rows, quantity=quantity)
        parts = [_of(every, split=split) for split in SPLITS]
        yield quantity, *(f"{_percent(part):.0f}" for part in parts), f"{_percent(every, 'plain'):.0f}"


def _weak(rows: Sequence[Line]) -> str:
    """Quantities that hold less often than a cell must."""
    found = []
    for split in SPLITS:
        part = _of(rows, split=split)
        shares = {name: _percent(_of(part, quantity=name)) for name in sorted({row["quantity"] for row in part})}
        found += [f"{name}, {split} ({x:.0f} %)" for name, x in shares.items() if x < CELL]
    return f"Below {CELL:g} %: {'; '.join(found)}." if found else f"None is below {CELL:g} %."


def _truths(rows: Sequence[Line]) -> Iterator[tuple[str, ...]]:
    for quantity in (*sorted({row["quantity"] for row in rows}), "all"):
        part = rows if quantity == "all" else _of(rows, quantity=quantity)
        width = np.array([row["wide sd"] / row["plain sd"] for row in part])
        changed = f"{100 * np.mean(width != 1.0):.1f} %"
        yield quantity, f"{_percent(part):.1f}", f"{_percent(part, 'plain'):.1f}", f"× {width.mean():.2f}", changed


def _ratios(found: Sequence[Line]) -> list[float]:
    """emcee's standard deviation over Laplace's, of each quantity of each case that both have."""
    known = {
        (line["case"], row["quantity"]): row["wide sd"]
        for line in found
        if line["method"] == "laplace"
        for row in line["rows"]
    }
    sampled = [(line["case"], row) for line in found if line["method"] == "emcee" for row in line["rows"]]
    return [row["wide sd"] / known[case, row["quantity"]] for case, row in sampled if (case, row["quantity"]) in known]


def _table(headings: Sequence[str], rows: Iterator[tuple[str, ...]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _picture(rows: Sequence[Line], out: Path) -> None:
    """Differences over their standard deviation, sorted, beside what a Gaussian would give."""
    figure, every = plt.subplots(1, len(SPLITS), figsize=(11, 2.9), sharey=True, layout="constrained")
    for ax, split in zip(every, SPLITS, strict=True):
        part = _of(rows, split=split)
        for kind, colour, name in (("plain", BAD, "if independent"), ("wide", LINE, "as quoted")):
            z = np.sort([abs(row["apart"]) / max(row[f"{kind} sd"], 1e-300) for row in part])
            ax.plot(z, 100.0 * (np.arange(len(z)) + 0.5) / max(len(z), 1), color=colour, label=name)
        ax.axvline(1.96, color="0.5", lw=0.8)
        ax.axhspan(*POOLED, color=SHADE, lw=0)
        ax.set(title=split, xlabel="|difference| / sd", xscale="symlog", xlim=(0, 60), ylim=(0, 100))
    every[0].set_ylabel("percent of the differences below")
    every[0].legend(loc="lower right", fontsize=8)
    figure.savefig(out / "misfit.png", dpi=110)
    plt.close(figure)
