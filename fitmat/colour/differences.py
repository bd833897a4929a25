"""Differences of colours: spaces in which equal distances look alike, and the distances in them.

It knows neither channels nor spectra; `channels` and `observers` do.
"""

import numpy as np
from jaxtyping import Float

WHITE = np.array([0.3127 / 0.3290, 1.0, (1.0 - 0.3127 - 0.3290) / 0.3290])
"""CIE XYZ of D65, from its chromaticity to four digits as in IEC 61966-2-1 and ITU-R BT.2020."""

PRIMARIES = np.array([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]])
"""Chromaticities x, y of red, green and blue of ITU-R BT.2020."""

RGB_TO_LMS = np.array([[1688.0, 2146.0, 262.0], [683.0, 2951.0, 462.0], [99.0, 309.0, 3688.0]]) / 4096.0
LMS_TO_ICTCP = np.array([[2048.0, 2048.0, 0.0], [6610.0, -13613.0, 7003.0], [17933.0, -17390.0, -543.0]]) / 4096.0
"""ITU-R BT.2100-2, table 7, with the perceptual quantiser."""

WHITE_LUMINANCE = 203.0
"""Luminance of white in cd/m² where ΔE_ITP needs one: the reference white of ITU-R BT.2408-7, sec. 2.1."""

JUST_NOTICEABLE, CLEARLY_VISIBLE = 1.0, 3.0
"""ΔE2000 from which an eye may notice a difference side by side, and from which anybody does.

Mokrzycki & Tatol 2011 (Machine Graphics & Vision 20(4)): below 1 not noticed, from 2–3.5 on by the untrained as well;
Paravina et al. 2015 (J. Esthet. Restor. Dent. 27): half of the observers see 0.8 and reject 1.8. ΔE_ITP is scaled so
that 1 is just noticeable (ITU-R BT.2124).
"""

SEEN = (
    (1.0, "not visible"),
    (2.0, "for trained eyes"),
    (3.5, "just visible"),
    (5.0, "clearly visible"),
    (np.inf, "different colours"),
)
"""ΔE2000 up to which a difference side by side is called so (Mokrzycki & Tatol 2011)."""

HIGHEST_LUMINANCE = 10_000.0
"""What the perceptual quantiser of SMPTE ST 2084 can say at most, in cd/m²."""


def seen(delta: float) -> str:
    """What an eye sees of a ΔE2000, in the words of `SEEN`."""
    return next((words for limit, words in SEEN if delta < limit), SEEN[-1][1])


def delta_e_2000(
    one: Float[np.ndarray, "... 3"], other: Float[np.ndarray, "... 3"], white: Float[np.ndarray, "3"] = WHITE
) -> Float[np.ndarray, "..."]:
    """CIEDE2000 colour difference, `ciede2000`, of tristimulus values.

    Args:
        one: CIE XYZ.
        other: The same of the other colours.
        white: XYZ of what counts as white, Y = 1; D65 unless told.
    """
    return ciede2000(to_lab(one, white), to_lab(other, white))


