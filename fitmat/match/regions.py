"""Regions: which pairs of directions are specular core, tail, grazing or diffuse, and incidences that tell them apart.

Integrates nothing and knows no model.
"""

import numpy as np
from jaxtyping import Float

from fitmat.maths.quadrature import gauss
from fitmat.models.metrics import NGAN_DEG

GRAZING_DEG = 70.0
"""Either direction beyond this zenith angle makes a pair grazing, whatever its half vector."""

CORE, TAIL = 1.0, 5.0
"""Slopes tan θ_h, in widths of the lobe, up to which a pair is core, and tail."""

REGIONS = {
    "core": f"half vector tilted by at most {CORE:g} width of the lobe, tan θ_h ≤ α",
    "tail": f"half vector between {CORE:g} and {TAIL:g} widths, α < tan θ_h ≤ {TAIL:g} α",
    "grazing": f"θ_i or θ_o beyond {GRAZING_DEG:g}°, whatever the half vector",
    "diffuse": "the rest, far from any highlight",
}
"""Region → what belongs to it; together they are all pairs of directions, and no pair is in two.

The share of facets with slopes up to kα is k²/(1 + k²) for GGX (Walter et al. 2007, eq. 35) and about 1 − exp(−k²) for
a cosine power as wide: core, tail and rest hold 50, 46 and 4 % of the one, 63, 37 and 0 % of the other.
"""

SOFT, SOFT_DEG = 0.2, 3.0
"""Over ω_o a pair passes from one region to the next by a ramp: its widths in slope (relative) and zenith angle.

About the spacing of the nodes of a rule, so that sums over a region converge.
"""

PANEL_NODES = (4, 4, 12)
"""Gauss nodes in cosθ_i beyond `NGAN_DEG`, from there to `GRAZING_DEG`, and above."""


def memberships(wi: Float[np.ndarray, "3"], wo: Float[np.ndarray, "m 3"], width: float) -> Float[np.ndarray, "m 4"]:
    """How far a pair of directions belongs to each region, 0 to 1; columns in the order of `REGIONS`, rows sum to 1.

    Args:
        wi: Unit vector to the light.
        wo: Unit vectors to the sensor, (m, 3).
        width: Slope-like width of the lobe, in (0, 1].
    """
    h = wi + wo
    slope = np.hypot(h[:, 0], h[:, 1]) / np.maximum(width * h[:, 2], 1e-300)
    edge, ramp = np.cos(np.deg2rad(GRAZING_DEG)), SOFT_DEG * np.pi / 180.0 * np.sin(np.deg2rad(GRAZING_DEG))
    steep = np.clip(0.5 + (wo[:, 2] - edge) / ramp, 0.0, 1.0) * (wi[2] >= edge)
    core, near = (np.clip(0.5 + (limit - slope) / (SOFT * limit), 0.0, 1.0) for limit in (CORE, TAIL))
    return np.stack([steep * core, steep * (near - core), 1.0 - steep, steep * (1.0 - near)], axis=1)


def incidence_panels() -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Incidence angles (radians) and weights of ∫ g(θ_i) dω_i over the hemisphere, g(θ_i) the mean over azimuth.

    As `quadrature.incidence_rule` over solid angle, in panels that end where a region or a metric does: a sum over
    part of the nodes is exact for that part.
    """
    edges = [0.0, *np.cos(np.deg2rad([NGAN_DEG, GRAZING_DEG])), 1.0]
    cosines, weights = [], []
    for low, high, count in zip(edges[:-1], edges[1:], PANEL_NODES, strict=True):
        nodes, shares = gauss(count)
        cosines.append(low + (high - low) * (nodes + 1) / 2)
        weights.append(np.pi * (high - low) * shares)
    return np.arccos(np.concatenate(cosines)), np.concatenate(weights)
