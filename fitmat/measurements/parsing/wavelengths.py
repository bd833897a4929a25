"""Wavelengths: which names of columns are wavelengths, as 450nm, R_450 or a bare 450.

It does not know what is measured at them.
"""

import re

from fitmat.measurements.parsing import units

RANGE = (300.0, 2500.0)
"""In nm, from the ultraviolet to the short-wave infrared; a bare number outside it is none."""

_NAME = re.compile(r"(?:r|refl|reflectance|lambda|wl)?[ _]*(\d+(?:\.\d+)?)[ _]*(?:nm|[\[(]nm[\])])?", re.IGNORECASE)


def wavelength(name: str) -> str:
    """The wavelength in nm that a column is named by; "" for another name.

    Example:
        >>> wavelength("450 nm"), wavelength("R_850.5"), wavelength("12"), wavelength("row 450")
        ('450', '850.5', '', '')
    """
    found = _NAME.fullmatch(name.strip()) if len(name) <= units.LONGEST else None
    return found[1] if found and RANGE[0] <= float(found[1]) <= RANGE[1] else ""
