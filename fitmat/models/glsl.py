"""GLSL: what a formula is in the language of shaders, said beside it; and how numbers are written there.

Puts nothing together: `exports` does. A text holds declarations in GLSL ES 3.00 in which parameters, and what other
parts of the same lobe declare, have their own short names; what several lobes share is in `exports/glsl/terms.glsl`.
"""

from collections.abc import Iterable
from typing import Any, ClassVar

import equinox as eqx
import numpy as np

EVERY = "*"
"""All parameters."""


class AbstractShaded(eqx.Module):
    """What may have a form in GLSL.

    Attributes:
        numbers: Parameters, its parts' among them, from which `glsl` makes numbers of its own; `EVERY` for all.
    """

    numbers: ClassVar[tuple[str, ...]] = ()

    def glsl(self) -> str:
        """Declarations in GLSL ES 3.00, the lobe's own function being `vec3 lobe(vec3 wi, vec3 wo)`; "" for none."""
        return ""


def number(value: Any) -> str:
    """One number to the precision of a float, with a point or an exponent, whatever NumPy is told to print.

    Example:
        >>> number(0.1), number(50.0), number(1e-12)
        ('0.1', '50.0', '1e-12')
    """
    single = np.float32(value)
    if single == 0.0 or 1e-4 <= abs(single) < 1e6:
        return np.format_float_positional(single, unique=True, trim="0")
    return np.format_float_scientific(single, unique=True, trim="-", exp_digits=2)


def scalar(name: str, value: Any) -> str:
    """A constant of one number."""
    return f"const float {name} = {number(np.ravel(np.asarray(value))[0])};\n"


def spectrum(name: str, value: Any) -> str:
    """A constant of one number for each channel; one for all serves red, green and blue."""
    return f"const vec3 {name} = {_vector(np.ravel(np.asarray(value)))};\n"


def table(name: str, values: Any) -> str:
    """A constant array, of numbers (k,) or of spectra (k, c)."""
    values = np.asarray(values)
    kind, rows = ("float", map(number, values)) if values.ndim == 1 else ("vec3", map(_vector, values))
    return f"const {kind} {name}[{len(values)}] = {kind}[{len(values)}](\n    {_lines(rows)});\n"


def _vector(values: np.ndarray) -> str:
    return f"vec3({', '.join(map(number, values))})"


def _lines(items: Iterable[str]) -> str:
    """Items with commas between them, four to a line."""
    every = list(items)
    return ",\n    ".join(", ".join(every[k : k + 4]) for k in range(0, len(every), 4))
