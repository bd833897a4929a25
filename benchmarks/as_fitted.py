"""Shows that intervals hold as people fit: under the default priors, with σ and without it, from few readings as well.

Truths come from the priors of `calibration.py`, discrepancy included, and data from the likelihood; the fits are told
neither. The geometries are those of that page and one of a glossmeter, twelve readings; 3 noises × 2 models. Counted is
whether the 95 % interval that is quoted holds the truth, whatever the posterior says of itself. Writes as_fitted.md.

Every cell is kept in a folder; an interrupted run goes on from there, and a finished one only writes.

Run: python benchmarks/as_fitted.py [--surfaces 70] [--chains 8] [--kept DIR] [--minutes 30]
"""

import argparse
import dataclasses
import itertools
import json
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import jax
import machine
import numpy as np
import platformdirs
from calibration import NOISES, PRIORS, geometries

import fitmat as fm
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.priors import draw, prepare_prior
from fitmat.judgement.calibration import coverage_limits
from fitmat.judgement.prediction import replicated
from fitmat.measurements.instrument import IDEAL
from fitmat.models.parameters import entries
from fitmat.models.values import values

GLOSS = "twelve readings"

SIGMA = {"given": True, "estimated": False}

WANTED = 92.0, 98.0
"""Percent: coverage of 95 % intervals."""

PAGE = """# Do the intervals hold as people fit?

[Calibration](calibration.md) gives the fits the priors from which the truths were drawn, and σ. Here {total:,} fits of
the same surfaces have what `fit` has by default, flat priors within the bounds, of the discrepancy as well, and σ is
given or has to be estimated. The geometries are those of that page, and twelve readings as a glossmeter has them: four
incidences, each at the mirror direction and at 15° and 45° from it, towards the normal; of these no noise can be
estimated, so that its size is inferred with the parameters. Three noises, equally often each:
{noises}.

Percent of the 95 % intervals, as they are quoted, that hold the truth, with 95 % binomial limits; no fit is left out.
By Laplace, {surfaces} surfaces of each noise; by emcee {chains}. Trusted: posteriors that say of themselves that their
draws follow the density; the others ask for emcee. Wanted are {low:g}–{high:g} %. Left out for want of time:
{missing}.

{verdict}

{table}

All parameters together: {methods}.
Laplace falls short where a posterior is a ridge, as between kd, ks and a wide lobe of twelve readings: at its end,
often kd = 0, the curvature sees one side of it; that the noise is inferred from so few readings is allowed for by
Student's t. Many of these say that they are approximate; `fitmat fit` samples by emcee unless told
not to. Truths from a narrower prior than the fits have need not be held equally often, as along the ridge of ks and
eta, whose flat priors favour other ends than the surfaces do.

## Again

    python benchmarks/as_fitted.py {options}

{machine}
"""


@dataclasses.dataclass(frozen=True)
class Cell:
    """Fits of one model in one geometry, of one noise."""

    model: str
    geometry: str
    sigma: str
    method: str
    noise: str
    count: int

    @property
    def key(self) -> str:
        """As a line's name."""
        return ", ".join(map(str, dataclasses.astuple(self)))


def every_geometry() -> dict[str, fm.Measurements]:
    """Those of the calibration, and twelve readings."""
    theta_i, away = (np.deg2rad(part).ravel() for part in np.meshgrid([20.0, 45.0, 60.0, 75.0], [0.0, 15.0, 45.0]))
    signed = theta_i - away
    phi = np.where(signed >= 0, np.pi, 0.0)
    return geometries() | {GLOSS: fm.from_arrays(theta_i, np.abs(signed), np.ones(12), phi=phi, source=GLOSS)}


def cells(surfaces: int, chains: int) -> list[Cell]:
    """Every cell; those of emcee, of twelve readings alone, last."""
    grid = list(itertools.product(PRIORS, every_geometry(), SIGMA))
    found = [Cell(*one, "laplace", noise, surfaces) for noise in NOISES for one in grid]
    return found + [Cell(*one, "emcee", noise, chains) for noise in NOISES for one in grid if one[1] == GLOSS]


def held(cell: Cell) -> dict[str, list]:
    """Whether each interval holds the truth, parameter by parameter, and whether each posterior trusts itself."""
    rng = np.random.default_rng(zlib.crc32(cell.key.encode()))
    prior, template = PRIORS[cell.model], fm.model(cell.model)
    stated = prepare_prior(template, IDEAL, prior)
    truths, s = draw(template, stated, coordinates(template).index, cell.count, rng)
    at, kappa = every_geometry()[cell.geometry], every_geometry()[cell.geometry].wi[:, 2:3]
    centre = fm.model(cell.model, **{name: pair[0] for name, pair in prior.items() if name != "discrepancy"})
    fraction, floor = NOISES[cell.noise]
    sigma = np.hypot(floor, fraction * fm.evaluate(centre, at.wi, at.wo))
    exact = values(template, truths, at.wi, at.wo) * kappa
    measured = replicated(exact, sigma * kappa, s[:, None, None], rng.normal(size=exact.shape)) / kappa
    given = dataclasses.replace(at, sigma=sigma if SIGMA[cell.sigma] else None, valid=np.ones(sigma.shape, bool))
    found, trusted = [], []
    for truth, value in zip(truths, measured, strict=True):
        fit, seed = fm.fit(dataclasses.replace(given, value=value), cell.model), int(rng.integers(2**31))
        posterior = fm.sample(fit, seed=seed) if cell.method == "emcee" else fm.laplace(fit, seed=seed)
        ends = np.concatenate([q.ci95 for q in posterior.quantities()])[: len(truth)]
        found.append(((ends[:, 0] <= truth) & (truth <= ends[:, 1])).tolist())
        trusted.append(bool(posterior.exact))
    return {"held": found, "trusted": trusted}


