// Lobes of two materials: in the plane of incidence, in space, and as slices over theta_h and theta_d; with what was
// measured.
// Every value is that of the ball's shaders, with the parameters that its sliders have now.
"use strict";

const CELLS = 90; // of a slice along each side
const NEAR = 2; // degrees within which the slider goes to a measured incidence
const SCALES = {
    root: ["cube root", (x) => Math.cbrt(x)],
    linear: ["linear", (x) => x],
    log: ["logarithm, three decades", (x) => Math.max(1 + Math.log10(Math.max(x, 1e-9)) / 3, 0)],
};
const LEVELS = [[0, 34, 78], [67, 78, 108], [125, 124, 120], [188, 174, 108], [254, 232, 56]]; // cividis
const APART = [[0, 90, 181], [134, 178, 217], [238, 238, 238], [232, 160, 110], [200, 80, 0]];

function coloured(map, share) {
    const place = Math.min(Math.max(share, 0), 1) * (map.length - 1), k = Math.min(Math.floor(place), map.length - 2);
    return map[k].map((from, c) => Math.round(from + (place - k) * (map[k + 1][c] - from)));
}

function svg(tag, attributes = {}, ...children) {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
}

// Both directions from angles in degrees; theta_o is signed, positive on the mirror side.
function inPlane(thetaI, thetaO, phiI) {
    const at = (theta, phi) => [sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta), 0];
    return [at(thetaI, phiI), at(thetaO, phiI + 180)];
}

// Both directions from the half vector's angle, and the light's angles about it.
function aboutHalf(thetaH, thetaD, phiD) {
    const [x, y, z] = [sin(thetaD) * cos(phiD), sin(thetaD) * sin(phiD), cos(thetaD)];
    const turn = ([a, b, c]) => [a * cos(thetaH) + c * sin(thetaH), b, c * cos(thetaH) - a * sin(thetaH), 0];
    return [turn([x, y, z]), turn([-x, -y, z])];
}

class Lobes {
    // Curves are measured sections: theta_i, phi_i, theta_o in degrees, and values of each channel; maps: see Solids.
    constructor(root, ball, curves, channels, maps) {
        Object.assign(this, { root, ball, curves, channels, channel: 0, scale: "root", phiD: curves.length > 0 ? 0 : 90 });
        this.programs = ball.data.models.map(({ source }) => ball.gpu.program(source + VALUES));
        this.colour = ball.data.channels.map((name) => channels.indexOf(name));
        this.thetaI = this.measured.length > 0 ? this.measured[Math.floor(this.measured.length / 2)] : 45;
        this.solids = new Solids(this, maps);
        this.build();
        this.draw();
        ball.drawnWith.push(() => this.draw());
    }

    // The measured incidences, rising.
    get measured() {
        return [...new Set(this.curves.map((curve) => curve.theta_i))].sort((a, b) => a - b);
    }

    // Values in sr^-1 of each material in the chosen channel, at pairs of directions that fill a texture.
    values(pairs, width, height) {
        const lights = new Float32Array(pairs.flatMap(([wi]) => wi)), eyes = new Float32Array(pairs.flatMap(([, wo]) => wo));
        return this.programs.map((program, k) => {
            const found = this.ball.gpu.values(program, this.ball.uniforms(k), lights, eyes, width, height);
            return pairs.map((_, j) => found[4 * j + this.channel]);
        });
    }

    // The section at the slider's incidence, if one was measured there, without what is masked.
    section() {
        const at = this.curves.find((curve) => Math.abs(curve.theta_i - this.thetaI) < 0.01);
        const column = this.colour[this.channel] ?? -1;
        const points = at === undefined || column < 0 ? [] : at.theta_o.map((theta, j) => [theta, at.measured[column][j]]);
        return { phiI: at?.phi_i ?? 0, points: points.filter(([, value]) => value !== null) };
    }

