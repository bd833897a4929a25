// Runs the `brdf` of exported materials in WebGL 2; it knows no page and draws nothing on one.
"use strict";

const HEADER = "#version 300 es\nprecision highp float;\nprecision highp int;\n";

// One triangle that covers every pixel.
const EVERYWHERE = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;

// After a material: its value for the pair of directions that each pixel has.
const VALUES = `
uniform highp sampler2D lights;
uniform highp sampler2D eyes;
out vec4 pixel;
void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    pixel = vec4(brdf(texelFetch(lights, place, 0).xyz, texelFetch(eyes, place, 0).xyz), 1.0);
}`;

class Gpu {
    // Throws where there is no WebGL 2 with floating-point pixels; `slow` where it runs on the processor.
    constructor(canvas) {
        const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true });
        if (gl === null) throw new Error("no WebGL 2");
        this.single = gl.getExtension("EXT_color_buffer_float") !== null;
        if (!this.single && gl.getExtension("EXT_color_buffer_half_float") === null) throw new Error("no WebGL 2 with floats");
        const told = gl.getExtension("WEBGL_debug_renderer_info");
        this.slow = told !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(told.UNMASKED_RENDERER_WEBGL));
        this.gl = gl;
        this.canvas = canvas;
    }

    // A fragment shader, after HEADER; its uniforms are set by name in `draw`.
    program(source) {
        const { gl } = this, program = gl.createProgram();
        for (const [kind, text] of [[gl.VERTEX_SHADER, EVERYWHERE], [gl.FRAGMENT_SHADER, HEADER + source]]) {
            const shader = gl.createShader(kind);
            gl.shaderSource(shader, text);
            gl.compileShader(shader);
            if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
            gl.attachShader(program, shader);
            gl.deleteShader(shader);
        }
        gl.linkProgram(program);
        if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
        const uniforms = new Map();
        for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++k) {
            const { name, type } = gl.getActiveUniform(program, k);
            uniforms.set(name.replace("[0]", ""), { type, place: gl.getUniformLocation(program, name) });
        }
        return { program, uniforms };
    }

    // Four numbers a pixel; of single precision where they are given or the machine draws such.
    texture(width, height, numbers = null) {
        const { gl } = this, texture = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, texture);
        const kind = numbers !== null || this.single ? gl.RGBA32F : gl.RGBA16F;
        gl.texImage2D(gl.TEXTURE_2D, 0, kind, width, height, 0, gl.RGBA, gl.FLOAT, numbers);
        for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
        return texture;
    }

    // What can be drawn into and read.
    target(width, height) {
        const { gl } = this, texture = this.texture(width, height), buffer = gl.createFramebuffer();
        gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        return { texture, buffer, width, height };
    }

    remove(target) {
        this.gl.deleteFramebuffer(target.buffer);
        this.gl.deleteTexture(target.texture);
    }

    // Into a target, or onto the canvas; values by the names of uniforms, textures for samplers.
    draw({ program, uniforms }, values, target = null) {
        const { gl } = this, { width, height } = target ?? this.canvas;
        gl.bindFramebuffer(gl.FRAMEBUFFER, target === null ? null : target.buffer);
        gl.viewport(0, 0, width, height);
        gl.useProgram(program);
        let unit = 0;
        for (const [name, { type, place }] of uniforms) {
            const value = values[name];
            if (value === undefined) throw new Error(`the shader's ${name} has no value`);
            if (type === gl.SAMPLER_2D) {
                gl.activeTexture(gl.TEXTURE0 + unit);
                gl.bindTexture(gl.TEXTURE_2D, value);
                gl.uniform1i(place, unit++);
            } else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, value);
            else if (type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(place, false, value);
            else if (type === gl.INT) gl.uniform1i(place, value);
            else gl.uniform1fv(place, [value].flat());
        }
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    // Four numbers a pixel, rows from below.
    pixels(target) {
        const { gl } = this, found = new Float32Array(4 * target.width * target.height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target.buffer);
        gl.readPixels(0, 0, target.width, target.height, gl.RGBA, gl.FLOAT, found);
        const error = gl.getError();
        if (error !== gl.NO_ERROR) throw new Error(`WebGL error ${error}`);
        return found;
    }

    // A material's values, four numbers a pair: directions as four numbers each, the fourth of no meaning.
    values(program, uniforms, wi, wo, width, height) {
        const lights = this.texture(width, height, wi), eyes = this.texture(width, height, wo);
        const target = this.target(width, height);
        try {
            this.draw(program, { ...uniforms, lights, eyes }, target);
            return this.pixels(target);
        } finally {
            this.remove(target);
            for (const texture of [lights, eyes]) this.gl.deleteTexture(texture);
        }
    }
}
