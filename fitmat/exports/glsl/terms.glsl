// Terms that several lobes share; a shader gets those that it needs. Each stands alone between two empty lines.

const float PI = 3.14159265358979;

// Two directions, their half vector h, and cos_d = wi . h.
struct Pair { vec3 wi; vec3 wo; vec3 h; float cos_d; };

// h from the sum of both, so that sin(theta_h) = |n x h| = |h.xy| is exact where it is small, and cos_d = |wi + wo|/2.
Pair pair(vec3 wi, vec3 wo) {
    vec3 sum = wi + wo;
    float size = length(sum);
    return Pair(wi, wo, size > 1e-12 ? sum / size : vec3(0.0, 0.0, 1.0), 0.5 * size);
}

// All directions turned about the normal by an angle, counter-clockwise seen from above.
Pair turned(Pair p, float angle) {
    mat3 r = mat3(cos(angle), sin(angle), 0.0, -sin(angle), cos(angle), 0.0, 0.0, 0.0, 1.0);
    return Pair(r * p.wi, r * p.wo, r * p.h, p.cos_d);
}

// A cosine by which a formula may divide.
float cosine(vec3 w) {
    return max(w.z, 1e-7);
}

float larger_cosine(vec3 wi, vec3 wo) {
    return max(cosine(wi), cosine(wo));
}

float sine(vec3 w) {
    return length(w.xy);
}

float zenith(vec3 w) {
    return atan(sine(w), w.z);
}

float pow5(float x) {
    return x * x * x * x * x;
}

// ln(1 - x) for x in [0, 1), also where x is small.
float log_one_minus(float x) {
    float t = x / (2.0 - x);
    return x < 0.1 ? -2.0 * t * (1.0 + t * t / 3.0 + t * t * t * t / 5.0) : log(1.0 - x);
}

// (1 - x)^n: a cosine to a power, from x = 1 - cos, which is small where the power is large.
float power(float x, float n) {
    return x < 1.0 ? exp(n * log_one_minus(x)) : 0.0;
}

// c_h^n.
float half_power(vec3 h, float n) {
    return power(dot(h.xy, h.xy) / (1.0 + max(h.z, 0.0)), n);
}

// Sum of k_j T_j(x), Chebyshev's polynomials, by Clenshaw.
float chebyshev(float k[24], float x) {
    float one = 0.0, two = 0.0;
    for (int j = 23; j > 0; --j) {
        float next = k[j] + 2.0 * x * one - two;
        two = one;
        one = next;
    }
    return k[0] + x * one - two;
}

// The same of ten spectra, in 2 sqrt(c) - 1.
vec3 coat_series(vec3 k[10], float c) {
    float x = 2.0 * sqrt(max(c, 1e-8)) - 1.0;
    vec3 one = vec3(0.0), two = vec3(0.0);
    for (int j = 9; j > 0; --j) {
        vec3 next = k[j] + 2.0 * x * one - two;
        two = one;
        one = next;
    }
    return k[0] + x * one - two;
}

// Spectra with slopes at ascending roots of c: cubic between, straight beyond.
vec3 coat_curve(float roots[19], vec3 values[19], vec3 slopes[19], float c) {
    float x = sqrt(max(c, 1e-8));
    int k = 0;
    for (int j = 1; j < 18; ++j) {
        k = x > roots[j] ? j : k;
    }
    float step = roots[k + 1] - roots[k], t = (x - roots[k]) / step;
    float u = clamp(t, 0.0, 1.0), rise = u * u * (3.0 - 2.0 * u);
    vec3 first = (u * (1.0 - u) * (1.0 - u) + min(t, 0.0)) * slopes[k];
    vec3 last = (u * u * (u - 1.0) + max(t - 1.0, 0.0)) * slopes[k + 1];
    return mix(values[k], values[k + 1], rise) + step * (first + last);
}

// Fresnel reflectance of a dielectric, unpolarised (Cook & Torrance 1982, eq. 15); 1 beyond total reflection.
vec3 dielectric(float c, vec3 eta) {
    vec3 square = (eta - 1.0) * (eta + 1.0) + c * c;
    vec3 g = sqrt(max(square, 0.0));
    vec3 first = (eta - 1.0) * (eta + 1.0) / ((g + c) * (g + c));  // (g - c)/(g + c)
    vec3 second = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return mix(0.5 * first * first * (1.0 + second * second), vec3(1.0), lessThanEqual(square, vec3(0.0)));
}

