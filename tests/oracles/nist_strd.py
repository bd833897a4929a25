"""NIST Statistical Reference Datasets, nonlinear regression: formulas, certified values, and a reader of the files.

Source: https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml, a work of the US government and in the public domain.
The certified values have 11 digits and were found with 128-bit arithmetic. It fits nothing.
"""

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Formula = Callable[[Array, Array], Array]
"""(b, x) → the predicted response; b in NIST's order, b[0] their b1."""


@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """One dataset with its model and certified results.

    Attributes:
        name: NIST's name.
        formula: The model.
        x: Predictor, (n,), or (2, n) for Nelson.
        y: Response, (n,); for Nelson its logarithm, as NIST's model says.
        starts: The two published starting points, (2, p): far and near.
        certified: Certified parameters, (p,).
        sd: Certified standard deviations of the parameters, (p,).
    """

    name: str
    formula: Formula
    x: Float[np.ndarray, "..."]
    y: Float[np.ndarray, " n"]
    starts: Float[np.ndarray, "2 p"]
    certified: Float[np.ndarray, " p"]
    sd: Float[np.ndarray, " p"]


def _chwirut(b: Array, x: Array) -> Array:
    return jnp.exp(-b[0] * x) / (b[1] + b[2] * x)


def _enso(b: Array, x: Array) -> Array:
    def wave(cos: Array, sin: Array, period: Array | float) -> Array:
        return cos * jnp.cos(2 * jnp.pi * x / period) + sin * jnp.sin(2 * jnp.pi * x / period)

    return b[0] + wave(b[1], b[2], 12.0) + wave(b[4], b[5], b[3]) + wave(b[7], b[8], b[6])


def _gauss(b: Array, x: Array) -> Array:
    peaks = b[2] * jnp.exp(-((x - b[3]) ** 2) / b[4] ** 2) + b[5] * jnp.exp(-((x - b[6]) ** 2) / b[7] ** 2)
    return b[0] * jnp.exp(-b[1] * x) + peaks


def _cubic_ratio(b: Array, x: Array) -> Array:
    return (b[0] + b[1] * x + b[2] * x**2 + b[3] * x**3) / (1 + b[4] * x + b[5] * x**2 + b[6] * x**3)


def _lanczos(b: Array, x: Array) -> Array:
    return b[0] * jnp.exp(-b[1] * x) + b[2] * jnp.exp(-b[3] * x) + b[4] * jnp.exp(-b[5] * x)


FORMULAS: dict[str, Formula] = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1 - jnp.exp(-b[1] * x)),
    "Chwirut1": _chwirut,
    "Chwirut2": _chwirut,
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "ENSO": _enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * jnp.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "Gauss3": _gauss,
    "Hahn1": _cubic_ratio,
    "Kirby2": lambda b, x: (b[0] + b[1] * x + b[2] * x**2) / (1 + b[3] * x + b[4] * x**2),
    "Lanczos1": _lanczos,
    "Lanczos2": _lanczos,
    "Lanczos3": _lanczos,
    "MGH09": lambda b, x: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "MGH10": lambda b, x: b[0] * jnp.exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * jnp.exp(-x * b[3]) + b[2] * jnp.exp(-x * b[4]),
    "Misra1a": lambda b, x: b[0] * (1 - jnp.exp(-b[1] * x)),
    "Misra1b": lambda b, x: b[0] * (1 - (1 + b[1] * x / 2) ** -2),
    "Misra1c": lambda b, x: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1 + b[1] * x),
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * jnp.exp(-b[2] * x[1]),
    "Rat42": lambda b, x: b[0] / (1 + jnp.exp(b[1] - b[2] * x)),
    "Rat43": lambda b, x: b[0] / (1 + jnp.exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - jnp.arctan(b[2] / (x - b[3])) / jnp.pi,
    "Thurber": _cubic_ratio,
}
"""NIST's 27 problems by name."""


def _problem(name: str, results: np.ndarray, data: np.ndarray) -> Problem:
    """From rows (start 1, start 2, certified, sd) and rows (y, x…)."""
    y = np.log(data[:, 0]) if name == "Nelson" else data[:, 0]
    x = data[:, 1] if data.shape[1] == 2 else data[:, 1:].T
    return Problem(name, FORMULAS[name], x, y, results[:, :2].T, results[:, 2], results[:, 3])


def read_problem(path: Path) -> Problem:
    """A file of NIST's, whose header says in which lines the certified values and the data stand."""
    lines = path.read_text(encoding="utf-8").splitlines()

    def block(title: str) -> list[str]:
        found = re.search(rf"{title}\s+\(lines\s+(\d+)\s+to\s+(\d+)\)", "\n".join(lines[:60]))
        assert found is not None, f"{path}: no line numbers of {title}"
        return lines[int(found[1]) - 1 : int(found[2])]

    results = [line.split("=")[1].split() for line in block("Certified Values") if re.match(r"\s*b\d+\s*=", line)]
    data = [line.split() for line in block("Data") if line.strip()]
    return _problem(path.stem, np.array(results, float), np.array(data, float))


MISRA1A = _problem(
    "Misra1a",
    np.array([[500, 250, 2.3894212918e02, 2.7070075241e00], [0.0001, 0.0005, 5.5015643181e-04, 7.2668688436e-06]]),
    np.array(
        [
            [10.07, 77.6], [14.73, 114.9], [17.94, 141.1], [23.93, 190.8], [29.61, 239.9], [35.18, 289.0],
            [40.02, 332.8], [44.82, 378.4], [50.76, 434.8], [55.05, 477.3], [61.01, 536.8], [66.40, 593.1],
            [75.47, 689.1], [81.78, 760.0],
        ]
    ),
)  # fmt: skip
"""Dental research, monomolecular adsorption: volume over pressure (D. Misra, NIST, 1978)."""

DANWOOD = _problem(
    "DanWood",
    np.array([[1, 0.7, 7.6886226176e-01, 1.8281973860e-02], [5, 4, 3.8604055871e00, 5.1726610913e-02]]),
    np.array([[2.138, 1.309], [3.421, 1.471], [3.597, 1.490], [4.340, 1.565], [4.882, 1.611], [5.660, 1.680]]),
)
"""Energy radiated from a carbon filament lamp over temperature (Daniel & Wood 1980)."""