    build() {
        const { measured } = this, names = this.ball.data.models.map(({ role }) => role);
        const words = (x) => `${Math.round(10 * x) / 10}°`;
        this.incidence = slider(["Incidence ", ...written("θ_i")], { low: 0, high: 85, value: this.thetaI, words, changed: (x) => this.incident(x) });
        const scales = Object.fromEntries(Object.entries(SCALES).map(([key, [name]]) => [key, name]));
        const scale = choice("Radius", scales, (value) => this.put("scale", value));
        const plane = choice("Slice", { 0: "in the plane of incidence", 90: "across it, as BRDF Explorer" }, (value) => this.put("phiD", Number(value)));
        plane.select.value = this.phiD;
        const rows = [this.incidence, scale, plane, ...this.solids.sliders];
        if (this.ball.data.channels.length > 1) {
            const named = Object.fromEntries(this.ball.data.channels.map((name, k) => [k, name]));
            rows.push(choice("Channel", named, (value) => this.put("channel", Number(value))));
        }
        const known = measured.length > 0 ? `Measured at ${measured.map(digits).join("°, ")}°.` : "Nothing was measured in the plane of incidence.";
        this.polar = svg("svg", { viewBox: "-110 -104 220 108", role: "img" });
        this.outer = made("span");
        const keys = names.map((name, k) => made("span", { class: `kind ${k ? "other" : "one"}` }, name));
        if (measured.length > 0) keys.push(made("span", { class: "kind points" }, "measured"));
        const lobe = made("figure", {}, this.polar, made("figcaption", {}, this.outer, made("br"), ...keys));
        this.slices = [...names, ...(names.length > 1 ? [`${names[0]} over ${names[1]}`] : [])].map((name) => this.slice(name));
        this.read = made("p", { class: "said", "aria-live": "polite" });
        this.root.replaceChildren(
            made("div", { class: "panels" }, lobe, made("fieldset", {}, made("legend", {}, "Lobes"), ...rows.map(({ row }) => row), made("small", {}, known))),
            made("div", { class: "solids" }, ...this.solids.figures),
            made("div", { class: "slices" }, ...this.slices.map(({ figure }) => figure)),
            this.read,
        );
    }

    slice(name) {
        const canvas = made("canvas", { width: CELLS, height: CELLS, role: "img" }), dots = svg("svg", { viewBox: "0 0 90 90", "aria-hidden": "true" });
        canvas.addEventListener("pointermove", (event) => this.tell(canvas, event));
        const said = made("small"), axes = [["down", "θ_d"], ["along", "θ_h"]].map(([side, symbol]) => made("span", { class: side }, ...written(symbol)));
        const figure = made("figure", {}, made("div", { class: "slice" }, canvas, dots, ...axes), made("figcaption", {}, made("b", {}, name), " ", said));
        return { name, figure, canvas, dots, said };
    }

    incident(x) {
        const near = this.measured.find((theta) => Math.abs(theta - x) < NEAR);
        this.thetaI = near ?? x;
        this.incidence.set(this.thetaI);
        this.lobe();
        this.solids.draw();
    }

    put(name, value) {
        this[name] = value;
        this.draw();
    }

    draw() {
        this.lobe();
        this.solids.draw();
        this.images();
    }

    // The lobes as seen from the side: the light comes from the left.
    lobe() {
        const { phiI, points } = this.section(), angles = [];
        for (let k = -178; k <= 178; ++k) angles.push(k / 2);
        for (let k = -60; k <= 60; ++k) angles.push(Math.min(this.thetaI + k / 20, 89.5));
        angles.sort((a, b) => a - b);
        const values = this.values(angles.map((theta) => inPlane(this.thetaI, theta, phiI)), angles.length, 1);
        const most = Math.max(...values.flat(), ...points.map(([, value]) => value), 1e-9), [name, scaled] = SCALES[this.scale];
        const at = (theta, value) => {
            const radius = 100 * scaled(Math.max(value, 0) / most);
            return `${(radius * sin(theta)).toFixed(2)},${(-radius * cos(theta)).toFixed(2)}`;
        };
        const ring = (radius) => svg("path", { class: "grid", d: `M${-radius},0 A${radius},${radius} 0 0 1 ${radius},0` });
        const rays = [-90, -60, -30, 0, 30, 60, 90].map((theta) => svg("path", { class: "grid", d: `M0,0 L${100 * sin(theta)},${-100 * cos(theta)}` }));
        const light = svg("path", { class: "light", d: `M${-100 * sin(this.thetaI)},${-100 * cos(this.thetaI)} L0,0` });
        const lines = values.map((row, k) => svg("polyline", { class: k ? "other" : "one", points: row.map((value, j) => at(angles[j], value)).join(" ") }));
        const dots = points.map(([theta, value]) => {
            const [cx, cy] = at(theta, value).split(",");
            return svg("circle", { class: "points", cx, cy, r: 1.1 });
        });
        this.outer.textContent = `outer circle: ${digits(most)} sr⁻¹, radius: ${name}`;
        this.polar.replaceChildren(...[1, 2, 3, 4].map((k) => ring(25 * k)), ...rays, light, ...lines, ...dots);
        const roles = this.ball.data.models.map(({ role }, k) => `${role} up to ${digits(Math.max(...values[k]))}`).join(", ");
        this.polar.setAttribute("aria-label", `BRDF in the plane of incidence, light from ${digits(this.thetaI)}°: ${roles} per steradian; ${points.length} measured points.`);
    }