def rows(found: Mapping[Cell, Mapping[str, list]]) -> Iterator[tuple[tuple[str, ...], np.ndarray, int]]:
    """Model, geometry, σ and method; what was held, (n, p); how many trust themselves; all noises together."""
    groups: dict[tuple[str, ...], list[Mapping[str, list]]] = {}
    for cell, result in found.items():
        groups.setdefault((cell.model, cell.geometry, cell.sigma, cell.method), []).append(result)
    for names, parts in groups.items():
        yield names, np.concatenate([part["held"] for part in parts]), sum(sum(part["trusted"]) for part in parts)


def write(found: Mapping[Cell, Mapping[str, list]], out: Path, options: argparse.Namespace) -> None:
    """`as_fitted.md`."""
    lines, outside, every = ["| model | geometry | σ | method | trusted | 95 % |", "|" + " --- |" * 6], [], []
    pooled: dict[str, list[np.ndarray]] = {}
    for names, hits, trusted in rows(found):
        parameters, each = [e.name for e in entries(fm.model(names[0]))], []
        for parameter, count in zip(parameters, hits.sum(axis=0), strict=True):
            low, high = (100 * end for end in coverage_limits(len(hits), int(count)))
            each.append(f"{parameter} {100 * count / len(hits):.0f} ({low:.0f} – {high:.0f})")
            if high < WANTED[0] or low > WANTED[1]:
                outside.append(f"{parameter} of {', '.join(names)} ({100 * count / len(hits):.0f} %)")
        every.append(hits.ravel())
        pooled.setdefault(f"{GLOSS if names[1] == GLOSS else 'the other geometries'}, {names[3]}", []).append(
            hits.ravel()
        )
        lines.append(f"| {' | '.join(names)} | {trusted} of {len(hits)} | {', '.join(each)} |")
    every_cell = cells(options.surfaces, options.chains)
    missing = "; ".join(cell.key for cell in every_cell if cell not in found) or "nothing"
    page = PAGE.format(
        total=sum(len(part["held"]) for part in found.values()),
        noises=", ".join(f"{floor:g} sr⁻¹ and {name}" for name, (_, floor) in NOISES.items()),
        surfaces=options.surfaces,
        chains=options.chains,
        missing=missing,
        low=WANTED[0],
        high=WANTED[1],
        verdict=_verdict(float(np.mean(np.concatenate(every))), outside),
        table="\n".join(lines),
        methods="; ".join(f"{name} {100 * np.mean(np.concatenate(part)):.1f} %" for name, part in pooled.items()),
        options=f"--surfaces {options.surfaces} --chains {options.chains}",
        machine=machine.described(),
    )
    (out / "as_fitted.md").write_text(page, encoding="utf-8")


def _verdict(mean: float, outside: Sequence[str]) -> str:
    told = f"Outside by more than chance: {'; '.join(outside)}." if outside else "None is outside by more than chance."
    return f"**{'They do not all hold' if outside else 'They hold'}**: {100 * mean:.1f} % of all. {told}"


def main() -> None:
    """Fit what is missing, then write the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--surfaces", type=int, default=70, help="of each noise in a cell, by Laplace")
    options.add_argument("--chains", type=int, default=8, help="of each noise in a cell, by emcee")
    options.add_argument("--kept", type=Path, default=platformdirs.user_cache_path("fitmat") / "as_fitted")
    options.add_argument("--minutes", type=float, default=np.inf, help="begin no cell after so many minutes")
    options.add_argument("--out", type=Path, default=Path(__file__).parent)
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    chosen.kept.mkdir(parents=True, exist_ok=True)
    begin, found = time.monotonic(), {}
    for cell in cells(chosen.surfaces, chosen.chains):
        kept = chosen.kept / f"{cell.key}.json"
        if not kept.exists():
            if time.monotonic() - begin > 60.0 * chosen.minutes:
                continue
            kept.write_text(json.dumps(held(cell)))
            print(f"{(time.monotonic() - begin) / 60:.1f} min: {cell.key}", flush=True)
        found[cell] = json.loads(kept.read_text())
    write(found, chosen.out, chosen)


if __name__ == "__main__":
    main()
