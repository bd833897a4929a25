"""Shaders: a translated material as files, the function to paste and a vertex and a fragment shader that light with it.

It translates nothing; glslangValidator compiles them where there is one, and nothing here runs them.
"""

import dataclasses
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from fitmat.errors import OutputError
from fitmat.text import brief

ES, DESKTOP = "300 es", "330"
"""Versions of the language; a text of the first is one of the second."""

COMPILER = "glslangValidator"

VERTEX = """#version 300 es
uniform mat4 mvpMatrix;  // object to clip space
uniform mat4 mvMatrix;   // object to the frame of the eye
layout(location = 0) in vec3 position;
layout(location = 2) in vec3 normal;
out vec3 interpolated_position;
out vec3 interpolated_normal;

void main() {
    interpolated_position = (mvMatrix * vec4(position, 1.0)).xyz;
    interpolated_normal = transpose(inverse(mat3(mvMatrix))) * normal;
    gl_Position = mvpMatrix * vec4(position, 1.0);
}
"""

BEFORE = """#version 300 es
precision highp float;
precision highp int;

uniform mat4 mvMatrix;  // object to the frame of the eye
uniform vec3 source;    // where the point light is, in the frame of the eye
uniform vec3 emission;  // its radiant intensity, W/sr in red, green and blue
in vec3 interpolated_position;
in vec3 interpolated_normal;
out vec4 fragment_color;  // radiance, W/(m^2 sr), linear: tone and gamma are for whoever displays it

"""

AFTER = """
void main() {
    vec3 n = normalize(interpolated_normal);
    vec3 beam = source - interpolated_position;
    vec3 across = cross(mvMatrix[1].xyz, n);  // the tangent, azimuth 0, runs around the object's y axis
    vec3 t = normalize(dot(across, across) > 1e-12 ? across : cross(mvMatrix[0].xyz, n));
    mat3 surface = transpose(mat3(t, cross(n, t), n));
    vec3 wi = surface * normalize(beam), wo = surface * normalize(-interpolated_position);
    float irradiance = max(wi.z, 0.0) / dot(beam, beam);  // cosine and inverse square
    fragment_color = vec4(brdf(wi, wo) * emission * irradiance, 1.0);
}
"""

SMOOTH = "vec3 n = normalize(interpolated_normal);"
BUMPED = "vec3 n = bumped(normalize(interpolated_normal));"


@dataclasses.dataclass(frozen=True)
class Shader:
    """A material as a function, and what the pair of shaders around it is.

    Attributes:
        brdf: By `translation.translated`.
        version: Of the language, `ES` or `DESKTOP`.
        bump: Whether heights bend the normal.
    """

    brdf: str
    version: str = ES
    bump: bool = False

    __repr__ = brief


def texts(name: str, header: Sequence[str], shader: Shader) -> dict[str, str]:
    """File names → texts.

    Args:
        name: Of the files, without their ending.
        header: Lines that each begins with as comments; in shaders after the version, which must come first.
        shader: The material.
    """
    comment = "".join(f"// {line}\n" for line in header)
    version = f"#version {shader.version}\n"
    before, vertex = (text.split("\n", 1)[1] for text in (BEFORE, VERTEX))
    if shader.version == DESKTOP:  # where every number is of single precision
        before = re.sub(r"^precision .*\n", "", before, flags=re.MULTILINE).lstrip()
    after = AFTER
    if shader.bump:
        heights = files("fitmat.exports.glsl").joinpath("bump.glsl").read_text(encoding="utf-8")
        after = f"\n{heights}{AFTER.replace(SMOOTH, BUMPED)}"
    return {
        f"{name}.glsl": comment + "\n" + shader.brdf,
        f"{name}.vert": f"{version}{comment}{vertex}",
        f"{name}.frag": f"{version}{comment}{before}{shader.brdf}{after}",
    }


def compiled(written: Mapping[str, str]) -> str | None:
    """The compiler that took the pair of shaders among the texts, and linked them; None where there is none.

    Raises:
        OutputError: it refuses them, or does not run.
    """
    program = shutil.which(COMPILER)
    if program is None:
        return None
    with tempfile.TemporaryDirectory(prefix="fitmat-shaders-") as folder:
        kinds = "vert", "frag"
        for name, text in written.items():
            if (kind := name.rpartition(".")[2]) in kinds:
                (Path(folder) / f"material.{kind}").write_text(text, encoding="utf-8")
        command = [program, "-l", *(f"{folder}/material.{kind}" for kind in kinds)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode:
            said = " ".join(line for line in ended.stdout.splitlines() if "ERROR" in line).replace(f"{folder}/", "")
            raise OutputError(
                f"{program} refuses the shaders ({said or 'no reason'}); leave that out with --no-verify."
            )
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.search(r"Version: *([\w.:]+)", version)
    return f"glslang {found[1] if found else ''}".rstrip()
