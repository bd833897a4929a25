"""Shown: a surface as its measurement shows it, whatever stands between the two.

It changes no value itself.
"""

import dataclasses
from typing import ClassVar, Self

import equinox as eqx

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.models.base import AbstractBRDF


class AbstractShown(AbstractBRDF):
    """A base as its measurement shows it; the base is the material itself.

    Attributes:
        base: The material.
        prefix: What it adds to the base's name: nothing where it makes no other material of it.
        level: Whether the base's normal is that of the measured angles; the azimuth of a lean counts.
    """

    base: eqx.AbstractVar[AbstractBRDF]
    prefix: ClassVar[str] = ""
    level: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """The prefix and the base's name."""
        return self.prefix + self.base.name

    def width(self) -> Scalar:
        """That of the base."""
        return self.base.width()

    @property
    def isotropic(self) -> bool:
        """Where the base is, and level."""
        return self.level and self.base.isotropic

    def widened(self, slope: Scalar) -> Self:
        """With the base widened."""
        return dataclasses.replace(self, base=self.base.widened(slope))  # pyright: ignore[reportCallIssue]

    def mirror(self, wi: Vec3) -> Spectrum:
        """That of the base."""
        return self.base.mirror(wi)


def surface(model: AbstractBRDF) -> AbstractBRDF:
    """The material itself: without what the instrument and the mount do to its measurement."""
    while isinstance(model, AbstractShown):
        model = model.base
    return model
