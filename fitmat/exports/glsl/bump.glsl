uniform float bump;  // slope of each of the waves below; 0 is smooth

// Gradient of a height that is given in all of space, at a point of the object, in its frame: eight waves in directions
// of a spiral. For another height put its gradient here.
vec3 height_gradient(vec3 x) {
    vec3 gradient = vec3(0.0);
    for (int k = 0; k < 8; ++k) {
        float up = (float(k) + 0.5) / 4.0 - 1.0, around = 2.39996 * float(k);
        vec3 along = vec3(sqrt(1.0 - up * up) * vec2(cos(around), sin(around)), up);
        gradient += along * cos((18.0 + 5.0 * float(k)) * dot(along, x) + 1.7 * float(k));
    }
    return bump * gradient;
}

// The normal of the surface with that height on it. The part of the gradient along the surface is the surface gradient,
// and n minus it is the normal (Mikkelsen, Surface Gradient-Based Bump Mapping Framework, JCGT 9(3), 2020).
vec3 bumped(vec3 n) {
    mat4 to_object = inverse(mvMatrix);
    vec3 gradient = height_gradient((to_object * vec4(interpolated_position, 1.0)).xyz);
    gradient = transpose(mat3(to_object)) * gradient;  // in the frame of the eye
    return normalize(n - (gradient - n * dot(n, gradient)));
}
