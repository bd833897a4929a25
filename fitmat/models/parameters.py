"""Parameters of a model: bounds, unit, symbol and scale in one place, and the model's values as one vector.

This room knows nothing of reflection and fits nothing.
"""

import dataclasses
import functools
from abc import abstractmethod
from collections.abc import Container, Mapping, Sequence
from typing import Any, Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths.arrays import library

M = TypeVar("M", bound=eqx.Module)


@dataclasses.dataclass(frozen=True)
class Param:
    """What is known of a parameter before any data.

    Attributes:
        lower: Smallest allowed value.
        upper: Largest allowed value.
        symbol: The letter of the literature.
        unit: Unit, "1" for none.
        scale: "log" where equal ratios matter (widths, exponents), else "linear".
        per_channel: One value per channel when fitted to several channels, else shared.
        weight: True where the BRDF is proportional to it (kd, ks): solved linearly in the start grid.
        starts: Values tried in the start grid; empty for weights.
        doc: What it means, in a few words.
        period: Values that differ by it are the same surface; 0 where there is none. The range holds two of them, so
            that half of one on either side of (−period/2, period/2] lies within it.
    """

    lower: float
    upper: float
    symbol: str
    unit: str
    scale: Literal["linear", "log"]
    per_channel: bool
    weight: bool
    starts: tuple[float, ...]
    doc: str
    period: float = 0.0


def param(
    lower: float,
    upper: float,
    *,
    symbol: str,
    doc: str,
    unit: str = "1",
    scale: Literal["linear", "log"] = "linear",
    per_channel: bool = False,
    weight: bool = False,
    starts: tuple[float, ...] = (),
    period: float = 0.0,
    default: float | None = None,
    optional: bool = False,
) -> Any:
    """Declare a model field as a parameter; see `Param` for the arguments; an optional one may be None."""
    meta = Param(lower, upper, symbol, unit, scale, per_channel, weight, starts, doc, period)
    extra: dict[str, Any] = {} if default is None and not optional else {"default": default}
    return eqx.field(converter=_as_optional if optional else as_parameter, metadata={"param": meta}, **extra)


def _as_optional(value: Any) -> Any:
    return None if value is None else as_parameter(value)


def as_parameter(value: Any) -> Any:
    """A number, or one number per channel, as a floating-point array: JAX's inside a program, else NumPy's."""
    if value is None or isinstance(value, str | bytes | bool):
        raise ModelError(f"parameter value {value!r}: expected a number or one number per channel.")
    if isinstance(value, jax.Array):
        return value if jnp.issubdtype(value.dtype, jnp.floating) else jnp.asarray(value, float)
    found = arguments.numbers("parameter value", value)
    if found.ndim > 1:
        arguments.refuse("parameter value", value, "a number or one number per channel")
    return found


def of_size(name: str, given: Any, channels: int | None, per_channel: bool) -> Any:
    """The same as one number for each channel where the parameter has as many, for a model of `channels`.

    Raises:
        ModelError: it has another number of values.
    """
    value = as_parameter(given)
    if channels is not None and per_channel:
        if value.size not in (1, channels):
            raise ModelError(f"parameter {name} has {value.size} values: expected 1 or {channels}, one a channel.")
        return np.broadcast_to(np.ravel(value), (channels,))
    if channels is not None and value.size != 1:
        raise ModelError(f"parameter {name} has {value.size} values: expected 1, it is shared by all channels.")
    return value


