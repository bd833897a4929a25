"""Shaders: a translated material as files, the function to paste and a vertex and a fragment shader that light with it.

It translates nothing and runs nothing.
"""

from collections.abc import Sequence

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


def texts(name: str, header: Sequence[str], brdf: str) -> dict[str, str]:
    """File names → texts.

    Args:
        name: Of the files, without their ending.
        header: Lines that each begins with as comments; in shaders after the version, which must come first.
        brdf: By `translation.translated`.
    """
    comment = "".join(f"// {line}\n" for line in header)
    version, rest = BEFORE.split("\n", 1)
    _, vertex = VERTEX.split("\n", 1)
    return {
        f"{name}.glsl": comment + "\n" + brdf,
        f"{name}.vert": f"{version}\n{comment}{vertex}",
        f"{name}.frag": f"{version}\n{comment}{rest}{brdf}{AFTER}",
    }
