"""Multiple scattering on Smith surfaces, computed by another implementation: Heitz's own algorithm in C++.

Source: the code supplemental to E. Heitz, J. Hanika, E. d'Eon & C. Dachsbacher, Multiple-scattering microfacet BSDFs
with the Smith model, ACM TOG 35(4), 2016 (https://eheitzresearch.wordpress.com/240-2/), in the form in which libbsdf
ships it (KimuraRyo/libbsdf, MultipleScatteringSmith.cpp: `MicrosurfaceConductor`, `MicrosurfaceDielectric`, methods
`eval` and `sample`), single precision, Gaussian heights, g++ -O2, std::mt19937 seeded with 20160701. Totals and
albedos are from 4·10⁶ paths each, single orders from 10⁶. The conductor is white (F = 1).

The code itself approximates: directions within 0.81° of the normal count as the normal, GGX's slope across is a
rational fit, Beckmann's distribution function is inverted to 1e-5 above erf = −0.9999.
"""

from typing import NamedTuple


class Value(NamedTuple):
    """BRDF (sr⁻¹, no cosine) towards theta_o, for light at azimuth 20° and a sensor `phi` further; angles in degrees.

    `eta` = 0 is the white conductor; `order` = 0 stands for all orders.
    """

    distribution: str
    alpha_x: float
    alpha_y: float
    eta: float
    theta_i: float
    theta_o: float
    phi: float
    order: int
    value: float
    standard_error: float


class Reflected(NamedTuple):
    """Fraction of the light from theta_i (degrees, azimuth 20°) that a dielectric reflects; the rest is transmitted."""

    distribution: str
    alpha_x: float
    alpha_y: float
    eta: float
    theta_i: float
    value: float
    standard_error: float


