"""MaterialX 1.39: elements of a document as text. It knows no material."""

from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

Inputs = dict[str, tuple[str, Any]]
"""Name of an input → its type and value."""

WORDS = ("boolean", "filename", "string")
"""Types of which a text is the value; of others it is the name of a node."""

SRGB = "filename of sRGB"
"""Instead of a type: the file of a picture in sRGB."""

KINDS = dict.fromkeys(("surface", "open_pbr_surface", "gltf_pbr"), "surfaceshader") | {"surfacematerial": "material"}
KINDS |= dict.fromkeys(("tangent", "normal", "rotate3d"), "vector3") | {"image": "color3", "extract": "float"}
"""Category → its type, where it is no BSDF."""


def element(category: str, name: str, inputs: Inputs) -> str:
    """A node, of a document whose renderers know its category."""
    inner = "".join(_input(key, kind, value) for key, (kind, value) in inputs.items())
    kind = KINDS.get(category, "BSDF")
    return f"  <{category} name={quoteattr(name)} type={quoteattr(kind)}>\n{inner}  </{category}>\n"


def _input(name: str, kind: str, value: Any) -> str:
    kind, space = ("filename", ' colorspace="srgb_texture"') if kind == SRGB else (kind, "")
    if isinstance(value, str):
        said = f"{'value' if kind in WORDS else 'nodename'}={quoteattr(value)}{space}"
    elif kind == "integer":
        said = f'value="{value}"'
    else:
        count = {"color3": 3, "vector2": 2}.get(kind, 1)
        numbers = np.broadcast_to(np.ravel(np.asarray(value, float)), (count,))
        said = f'value="{", ".join(repr(float(x)) for x in numbers)}"'
    return f"    <input name={quoteattr(name)} type={quoteattr(kind)} {said} />\n"


def whole(nodes: str) -> str:
    """The element of a document, whose colours are linear in Rec. 709."""
    return f'<materialx version="1.39" colorspace="lin_rec709">\n{nodes}</materialx>\n'


def file(comment: str, document: str) -> str:
    """The text of a file that begins with a comment."""
    said = comment.replace("--", "-\\u002d")
    return f'<?xml version="1.0"?>\n<!--\n{said}\n-->\n{document}'