// Fresnel reflectance of a conductor eta + i kappa, unpolarised (Born & Wolf, sec. 14.2).
vec3 conductor(float c, vec3 eta, vec3 kappa) {
    float cos2 = c * c, sin2 = 1.0 - c * c;
    vec3 t0 = (eta - kappa) * (eta + kappa) - sin2, product = 2.0 * eta * kappa;
    vec3 a2_b2 = sqrt(t0 * t0 + product * product);
    vec3 larger = 0.5 * (a2_b2 + abs(t0));
    vec3 a = sqrt(mix(larger, 0.25 * product * product / larger, lessThan(t0, vec3(0.0))));
    vec3 rs = (a2_b2 + cos2 - 2.0 * a * c) / (a2_b2 + cos2 + 2.0 * a * c);
    vec3 t3 = cos2 * a2_b2 + sin2 * sin2, t4 = 2.0 * a * c * sin2;
    return 0.5 * rs * (1.0 + (t3 - t4) / (t3 + t4));
}

// F0 + (1 - F0)(1 - c)^5 (Schlick 1994).
float schlick(float c, float f0) {
    return f0 + (1.0 - f0) * pow5(1.0 - c);
}
vec3 schlick(float c, vec3 f0) {
    return f0 + (1.0 - f0) * pow5(1.0 - c);
}

// Schlick - a c (1 - c)^6, which passes through F82 at c = 1/7 (Hoffman 2019).
vec3 hoffman(float c, vec3 f0, vec3 f82) {
    vec3 a = (schlick(1.0 / 7.0, f0) - f82) * 7.0 / (pow5(6.0 / 7.0) * 6.0 / 7.0);
    return clamp(schlick(c, f0) - a * c * pow5(1.0 - c) * (1.0 - c), 0.0, 1.0);
}

// (a_x w_x)^2 + (a_y w_y)^2, above 0.
float spread2(vec3 w, vec2 slopes) {
    vec2 s = slopes * w.xy;
    return max(dot(s, s), 1e-16 * slopes.x * slopes.y);
}

// Trowbridge-Reitz, "GGX": 1/(pi a_x a_y (h_x^2/a_x^2 + h_y^2/a_y^2 + h_z^2)^2).
float D_ggx(vec3 h, vec2 slopes) {
    float ratio = slopes.y / slopes.x, product = slopes.x * slopes.y;
    float stretched = h.x * h.x * ratio + h.y * h.y / ratio + product * h.z * h.z;
    return product / (PI * stretched * stretched);
}

// c (1 + Lambda) of GGX: (c + sqrt(c^2 + a_x^2 w_x^2 + a_y^2 w_y^2))/2 (Walter 2007, eq. 34).
float masked_ggx(vec3 w, vec2 slopes) {
    float c = cosine(w);
    return 0.5 * (c + sqrt(c * c + spread2(w, slopes)));
}

// exp(-(h_x^2/a_x^2 + h_y^2/a_y^2)/h_z^2)/(pi a_x a_y h_z^4).
float D_beckmann(vec3 h, vec2 slopes) {
    float cos2 = cosine(h) * cosine(h);
    vec2 s = h.xy / slopes;
    return exp(-dot(s, s) / cos2) / (PI * slopes.x * slopes.y * cos2 * cos2);
}

// Error function for a >= 0, to 1.5e-7 (Abramowitz & Stegun 7.1.26).
float erf(float a) {
    float t = 1.0 / (1.0 + 0.3275911 * a);
    float p = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
    return 1.0 - p * exp(-a * a);
}

// c (1 + Lambda) of Beckmann: c (1 + erf a)/2 + s exp(-a^2)/(2 sqrt(pi)), a = c/s.
float masked_beckmann(vec3 w, vec2 slopes) {
    float c = cosine(w), s = sqrt(spread2(w, slopes)), a = c / s;
    return 0.5 * c * (1.0 + erf(a)) + s * exp(-a * a) / (2.0 * sqrt(PI));
}

// The same as Walter's rational function (2007, p. 6).
float masked_beckmann_rational(vec3 w, vec2 slopes) {
    float c = cosine(w), s = sqrt(spread2(w, slopes)), a = c / s;
    return a < 1.6 ? s * (1.0 + a * (2.276 + 2.577 * a)) / (3.535 + 2.181 * a) : c;
}

// (a^2 - 1)/(pi ln a^2 (1 + (a^2 - 1) c_h^2)): GTR1 (Burley 2012).
float D_gtr1(vec3 h, float alpha) {
    float a2 = alpha * alpha;
    return (a2 - 1.0) / (PI * log(a2) * (dot(h.xy, h.xy) + a2 * h.z * h.z));
}

// A colour over its luminance; 1 where it is black (disney.brdf).
vec3 hue(vec3 base) {
    float luminance = dot(vec3(0.3, 0.6, 0.1), base);
    return luminance > 1e-30 ? base / luminance : vec3(1.0);
}