# fmt: off
VALUES = [
    Value("ggx", 0.5, 0.5, 0, 10, 30, 180, 0, 0.419669, 0.000109),
    Value("ggx", 0.5, 0.5, 0, 10, 30, 180, 1, 0.307004, 0.000006),
    Value("ggx", 0.5, 0.5, 0, 10, 30, 180, 2, 0.082463, 0.000151),
    Value("ggx", 0.5, 0.5, 0, 10, 30, 180, 3, 0.023824, 0.000096),
    Value("ggx", 0.5, 0.5, 0, 45, 45, 180, 0, 0.712545, 0.000139),
    Value("ggx", 0.5, 0.5, 0, 45, 45, 180, 1, 0.569412, 0.000030),
    Value("ggx", 0.5, 0.5, 0, 45, 45, 180, 2, 0.115144, 0.000222),
    Value("ggx", 0.5, 0.5, 0, 45, 45, 180, 3, 0.022991, 0.000102),
    Value("ggx", 0.5, 0.5, 0, 60, 20, 90, 0, 0.258670, 0.000096),
    Value("ggx", 0.5, 0.5, 0, 60, 20, 90, 2, 0.072692, 0.000137),
    Value("ggx", 0.5, 0.5, 0, 60, 20, 90, 3, 0.019010, 0.000090),
    Value("ggx", 0.5, 0.5, 0, 75, 75, 180, 0, 2.390018, 0.000404),
    Value("ggx", 0.5, 0.5, 0, 75, 75, 180, 1, 2.244624, 0.000614),
    Value("ggx", 0.5, 0.5, 0, 75, 75, 180, 2, 0.136465, 0.000497),
    Value("ggx", 0.5, 0.5, 0, 75, 75, 180, 3, 0.007675, 0.000090),
    Value("ggx", 0.5, 0.5, 0, 75, 60, 40, 0, 0.186009, 0.000096),
    Value("ggx", 0.5, 0.5, 0, 75, 60, 40, 1, 0.115920, 0.000011),
    Value("ggx", 0.5, 0.5, 0, 75, 60, 40, 2, 0.059099, 0.000160),
    Value("ggx", 0.5, 0.5, 0, 75, 60, 40, 3, 0.009653, 0.000073),
    Value("ggx", 1, 1, 0, 10, 30, 180, 0, 0.348734, 0.000151),
    Value("ggx", 1, 1, 0, 10, 30, 180, 1, 0.085997, 0.000006),
    Value("ggx", 1, 1, 0, 10, 30, 180, 2, 0.109908, 0.000118),
    Value("ggx", 1, 1, 0, 10, 30, 180, 3, 0.082537, 0.000146),
    Value("ggx", 1, 1, 0, 45, 45, 180, 0, 0.322947, 0.000120),
    Value("ggx", 1, 1, 0, 45, 45, 180, 1, 0.112539, 0.000017),
    Value("ggx", 1, 1, 0, 45, 45, 180, 2, 0.110358, 0.000115),
    Value("ggx", 1, 1, 0, 45, 45, 180, 3, 0.063485, 0.000121),
    Value("ggx", 1, 1, 0, 60, 20, 90, 0, 0.299210, 0.000139),
    Value("ggx", 1, 1, 0, 60, 20, 90, 1, 0.110547, 0.000002),
    Value("ggx", 1, 1, 0, 60, 20, 90, 2, 0.102688, 0.000138),
    Value("ggx", 1, 1, 0, 60, 20, 90, 3, 0.055962, 0.000143),
    Value("ggx", 1, 1, 0, 75, 75, 180, 0, 0.444846, 0.000140),
    Value("ggx", 1, 1, 0, 75, 75, 180, 1, 0.307727, 0.000123),
    Value("ggx", 1, 1, 0, 75, 75, 180, 2, 0.110539, 0.000187),
    Value("ggx", 1, 1, 0, 75, 75, 180, 3, 0.023286, 0.000099),
    Value("ggx", 1, 1, 0, 75, 60, 40, 0, 0.347936, 0.000104),
    Value("ggx", 1, 1, 0, 75, 60, 40, 1, 0.209724, 0.000036),
    Value("ggx", 1, 1, 0, 75, 60, 40, 2, 0.102246, 0.000142),
    Value("ggx", 1, 1, 0, 75, 60, 40, 3, 0.029202, 0.000095),
    Value("beckmann", 0.5, 0.5, 0, 10, 30, 180, 0, 0.383875, 0.000101),
    Value("beckmann", 0.5, 0.5, 0, 10, 30, 180, 2, 0.031615, 0.000185),
    Value("beckmann", 0.5, 0.5, 0, 45, 45, 180, 0, 0.845080, 0.000368),
    Value("beckmann", 0.5, 0.5, 0, 45, 45, 180, 2, 0.188636, 0.000633),
    Value("beckmann", 0.5, 0.5, 0, 45, 45, 180, 3, 0.018859, 0.000273),
    Value("beckmann", 0.5, 0.5, 0, 60, 20, 90, 0, 0.266455, 0.000023),
    Value("beckmann", 0.5, 0.5, 0, 60, 20, 90, 2, 0.013623, 0.000044),
    Value("beckmann", 0.5, 0.5, 0, 75, 75, 180, 0, 3.914308, 0.000798),
    Value("beckmann", 0.5, 0.5, 0, 75, 75, 180, 1, 3.542031, 0.000455),
    Value("beckmann", 0.5, 0.5, 0, 75, 75, 180, 2, 0.362910, 0.001483),
    Value("beckmann", 0.5, 0.5, 0, 75, 75, 180, 3, 0.011121, 0.000298),
    Value("beckmann", 1, 1, 0, 10, 30, 180, 0, 0.314328, 0.000180),
    Value("beckmann", 1, 1, 0, 10, 30, 180, 2, 0.177091, 0.000255),
    Value("beckmann", 1, 1, 0, 10, 30, 180, 3, 0.037356, 0.000216),
    Value("beckmann", 1, 1, 0, 45, 45, 180, 0, 0.289685, 0.000146),
    Value("beckmann", 1, 1, 0, 45, 45, 180, 1, 0.151548, 0.000004),
    Value("beckmann", 1, 1, 0, 45, 45, 180, 2, 0.118870, 0.000235),
    Value("beckmann", 1, 1, 0, 45, 45, 180, 3, 0.017598, 0.000134),
    Value("beckmann", 1, 1, 0, 60, 20, 90, 0, 0.315904, 0.000154),
    Value("beckmann", 1, 1, 0, 60, 20, 90, 2, 0.108765, 0.000273),
    Value("beckmann", 1, 1, 0, 60, 20, 90, 3, 0.010721, 0.000118),
    Value("beckmann", 1, 1, 0, 75, 75, 180, 0, 0.573210, 0.000133),
    Value("beckmann", 1, 1, 0, 75, 75, 180, 1, 0.526611, 0.000153),
    Value("beckmann", 1, 1, 0, 75, 75, 180, 2, 0.045588, 0.000209),
    Value("beckmann", 1, 1, 0, 75, 60, 40, 0, 0.076782, 0.000009),
    Value("beckmann", 1, 1, 0, 75, 60, 40, 1, 0.076257, 0.000006),
    Value("ggx", 0.2, 0.7, 0, 10, 30, 180, 0, 0.386675, 0.000200),
    Value("ggx", 0.2, 0.7, 0, 10, 30, 180, 1, 0.244926, 0.000002),
    Value("ggx", 0.2, 0.7, 0, 10, 30, 180, 2, 0.106577, 0.000280),
    Value("ggx", 0.2, 0.7, 0, 10, 30, 180, 3, 0.028548, 0.000194),
    Value("ggx", 0.2, 0.7, 0, 45, 45, 180, 0, 1.453225, 0.000385),
    Value("ggx", 0.2, 0.7, 0, 45, 45, 180, 1, 1.087543, 0.000024),
    Value("ggx", 0.2, 0.7, 0, 45, 45, 180, 2, 0.292012, 0.000593),
    Value("ggx", 0.2, 0.7, 0, 45, 45, 180, 3, 0.062015, 0.000330),
    Value("ggx", 0.2, 0.7, 0, 60, 20, 90, 0, 0.090660, 0.000086),
    Value("ggx", 0.2, 0.7, 0, 60, 20, 90, 2, 0.031828, 0.000112),
    Value("ggx", 0.2, 0.7, 0, 60, 20, 90, 3, 0.012251, 0.000095),
    Value("ggx", 0.2, 0.7, 0, 75, 75, 180, 0, 6.487622, 0.001154),
    Value("ggx", 0.2, 0.7, 0, 75, 75, 180, 1, 5.605569, 0.000965),
    Value("ggx", 0.2, 0.7, 0, 75, 75, 180, 2, 0.776882, 0.001872),
    Value("ggx", 0.2, 0.7, 0, 75, 75, 180, 3, 0.093415, 0.000648),
    Value("ggx", 0.2, 0.7, 0, 75, 60, 40, 0, 0.031920, 0.000045),
    Value("ggx", 0.2, 0.7, 0, 75, 60, 40, 1, 0.016142, 0.000003),
    Value("ggx", 0.2, 0.7, 0, 75, 60, 40, 2, 0.011153, 0.000066),
    Value("ggx", 0.2, 0.7, 0, 75, 60, 40, 3, 0.003797, 0.000045),
    Value("ggx", 0.5, 0.5, 1.5, 10, 30, 180, 0, 0.012895, 0.000004),
    Value("ggx", 0.5, 0.5, 1.5, 45, 45, 180, 0, 0.030691, 0.000009),
    Value("ggx", 0.5, 0.5, 1.5, 60, 20, 90, 0, 0.007478, 0.000003),
    Value("ggx", 0.5, 0.5, 1.5, 75, 75, 180, 0, 0.597107, 0.000123),
    Value("ggx", 0.5, 0.5, 1.5, 75, 60, 40, 0, 0.005428, 0.000005),
    Value("beckmann", 0.8, 0.8, 1.5, 10, 30, 180, 0, 0.006618, 0.000008),
    Value("beckmann", 0.8, 0.8, 1.5, 45, 45, 180, 0, 0.014775, 0.000016),
    Value("beckmann", 0.8, 0.8, 1.5, 60, 20, 90, 0, 0.011594, 0.000005),
    Value("beckmann", 0.8, 0.8, 1.5, 75, 75, 180, 0, 0.266752, 0.000065),
]

REFLECTED = [
    Reflected("ggx", 0.5, 0.5, 1.5, 0.5, 0.030151, 0.000086),
    Reflected("ggx", 0.5, 0.5, 1.5, 45, 0.036782, 0.000094),
    Reflected("ggx", 0.5, 0.5, 1.5, 80, 0.089937, 0.000143),
    Reflected("beckmann", 0.8, 0.8, 1.5, 0.5, 0.029019, 0.000084),
    Reflected("beckmann", 0.8, 0.8, 1.5, 45, 0.039246, 0.000097),
    Reflected("beckmann", 0.8, 0.8, 1.5, 80, 0.091835, 0.000144),
]

SHARES = (0.683088, 0.243431, 0.060600, 0.011114)
# Of light that leaves after 1, 2, 3, 4 collisions: GGX, alpha 0.5, theta_i 45°, 4·10⁶ paths, each ± 0.0002.
