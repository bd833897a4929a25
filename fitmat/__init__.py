"""fitmat: from measured reflectance to a material you can trust; the public names are listed in `__init__.pyi`."""

from typing import Any

import lazy_loader

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """A public name, loaded when it is first asked for; the version is read from what is installed."""
    if name == "__version__":
        from importlib.metadata import version

        return version("fitmat")
    return _public(name)
