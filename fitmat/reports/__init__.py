"""Reports: the page, the terminal and the pictures of what was found.

They compute nothing: numbers come from a study.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["plot"])
