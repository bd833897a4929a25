"""What a BRDF is: a frozen module written for one pair of directions, and the one place that maps it over many.

No formula of any material stands here.
"""

import dataclasses
from abc import abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Self, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat._types import Directions, Samples, Scalar, Spectrum, Vec3
from fitmat.errors import ModelError
from fitmat.maths.programs import program
from fitmat.models.glsl import AbstractShaded
from fitmat.models.parameters import param
from fitmat.text import brief


class AbstractBRDF(AbstractShaded):
    """A reflectance model; its `param` fields are what can be fitted.

    Attributes:
        breaks: Law → how the model breaks it, in a sentence; see `fitmat.models.laws`.
    """

    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({})

    @property
    @abstractmethod
    def name(self) -> str:
        """What `fitmat.model` builds it from."""

    @abstractmethod
    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """f_r in sr⁻¹, without cosine; 0 where a direction is not above the surface.

        Args:
            wi: Unit vector to the light, local frame (n = +z).
            wo: Unit vector to the sensor.
        """

    @abstractmethod
    def width(self) -> Scalar:
        """Slope-like width of the narrowest lobe, in (0, 1]: what a quadrature over directions must resolve."""

    @property
    @abstractmethod
    def isotropic(self) -> bool:
        """Whether only the difference of the two azimuths counts."""

    def mirror(self, wi: Vec3) -> Spectrum:
        """Fraction of the light from ω_i that leaves in the mirror direction alone; 0 but for polished coats."""
        del wi
        return jnp.zeros(())

    def below(self) -> "AbstractBRDF | None":
        """What its `glsl` calls `base`: of a coat what is below it, as it looks through the coat; else None."""
        return None

    def widened(self, slope: Scalar) -> "AbstractBRDF":
        """As it looks through a rough face, whose slopes add to its own; as it is where it has none."""
        del slope
        return self


class AbstractShape(AbstractShaded):
    """How wide a lobe is, and along which axes.

    Attributes:
        suffix: What it adds to the lobe's name.
        isotropic: Whether it is the same along all axes.
        exchanged: The two fields that a quarter turn of its `rotation` exchanges, where there are such.
    """

    suffix: ClassVar[str]
    isotropic: ClassVar[bool]
    exchanged: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def local(self, w: Vec3) -> Vec3:
        """A direction in the frame whose x axis is the tangent."""

    def widened(self, slope: Scalar) -> Self:
        """With the slopes of another surface added; as it is where it has none."""
        del slope
        return self


LEVEL = """
Pair facets(vec3 wi, vec3 wo) {
    return pair(wi, wo);
}
"""
TURNED = """
Pair facets(vec3 wi, vec3 wo) {
    return turned(pair(wi, wo), radians(-rotation));
}
"""
# Two directions in the frame of a shape, in GLSL: the surface's own, or that of a tangent.


class AbstractLobe(AbstractBRDF):
    """One way of scattering light; isotropic unless one of its parts has axes.

    Attributes:
        label: Its name; braces hold what its parts add, as in "ward{roughness.suffix}".
    """

    label: ClassVar[str]

    @property
    def name(self) -> str:
        """The label with what the parts add."""
        return self.label.format_map(vars(self))

    @property
    def isotropic(self) -> bool:
        """Where every shape among the parts is."""
        return all(part.isotropic for part in vars(self).values() if isinstance(part, AbstractShape))

    def widened(self, slope: Scalar) -> Self:
        """With every shape among the parts widened."""
        shapes = {name: part for name, part in vars(self).items() if isinstance(part, AbstractShape)}
        return dataclasses.replace(self, **{name: part.widened(slope) for name, part in shapes.items()})


class AbstractSpecular(AbstractLobe):
    """A lobe around one direction, without diffuse light."""


class AbstractDiffuse(AbstractLobe):
    """A lobe as wide as the hemisphere."""

    def width(self) -> Scalar:
        """1."""
        return jnp.array(1.0)


def specular_weight(doc: str = "specular weight; 1 for a bare surface") -> Any:
    """The parameter ks, in which a specular lobe is linear."""
    return param(0.0, 10.0, symbol="k_s", per_channel=True, weight=True, default=1.0, doc=doc)


