// The ball as shaders: what a viewer far away sees of it, and how that is displayed. Drawn with a material's own `brdf`.
"use strict";

// Half of the picture's width; the ball's radius is 1.
const EXTENT = 1.04;

// After a material. The viewer looks along -z; `turn` takes the world, where object, sky and windows rest, to the viewer.
// No shadow, nothing is reflected twice. The tangent of brushed materials runs around the object's y axis.
const BALL = `
uniform mat3 turn;
uniform vec3 light;        // to the light, in the viewer's axes
uniform float irradiance;  // of a surface that faces the light
uniform float sky;         // factor of the environment; 0 for none
uniform int rounds;        // of four directions of the environment each
uniform float size;        // pixels across
uniform float dents;       // depth in radii
uniform float bumps;       // slope of the fine waves
uniform float ground;
uniform vec3 windows[2];   // to their centres, world
uniform float sharpness[2];
uniform float brightness[2];
out vec4 pixel;

// An oblique frame, so that no dent faces the viewer.
const mat3 oblique = mat3(0.8138, 0.5438, -0.2049, -0.4698, 0.8232, 0.3188, 0.3420, -0.1632, 0.9254);

// Of the dented surface, the gradient and how far a point is beyond it: 26 Gaussian dents, evenly over the sphere.
vec4 dented(vec3 world) {
    const vec3 centres[7] = vec3[7](vec3(1, 0, 0), vec3(0, 1, 0), vec3(0, 0, 1), vec3(0, 0.70711, 0.70711),
        vec3(0.70711, 0, 0.70711), vec3(0.70711, 0.70711, 0), vec3(0.57735));
    vec3 x = world * oblique, w = normalize(x), gradient = vec3(0.0);
    float radius = 1.0;
    for (int k = 0; k < 7; ++k) {
        float depth = dents * exp(40.0 * (dot(abs(w), centres[k]) - 1.0));
        radius -= depth;
        gradient -= 40.0 * depth * sign(w) * centres[k];
    }
    return vec4(oblique * (w - (gradient - w * dot(w, gradient)) / length(x)), length(x) - radius);
}

// Where a ray along -z meets the surface, in the world's axes, and its normal there; false where it does not.
bool met(vec2 place, out vec3 x, out vec3 n) {
    float square = 1.0 - dot(place, place);
    if (square <= 0.0) return false;
    float z = sqrt(square);
    x = vec3(place, z) * turn;
    n = x;
    if (dents == 0.0) return true;
    for (int k = 0; k < 80; ++k) {
        vec4 found = dented(x);
        if (found.w < 1e-3) {
            n = normalize(found.xyz);
            return true;
        }
        z -= max(0.8 * found.w, 2e-3);
        if (z < -1.0) return false;
        x = vec3(place, z) * turn;
    }
    return false;
}

// Gradient of a height that is given in all of space: eight waves in directions of a spiral.
vec3 waves(vec3 x) {
    vec3 gradient = vec3(0.0);
    for (int k = 0; k < 8; ++k) {
        float up = (float(k) + 0.5) / 4.0 - 1.0, around = 2.39996 * float(k);
        vec3 along = vec3(sqrt(1.0 - up * up) * vec2(cos(around), sin(around)), up);
        gradient += along * cos((18.0 + 5.0 * float(k)) * dot(along, x) + 1.7 * float(k));
    }
    return gradient;
}

// Overcast sky (1 + 2 sin)/3 over ground, and soft windows (world).
float environment(vec3 w) {
    float found = w.y > 0.0 ? (1.0 + 2.0 * w.y) / 3.0 : ground;
    for (int k = 0; k < 2; ++k) found += brightness[k] * exp(sharpness[k] * (dot(w, windows[k]) - 1.0));
    return found;
}

vec3 around(vec3 axis, float cosine, float turned) {
    vec3 t = normalize(cross(abs(axis.y) < 0.9 ? vec3(0, 1, 0) : vec3(1, 0, 0), axis));
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return sine * (cos(turned) * t + sin(turned) * cross(axis, t)) + cosine * axis;
}

// Per steradian, how densely each of four ways chooses a direction, times its share of all: by the cosine, a quarter;
// by the slope of the half vector, evenly in its logarithm from 3e-4 to 3, which suits a lobe of any width, a half; and
// about each window, an eighth.
vec4 densities(vec3 w, vec3 wi, vec3 wo) {
    vec3 h = normalize(wi + wo);
    float slope2 = dot(h.xy, h.xy) / (h.z * h.z);
    vec4 found = vec4(0.25 * max(wi.z, 0.0), 0.0, 0.0, 0.0);
    if (slope2 > 8.9e-8 && slope2 < 9.0) {
        found.y = 0.5 * pow(1.0 + slope2, 1.5) / (2.0 * 9.21034 * slope2) / (4.0 * max(dot(wo, h), 1e-6));
    }
    for (int k = 0; k < 2; ++k) {
        found[2 + k] = 0.125 * 0.5 * sharpness[k] * exp(sharpness[k] * (dot(w, windows[k]) - 1.0));
    }
    return found / 3.14159265;
}

// The environment's light that leaves towards wo, from evenly spread directions, the same for every pixel; what several
// ways could have chosen is shared among them by the squares of their densities (Veach 1997, sec. 9.2).
vec3 surrounded(mat3 surface, vec3 wo) {
    vec3 total = vec3(0.0);
    for (int k = 0; k < 4 * rounds; ++k) {
        int turn = k % 4, way = turn == 0 ? 0 : turn < 3 ? 1 : 2 + (k / 4) % 2;
        vec2 u = fract(0.5 + vec2(0.7548776662, 0.5698402910) * float(way == 1 ? k / 2 + 1 : k / 4 + 1));
        float turned = 6.28318531 * u.y;
        vec3 wi;
        if (way == 0) wi = around(vec3(0, 0, 1), sqrt(u.x), turned);
        if (way == 1) {
            vec3 h = normalize(vec3(3e-4 * exp(9.21034 * u.x) * vec2(cos(turned), sin(turned)), 1.0));
            wi = 2.0 * dot(wo, h) * h - wo;
        }
        if (way > 1) {
            float k = sharpness[way - 2];
            wi = surface * around(windows[way - 2], 1.0 + log(mix(exp(-2.0 * k), 1.0, u.x)) / k, turned);
        }
        if (wi.z <= 0.0) continue;
        vec3 w = wi * surface;
        vec4 each = densities(w, wi, wo);
        total += brdf(wi, wo) * environment(w) * wi.z * each[way] / dot(each, each);
    }
    return total / float(4 * rounds);
}

void main() {
    vec3 x, n;
    pixel = vec4(0.0);
    if (!met((2.0 * gl_FragCoord.xy / size - 1.0) * ${EXTENT}, x, n)) return;
    vec3 gradient = bumps * waves(x);
    n = normalize(n - (gradient - n * dot(n, gradient)));  // the surface gradient (Mikkelsen 2020)
    vec3 across = cross(vec3(0, 1, 0), n);
    vec3 t = normalize(dot(across, across) > 1e-12 ? across : cross(vec3(1, 0, 0), n));
    mat3 surface = transpose(mat3(t, cross(n, t), n));  // the world to the frame of the surface
    vec3 wi = surface * (light * turn), wo = surface * (vec3(0, 0, 1) * turn);
    pixel.a = 1.0;
    if (irradiance > 0.0) pixel.rgb = brdf(wi, wo) * irradiance * max(wi.z, 0.0);
    if (sky > 0.0 && wo.z > 0.0) pixel.rgb += sky * surrounded(surface, wo);
}`;

