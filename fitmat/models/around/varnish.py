"""Varnish: a coat over any base, with the light that goes back and forth between the two."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.models.around.coat import AbstractCoat, SmoothCoat
from fitmat.models.around.exchange import exchange, light_glsl, mirrored
from fitmat.models.base import AbstractBRDF
from fitmat.models.glsl import EVERY


class Varnish(AbstractBRDF):
    """A dielectric coat over a base: `varnish-over-BASE` (polished), `rough-varnish-over-BASE` (GGX face).

    f = f_c + E(c_i) E(c_o)/η² · (f_b(ω_i′, ω_o′) h(c_i) h(c_o) + η² e(c_i) e(c_o)/(π ē))

    ω′ are the directions refracted into the coat and f_b is the base. E(c) is what reaches it: (1 − F) exp(−τ/c′) in a
    polished coat; under a rough face what that does not reflect, less what is absorbed on the ways that it opens. What
    the underside returns meets the base again, any number of times: h and e come from the adding equation for
    energies, solved with the base's own values and, for a rough face, with what photons do there by any number of
    facets (a table). h raises the base's lobe to the energy that leaves after one bounce, and to 1/(1 − s) of it, s
    being what one more bounce adds in the mirror direction, relative; e is what leaves besides, spread as Kulla & Conty
    spread it, ē = 2∫ e E c dc. For a Lambert base all of it is Saunderson's kd/(π(1 − kd R)), R the share of even light
    that the underside returns. Through a rough face slopes of the base look wider, α_b² + α² (1 − 1/η)²/2. f_c is
    the face's own lobe, and what its facets reflect more than once.

    Parameters: eta, index of the coat, 1 to 3, shared; depth, absorption coefficient times thickness, 0 to 10, per
    channel: 0.1 is yellowed varnish; alpha, slope of the face, rough coat only, 0.001 to 1: 0.03 is glossy; and those
    of the base.

    Limits: the mirror image in a polished coat is a single direction, which no BRDF value holds: peaks that were
    measured need the rough coat. The albedo with the mirror is that of photons within 1 %, over diffuse bases and
    metals, polished and rough; and 1 over a base that keeps all. Where light goes that came back several times is
    approximate: the peak over a metal (F0 0.9) is right to 1 % at normal incidence, 5 % at 60°. Lobes without slopes,
    such as Phong's, are seen through a rough face as they are. eta = 1 is the base. Positive, reciprocal, conserves
    energy where the base does.

    References: J. Saunderson, Calculation of the color of pigmented plastics, JOSA 32, 1942; K. N. Liou, An
    Introduction to Atmospheric Radiation, 2002, sec. 6.4 (adding); C. Kulla & A. Conty, SIGGRAPH course 2017; A.
    Weidlich & A. Wilkie, Arbitrarily layered micro-facet surfaces, GRAPHITE 2007 (refracted directions and
    absorption); E. Heitz et al., ACM TOG 35(4), 2016 (the rough face); variances of slopes as in L. Belcour, ACM TOG
    37(4), 2018; W. Jakob et al., Mitsuba 3, plugin `plastic`.

    Example: `fm.model("rough-varnish-over-lambert", kd=0.4, alpha=0.05, depth=0.1)`
    """

    numbers: ClassVar[tuple[str, ...]] = (EVERY,)

    coat: AbstractCoat
    base: AbstractBRDF

    @property
    def name(self) -> str:
        """The coat's name, "-over-", the base's name."""
        return f"{self.coat.name}-over-{self.base.name}"

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """What the coat mirrors, and what the base sends through it."""
        layer, seen = self.coat.layer(), self.below()
        light, visible = exchange(self.base, seen, layer), above(wi, wo)
        wi, wo = (jnp.where(visible, w, np.array([0.0, 0.0, 1.0])) for w in (wi, wo))
        enter, leave = layer.entering(wi[2]), layer.entering(wo[2])
        body = seen(layer.refracted(wi), layer.refracted(wo)) * light.raised(wi[2]) * light.raised(wo[2])
        through = enter * leave / layer.eta**2 * (body + light.spread(wi[2], wo[2]))
        return jnp.where(visible, self.coat.mirrored(wi, wo) + through, 0.0)

    def below(self) -> AbstractBRDF:
        """The base with its lobes as they look through the face."""
        return self.coat.seen(self.base)

    def widened(self, slope: Scalar) -> "Varnish":
        """Coat and base, as they look through the rough face of another coat."""
        return Varnish(self.coat.widened(slope), self.base.widened(slope))

    def glsl(self) -> str:
        """The same; what goes back and forth between coat and base is numbers, unless the base has a polished coat."""
        if any(isinstance(part, SmoothCoat) for part in jax.tree.leaves(self.base, is_leaf=_is_smooth)):
            return ""
        light = jax.jit(lambda: exchange(self.base, self.below(), self.coat.layer()).numbers())()
        return (
            light_glsl(*light)
            + """
vec3 refracted(vec3 w) {
    return vec3(w.xy / eta, sqrt(max((eta - 1.0) * (eta + 1.0) + w.z * w.z, 1e-14)) / eta);
}

vec3 lobe(vec3 wi, vec3 wo) {
    vec3 down = refracted(wi), up = refracted(wo);
    vec3 body = base(down, up) * raised(wi.z) * raised(wo.z);
    vec3 spread = eta * eta * later(wi.z) * later(wo.z) / (PI * whole);
    return mirrored(wi, wo) + passed(wi.z, down.z) * passed(wo.z, up.z) / (eta * eta) * (body + spread);
}
"""
        )

    def mirror(self, wi: Vec3) -> Spectrum:
        """That of the polished face, and of a polished coat below it through this one."""
        return self.coat.mirror(wi[2]) + mirrored(self.below(), self.coat.layer(), wi)

    def width(self) -> Scalar:
        """Of the narrower of coat and base."""
        return jnp.minimum(self.coat.width(), self.below().width())

    @property
    def isotropic(self) -> bool:
        """Where the base is."""
        return self.base.isotropic


def _is_smooth(part: object) -> bool:
    return isinstance(part, SmoothCoat)