class Sum(AbstractBRDF):
    """The sum of lobes, each with its own parameters; usually one diffuse and one specular lobe."""

    lobes: tuple[AbstractBRDF, ...]

    @property
    def name(self) -> str:
        """The lobes' names joined by "+"."""
        return "+".join(lobe.name for lobe in self.lobes)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Σ f_k(ω_i, ω_o)."""
        return sum((lobe(wi, wo) for lobe in self.lobes[1:]), self.lobes[0](wi, wo))

    def width(self) -> Scalar:
        """That of the narrowest lobe."""
        return jnp.min(jnp.stack([lobe.width() for lobe in self.lobes]))

    @property
    def isotropic(self) -> bool:
        """Where all lobes are."""
        return all(lobe.isotropic for lobe in self.lobes)

    def widened(self, slope: Scalar) -> "Sum":
        """The sum of the lobes, widened."""
        return Sum(tuple(lobe.widened(slope) for lobe in self.lobes))

    def mirror(self, wi: Vec3) -> Spectrum:
        """The sum over the lobes."""
        return sum((lobe.mirror(wi) for lobe in self.lobes[1:]), self.lobes[0].mirror(wi))


@dataclasses.dataclass(frozen=True, eq=False)
class MonteCarlo:
    """An estimate.

    Attributes:
        value: Mean over the paths; one row per pair or incidence, one column per channel.
        standard_error: Its standard error, same shape.
        omitted: Fraction of the incident energy in paths that were cut, missing in `value`; one per row.
        samples: Paths followed per row.
    """

    value: Float[np.ndarray, "n c"]
    standard_error: Float[np.ndarray, "n c"]
    omitted: Float[np.ndarray, " n"]
    samples: int
    __repr__ = brief


class AbstractEstimated(AbstractBRDF):
    """A model without a formula, whose values are estimated; it can be evaluated and simulated, and not fitted."""

    @abstractmethod
    def estimate(
        self, wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"], *, samples: int, seed: int
    ) -> MonteCarlo:
        """Values with their standard errors; 0 where a direction is not above the surface."""


def evaluate_pairs(model: AbstractBRDF, wi: Directions, wo: Directions) -> Samples:
    """The model over n pairs, without checks; traceable by JAX."""
    return jax.vmap(lambda a, b: jnp.atleast_1d(model(a, b)))(wi, wo)


def padded_length(count: int) -> int:
    """The array length to compile for: `count` rounded up by at most an eighth (at least 64).

    JAX compiles a program for every array length; with eight lengths an octave most files share theirs.
    """
    step = 2 ** max(4, int(count - 1).bit_length() - 4) if count > 1 else 16
    return max(64, -(-count // step) * step)


def direction_pairs(wi: ArrayLike, wo: ArrayLike) -> list[Float[np.ndarray, "n 3"]]:
    """Both as unit vectors, (n, 3); a single direction beside n stands for as many.

    Raises:
        FitmatError: they are no numbers, not of shape (n, 3), or not of unit length.
    """
    pair = [arguments.numbers(name, w) for name, w in (("wi", wi), ("wo", wo))]
    listed = all(w.ndim == 2 and w.shape[1] == 3 and len(w) > 0 for w in pair)
    if not listed or len({1, *map(len, pair)}) > 2:
        got = f"wi and wo have shapes {pair[0].shape} and {pair[1].shape}"
        raise ModelError(f"{got}: expected (n, 3), n ≥ 1, of both, or (1, 3) of one.")
    for name, w in zip(("wi", "wo"), pair, strict=True):
        arguments.unit_vectors(name, w)
    return list(np.broadcast_arrays(*pair))


@overload
def evaluate(model: AbstractBRDF, wi: ArrayLike, wo: ArrayLike) -> Float[np.ndarray, "n c"]: ...
@overload
def evaluate(model: AbstractBRDF, wi: ArrayLike, wo: ArrayLike, *, samples: int, seed: int) -> MonteCarlo: ...
def evaluate(
    model: AbstractBRDF, wi: ArrayLike, wo: ArrayLike, *, samples: int | None = None, seed: int | None = None
) -> Float[np.ndarray, "n c"] | MonteCarlo:
    """BRDF values in sr⁻¹ (no cosine) for n pairs of directions.

    Args:
        model: From `fitmat.model`.
        wi: Unit vectors to the light, (n, 3) or (1, 3), local frame with the normal +z; `fitmat.directions` makes
            them from angles.
        wo: Unit vectors to the sensor, (n, 3) or (1, 3).
        samples: Paths for each pair, at least 2, of a model that is estimated, such as `ggx-walk`; for no other.
        seed: Of its random numbers.

    Returns:
        Values (n, c), one column per channel; 0 where a direction is below the horizon. Of a model that is estimated
        a `MonteCarlo`: such values with their standard errors.

    Raises:
        ModelError: the shapes differ, the vectors are not of unit length, or samples and seed are not there where
            they are needed, or where they are not.

    Example:
        >>> import fitmat as fm, numpy as np
        >>> up = np.array([[0.0, 0.0, 1.0]])
        >>> fm.evaluate(fm.model("lambert", kd=np.pi / 4), up, up)
        array([[0.25]])
    """
    arguments.kind("model", model, AbstractBRDF)
    pair = direction_pairs(wi, wo)
    if isinstance(model, AbstractEstimated):
        arguments.whole("samples", samples, 2)
        arguments.whole("seed", seed)
        assert samples is not None
        assert seed is not None
        return model.estimate(*pair, samples=samples, seed=seed)
    refuse_sampling(model, samples=samples, seed=seed)
    count = len(pair[0])
    wi, wo = (np.pad(w, ((0, padded_length(count) - count), (0, 0)), mode="edge") for w in pair)
    return np.asarray(_evaluate_jit(model, wi, wo))[:count]


def refuse_sampling(model: AbstractBRDF, **given: object) -> None:
    """Stop where a model with a formula is given what only an estimate takes.

    Raises:
        ModelError: names it.
    """
    for name, value in given.items():
        if value is not None:
            raise ModelError(f"{name} = {value!r} beside {model.name}, expected None: its values are exact.")


_evaluate_jit = program(evaluate_pairs)