// Radiances of two materials on a display: one beside the other, or how far apart they are.
const DISPLAY = `
uniform highp sampler2D one;
uniform highp sampler2D other;
uniform mat3 colours;     // of the channels, as linear sRGB
uniform float exposure;
uniform float soft;       // 1: L/(1 + L) instead of a cut at white
uniform float wipe;       // share of the picture, from the left, that is the first material's
uniform float amplified;  // the difference by this; 0 for no difference
uniform int fine;         // points of the pictures for each pixel, in each direction
uniform float size;       // pixels across
out vec4 pixel;

vec3 exposed(vec3 radiance) {
    vec3 linear = max(exposure * (colours * radiance), 0.0);
    return mix(min(linear, 1.0), linear / (1.0 + linear), soft);
}

vec3 encoded(vec3 linear) {
    return mix(12.92 * linear, 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, linear));
}

void main() {
    pixel = vec4(0.0);
    for (int k = 0; k < fine * fine; ++k) {
        ivec2 place = ivec2(gl_FragCoord.xy) * fine + ivec2(k % fine, k / fine);
        vec4 first = texelFetch(one, place, 0), second = texelFetch(other, place, 0);
        if (first.a == 0.0) continue;
        vec3 linear = exposed(gl_FragCoord.x < wipe * size ? first.rgb : second.rgb);
        if (amplified > 0.0) {
            float apart = amplified * dot(vec3(0.2126, 0.7152, 0.0722), exposed(first.rgb) - exposed(second.rgb));
            vec3 hue = apart > 0.0 ? vec3(1.0, 0.35, 0.0) : vec3(0.1, 0.5, 1.0);
            linear = mix(vec3(0.03), hue, min(abs(apart), 1.0));
        }
        pixel += vec4(encoded(linear), 1.0);
    }
    pixel /= float(fine * fine);
    if (amplified == 0.0 && wipe > 0.0 && wipe < 1.0 && abs(gl_FragCoord.x - wipe * size) < 0.75) pixel = vec4(1.0);
}`;