def delta_e_itp(one: Float[np.ndarray, "... 3"], other: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """ΔE_ITP, `itp`, of tristimulus values.

    Args:
        one: CIE XYZ, white D65 at Y = 1, which has `WHITE_LUMINANCE`; clipped to what ITU-R BT.2100 can say.
        other: The same of the other colours.
    """
    pairs = (np.clip(WHITE_LUMINANCE * xyz, 0.0, HIGHEST_LUMINANCE) for xyz in (one, other))
    return itp(*(to_ictcp(xyz) for xyz in pairs))


def greys_2000(one: Float[np.ndarray, "..."], other: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """CIEDE2000 of greys: without chroma only lightness is left, |ΔL′|/S_L.

    Args:
        one: Luminances, white Y = 1.
        other: The same of the other greys.
    """
    lightness = [116.0 * _lightness_root(y) - 16.0 for y in (one, other)]
    from_middle = ((lightness[0] + lightness[1]) / 2.0 - 50.0) ** 2
    return np.abs(lightness[1] - lightness[0]) / (1.0 + 0.015 * from_middle / np.sqrt(20.0 + from_middle))


def greys_itp(one: Float[np.ndarray, "..."], other: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """ΔE_ITP of greys: all cones respond alike, so that C_T = C_P = 0 and 720 |ΔI| is left.

    Args:
        one: Luminances, white Y = 1, which has `WHITE_LUMINANCE`; clipped as in `delta_e_itp`.
        other: The same of the other greys.
    """
    first, second = (_quantised(np.clip(WHITE_LUMINANCE * y, 0.0, HIGHEST_LUMINANCE)) for y in (one, other))
    return 720.0 * np.abs(second - first)


def to_lab(xyz: Float[np.ndarray, "... 3"], white: Float[np.ndarray, "3"] = WHITE) -> Float[np.ndarray, "... 3"]:
    """CIE L*a*b* (CIE 15:2018, eqs. 8.3–8.11).

    Args:
        xyz: CIE XYZ.
        white: XYZ of what counts as white, Y = 1; D65 unless told.
    """
    f = _lightness_root(xyz / white)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def _lightness_root(ratio: np.ndarray) -> np.ndarray:
    return np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), (29 / 6) ** 2 / 3 * ratio + 4 / 29)


def ciede2000(one: Float[np.ndarray, "... 3"], other: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """CIEDE2000 (Sharma, Wu & Dalal 2005, Color Research & Application 30, eqs. 2–22), k_L = k_C = k_H = 1.

    Args:
        one: CIE L*a*b*.
        other: The same of the other colours.
    """
    (l1, a1, b1), (l2, a2, b2) = (np.moveaxis(lab, -1, 0) for lab in (one, other))
    stretch = 1.5 - 0.5 * _saturation((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2)
    c1, c2 = np.hypot(stretch * a1, b1), np.hypot(stretch * a2, b2)
    h1, h2 = (np.rad2deg(np.arctan2(b, stretch * a)) % 360.0 for a, b in ((a1, b1), (a2, b2)))
    turn, total = h2 - h1, h1 + h2
    # Hues more than half a turn apart are closer the other way round, and so is their mean.
    across = np.abs(turn) > 180.0
    turn = turn - np.where(across, 360.0 * np.sign(turn), 0.0)
    h = np.where(across, total + np.where(total < 360.0, 360.0, -360.0), total) / 2
    # A grey has no hue; its chroma of 0 takes away all that depends on one.
    dl, dc, dh = l2 - l1, c2 - c1, 2.0 * np.sqrt(c1 * c2) * np.sin(np.deg2rad(turn / 2))
    from_middle, c = ((l1 + l2) / 2 - 50.0) ** 2, (c1 + c2) / 2
    t = 1.0 - 0.17 * _cos(h - 30.0) + 0.24 * _cos(2.0 * h) + 0.32 * _cos(3.0 * h + 6.0) - 0.20 * _cos(4.0 * h - 63.0)
    s_l = 1.0 + 0.015 * from_middle / np.sqrt(20.0 + from_middle)
    s_c, s_h = 1.0 + 0.045 * c, 1.0 + 0.015 * c * t
    r_t = -2.0 * _saturation(c) * np.sin(np.deg2rad(60.0 * np.exp(-(((h - 275.0) / 25.0) ** 2))))
    return np.sqrt((dl / s_l) ** 2 + (dc / s_c) ** 2 + (dh / s_h) ** 2 + r_t * (dc / s_c) * (dh / s_h))


def to_ictcp(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """IC_TC_P with the perceptual quantiser (ITU-R BT.2100-2, tables 4 and 7).

    Args:
        xyz: CIE XYZ, white D65, Y in cd/m² up to `HIGHEST_LUMINANCE`. What no light can be, with a negative response of
            a cone, has 0 there.
    """
    lms = xyz @ np.linalg.inv(_from_bt2020()).T @ RGB_TO_LMS.T
    return _quantised(np.maximum(lms, 0.0)) @ LMS_TO_ICTCP.T


def itp(one: Float[np.ndarray, "... 3"], other: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """ΔE_ITP of ITU-R BT.2124-0, annex 1: 720 √(ΔI² + ΔT² + ΔP²), with T = C_T/2 and P = C_P.

    Args:
        one: IC_TC_P.
        other: The same of the other colours.
    """
    return 720.0 * np.sqrt(np.sum(((other - one) * [1.0, 0.5, 1.0]) ** 2, axis=-1))


def _cos(degrees: np.ndarray) -> np.ndarray:
    return np.cos(np.deg2rad(degrees))


def _saturation(chroma: np.ndarray) -> np.ndarray:
    """√(C⁷/(C⁷ + 25⁷)), of CIEDE2000."""
    return np.sqrt(chroma**7 / (chroma**7 + 25.0**7))


def _from_bt2020() -> Float[np.ndarray, "3 3"]:
    """Linear RGB of BT.2020 to XYZ: the primaries, so much of each that their sum is white."""
    x, y = PRIMARIES.T
    columns = np.stack([x / y, np.ones(3), (1.0 - x - y) / y])
    return columns * np.linalg.solve(columns, WHITE)


def _quantised(luminance: np.ndarray) -> np.ndarray:
    """The inverse EOTF of SMPTE ST 2084."""
    y = (luminance / HIGHEST_LUMINANCE) ** (2610 / 16384)
    return ((3424 / 4096 + 2413 / 128 * y) / (1.0 + 2392 / 128 * y)) ** (2523 / 32)