    // The images: theta_h to the right, theta_d upwards; logarithms, on one scale for all materials.
    images() {
        const pairs = [];
        for (let row = 0; row < CELLS; ++row) for (let k = 0; k < CELLS; ++k) pairs.push(aboutHalf(k + 0.5, CELLS - row - 0.5, this.phiD));
        const lit = pairs.map(([wi, wo]) => wi[2] > 0.01 && wo[2] > 0.01);
        this.shown = this.values(pairs, CELLS, CELLS);
        const logs = this.shown.map((values) => values.map((value) => Math.log10(Math.max(value, 1e-12))));
        const inside = logs.flatMap((row) => row.filter((_, j) => lit[j])).sort((a, b) => a - b);
        const [least, most] = [0.005, 0.995].map((share) => inside[Math.floor(share * inside.length)]);
        logs.forEach((row, k) => {
            this.paint(this.slices[k], lit, (j) => coloured(LEVELS, (row[j] - least) / (most - least || 1)));
            this.slices[k].said.textContent = `${digits(10 ** least)} to ${digits(10 ** most)} sr⁻¹, dark to bright`;
            this.residuals(this.slices[k], k);
        });
        if (logs.length < 2) return;
        const ratio = this.slices[logs.length];
        this.paint(ratio, lit, (j) => coloured(APART, 0.5 + (logs[0][j] - logs[1][j]) / (2 * Math.log10(4))));
        ratio.said.textContent = "¼ (blue) to 4 (orange)";
    }

    paint({ canvas, name }, lit, colour) {
        const image = new ImageData(CELLS, CELLS);
        lit.forEach((seen, j) => image.data.set(seen ? [...colour(j), 255] : [0, 0, 0, 0], 4 * j));
        canvas.getContext("2d").putImageData(image, 0, 0);
        canvas.setAttribute("aria-label", `${name}: slice over the half vector's angle and the difference angle`);
    }

    // Measured points of the plane on a material's slice: their colour is measured over fitted.
    residuals({ dots, said }, k) {
        const column = this.colour[this.channel] ?? -1, points = [];
        for (const { theta_i: thetaI, phi_i: phiI, theta_o: thetaO, measured } of column < 0 || this.phiD !== 0 ? [] : this.curves) {
            thetaO.forEach((theta, j) => measured[column][j] > 0 && points.push([thetaI, theta, phiI, measured[column][j]]));
        }
        if (points.length === 0) return dots.replaceChildren();
        const fitted = this.values(points.map(([thetaI, theta, phiI]) => inPlane(thetaI, theta, phiI)), points.length, 1)[k];
        dots.replaceChildren(...points.map(([thetaI, theta, , value], j) => {
            const fill = `rgb(${coloured(APART, 0.5 + Math.log10(value / Math.max(fitted[j], 1e-12)) / (2 * Math.log10(4)))})`;
            return svg("circle", { cx: Math.abs(theta - thetaI) / 2, cy: 90 - Math.abs(thetaI + theta) / 2, r: 0.8, fill });
        }));
        said.textContent += "; points: measured over fitted, ¼ to 4";
    }

    tell(canvas, event) {
        const box = canvas.getBoundingClientRect(), place = (x, size) => Math.min(Math.max(Math.floor((CELLS * x) / size), 0), CELLS - 1);
        const k = place(event.clientX - box.left, box.width), row = place(event.clientY - box.top, box.height);
        const told = this.ball.data.models.map(({ role }, m) => `${role} ${digits(this.shown[m][row * CELLS + k])}`).join(", ");
        this.read.textContent = `θ_h ${k + 0.5}°, θ_d ${CELLS - row - 0.5}°: ${told} sr⁻¹`;
    }
}