@dataclasses.dataclass(frozen=True)
class Entry:
    """A named parameter of one model, with its place in the model's parameter vector."""

    name: str
    param: Param
    place: slice
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many numbers it holds: 1, or one per channel."""
        return self.place.stop - self.place.start


def _walk(module: Any, owner: str) -> list[tuple[str, str, Param, tuple[int, ...]]]:
    found = []
    for field in dataclasses.fields(module):
        value = getattr(module, field.name)
        if field.metadata.get("static") or ("param" in field.metadata and value is None):
            continue
        if "param" in field.metadata:
            found.append((owner, field.name, field.metadata["param"], np.shape(value)))
        elif isinstance(value, tuple):
            for part in value:
                found += _walk(part, getattr(part, "name", owner))
        elif isinstance(value, eqx.Module):
            found += _walk(value, getattr(value, "name", owner))
    return found


def entries(model: eqx.Module) -> tuple[Entry, ...]:
    """The model's parameters in the order of its vector (`vector(model)`).

    A name that two lobes share is written with its lobe: `phong.ks`, `ggx.ks`.
    """
    leaves, structure = jax.tree.flatten(model)
    return _entries(structure, tuple(np.shape(leaf) for leaf in leaves))


@functools.lru_cache(maxsize=256)
def _entries(structure: Any, shapes: tuple[tuple[int, ...], ...]) -> tuple[Entry, ...]:
    """Of any model of this structure and these shapes."""
    found = _walk(jax.tree.unflatten(structure, [np.ones(shape) for shape in shapes]), "")
    names = [name for _, name, _, _ in found]
    result, start = [], 0
    for owner, name, meta, shape in found:
        unique = name if names.count(name) == 1 else f"{owner}.{name}"
        stop = start + int(np.prod(shape, dtype=int))
        result.append(Entry(unique, meta, slice(start, stop), tuple(shape)))
        start = stop
    return tuple(result)


def vector(model: eqx.Module) -> Any:
    """All parameter values as one vector (p,), physical units; of NumPy outside of programs."""
    leaves = jax.tree.leaves(model)
    xp = library(*leaves)
    return xp.concatenate([xp.ravel(xp.asarray(leaf)) for leaf in leaves]) if leaves else np.zeros(0)


def with_vector(model: M, values: Any) -> M:
    """The same model with the parameter values of `values`, (p,), the inverse of `vector`."""
    leaves, structure = jax.tree.flatten(model)
    parts, start = [], 0
    for leaf in leaves:
        stop = start + np.size(leaf)
        parts.append(values[start:stop].reshape(np.shape(leaf)))
        start = stop
    return jax.tree.unflatten(structure, parts)


def holding(model: eqx.Module, held: Mapping[str, Any]) -> Float[np.ndarray, " p"]:
    """The model's parameter vector with the parameters that are held, by name, at their values."""
    found = np.array(vector(model), float)
    for entry in entries(model):
        if entry.name in held:
            found[entry.place] = held[entry.name]
    return found


class AbstractOfChannels(eqx.Module):
    """A part of a model that knows more of its channels than the parameters say, as their wavelengths."""

    @abstractmethod
    def of_channels(self, which: np.ndarray) -> "AbstractOfChannels":
        """The same of some of them."""


def of_channels(model: M, which: np.ndarray, channels: int) -> M:
    """The same model of some of its channels.

    Args:
        model: With one number, or `channels` numbers, in each parameter.
        which: Their positions.
        channels: How many there are.
    """

    def chosen(part: Any) -> Any:
        if isinstance(part, AbstractOfChannels):
            return part.of_channels(which)
        return part[which] if np.shape(part) == (channels,) else part

    return jax.tree.map(chosen, model, is_leaf=lambda part: isinstance(part, AbstractOfChannels))


def bounds(model: eqx.Module) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Lower and upper bounds of the model's parameter vector, physical units."""
    ends = [(e.param.lower, e.param.upper) for e in entries(model) for _ in range(e.size)]
    lower, upper = np.array(ends, float).reshape(-1, 2).T
    return lower, upper


def assignments(texts: Sequence[str], option: str) -> dict[str, np.ndarray]:
    """`NAME=VALUE` texts as arrays; a value may be a comma-separated list, one number per channel.

    Raises:
        ModelError: a text is not of that form, or a name is given twice.
    """
    found: dict[str, np.ndarray] = {}
    for text in texts:
        name, _, values = text.partition("=")
        refuse_repeated(name.strip(), found, option)
        try:
            found[name.strip()] = np.array([float(v) for v in values.split(",")])
        except ValueError as error:
            raise ModelError(f"{option} {text!r}: expected NAME=NUMBER, for example ks=1.") from error
    return found


def refuse_repeated(name: str, found: Container[str], option: str) -> None:
    """Stop at a parameter that the command line has given before.

    Raises:
        ModelError: names the option and the parameter.
    """
    if name in found:
        raise ModelError(f"{option} {name} is given twice, expected one value of it. Leave one out.")


def check_range(model: eqx.Module) -> None:
    """Refuse parameter values outside their bounds.

    Raises:
        ModelError: names the parameter, the value and its range.
    """
    values = np.asarray(vector(model))
    for entry in entries(model):
        part, p = values[entry.place], entry.param
        bad = part[~((part >= p.lower) & (part <= p.upper))]
        if bad.size:
            raise ModelError(f"parameter {entry.name} = {bad[0]:g}: expected a value from {p.lower:g} to {p.upper:g}.")
