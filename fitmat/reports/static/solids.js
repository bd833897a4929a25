// Lobes in space: how far out a lobe reaches towards each direction, drawn from afar, with what was measured there.
// It evaluates nothing itself: values are those of the lobes' shaders.
"use strict";

const AWAY = 56, ROUND = 72; // directions from the mirror direction outwards, and around it
const HORIZON = 2e-3; // height of the lowest direction of which a value is asked

// Directions about the mirror direction, close to each other near it, x on the mirror side; what would lie below the
// horizon stands on it, and is marked.
function aroundMirror(thetaI) {
    const found = [], mirror = [sin(thetaI), 0, cos(thetaI)], across = [cos(thetaI), 0, -sin(thetaI)];
    for (let k = 0; k <= AWAY; ++k) {
        const away = 180 * (k / AWAY) ** 2.2;
        for (let j = 0; j <= ROUND; ++j) {
            const turn = (360 * j) / ROUND, [a, b, c] = [cos(away), sin(away) * cos(turn), sin(away) * sin(turn)];
            const [x, y, z] = [a * mirror[0] + b * across[0], c, a * mirror[2] + b * across[2]];
            const long = Math.hypot(x, y) || 1, flat = Math.sqrt(1 - HORIZON ** 2) / long;
            found.push(z > HORIZON ? { at: [x, y, z], below: false } : { at: [x * flat, y * flat, HORIZON], below: true });
        }
    }
    return found;
}

class Solids {
    // Maps: of each incidence theta_i the points theta_o, phi in degrees, and values of each channel.
    constructor(lobes, maps) {
        Object.assign(this, { lobes, maps, view: [-30, 22] });
        const names = lobes.ball.data.models.map(({ role }) => role);
        this.canvases = names.map((name) => made("canvas", { role: "img", "aria-label": `Lobe of ${name} in space` }));
        const named = (k) => made("figcaption", {}, made("b", {}, names[k]));
        this.figures = this.canvases.map((canvas, k) => made("figure", { class: "solid" }, canvas, named(k)));
        const turn = (label, low, high, k) => slider(label, {
            low, high, value: this.view[k], words: degrees, changed: (x) => this.orbit(k ? [this.view[0], x] : [x, this.view[1]]),
        });
        this.sliders = [turn("Orbit around", -180, 180, 0), turn("Orbit over", 0, 90, 1)];
        this.canvases.forEach((canvas) => this.watch(canvas));
    }

    watch(canvas) {
        canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
        canvas.addEventListener("pointermove", (event) => {
            if (!event.buttons) return;
            const [around, over] = this.view, box = canvas.getBoundingClientRect();
            const turned = ((around - (180 * event.movementX) / box.width + 540) % 360) - 180;
            this.orbit([turned, Math.min(Math.max(over + (120 * event.movementY) / box.height, 0), 90)]);
        });
    }

    orbit(view) {
        this.view = view;
        this.sliders.forEach(({ set }, k) => set(view[k]));
        this.paint();
    }

    // Values anew, where the incidence, the channel, the scale or a parameter is another.
    draw() {
        const { thetaI, scale } = this.lobes, { phiI, points } = this.lobes.section();
        const turn = phiI + 180, about = ([x, y, z]) => [x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn), z, 0];
        const light = [sin(thetaI) * cos(phiI), sin(thetaI) * sin(phiI), cos(thetaI), 0];
        this.directions = aroundMirror(thetaI);
        const values = this.lobes.values(this.directions.map(({ at }) => [light, about(at)]), ROUND + 1, AWAY + 1);
        const measured = [...points.map(([theta, value]) => [[sin(theta), 0, cos(theta)], value]), ...this.scattered()];
        const scaled = SCALES[scale][1];
        this.most = Math.max(...values.flat(), ...measured.map(([, value]) => value), 1e-9);
        const radius = (value) => scaled(Math.max(value, 0) / this.most);
        this.surfaces = values.map((row) => this.directions.map(({ at }, j) => at.map((part) => part * radius(row[j]))));
        this.points = measured.map(([at, value]) => at.map((part) => part * radius(value)));
        this.paint();
    }

    // What was measured out of the plane at the slider's incidence.
    scattered() {
        const { colour, channel, thetaI } = this.lobes, column = colour[channel] ?? -1;
        const map = this.maps.find(({ theta_i: theta }) => Math.abs(theta - thetaI) < 0.5);
        if (map === undefined || column < 0) return [];
        const place = (theta, phi) => [sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)];
        const found = map.measured[column].map((value, j) => [place(map.theta_o[j], map.phi[j]), value]);
        return found.filter(([, value]) => value !== null);
    }

    // To the right, upwards, and towards the viewer.
    seen([x, y, z]) {
        const [around, over] = this.view, away = y * cos(around) - x * sin(around);
        return [x * cos(around) + y * sin(around), z * cos(over) + away * sin(over), z * sin(over) - away * cos(over)];
    }

    paint() {
        if (this.surfaces === undefined) return;
        this.canvases.forEach((canvas, k) => this.paintOne(canvas, this.surfaces[k], k));
    }

    paintOne(canvas, surface, k) {
        const ratio = Math.min(devicePixelRatio || 1, 2), width = 320 * ratio, height = 270 * ratio;
        if (canvas.width !== width) Object.assign(canvas, { width, height });
        const context = canvas.getContext("2d"), ink = getComputedStyle(canvas).color, shaded = this.shades(canvas, k);
        const middle = height * (0.5 + 0.2 * cos(this.view[1]));
        const place = ([x, y]) => [width / 2 + 0.41 * width * x, middle - 0.41 * width * y];
        const path = (corners) => {
            context.beginPath();
            corners.forEach((corner, j) => context[j ? "lineTo" : "moveTo"](...place(corner)));
        };
        const drawn = (corners, colour, thick) => {
            path(corners);
            Object.assign(context, { strokeStyle: colour, lineWidth: thick * ratio });
            context.stroke();
        };
        context.clearRect(0, 0, width, height);
        context.globalAlpha = 0.35;
        const ring = (far) => Array.from({ length: 73 }, (_, j) => this.seen([far * cos(5 * j), far * sin(5 * j), 0]));
        [0.5, 1].forEach((far) => drawn(ring(far), ink, 0.7));
        drawn([this.seen([0, 0, 0]), this.seen([0, 0, 1])], ink, 0.7);
        context.globalAlpha = 1;
        drawn([this.seen([0, 0, 0]), this.seen([-sin(this.lobes.thetaI), 0, cos(this.lobes.thetaI)])], "#e69f00", 2);
        this.faces(surface).forEach(({ corners, lit }) => {
            path(corners);
            context.fillStyle = context.strokeStyle = shaded(lit);
            context.lineWidth = 1.3 * ratio; // no seams
            context.fill();
            context.stroke();
        });
        context.fillStyle = ink;
        for (const point of this.points) {
            const [x, y] = place(this.seen(point));
            context.fillRect(x - 1.2 * ratio, y - 1.2 * ratio, 2.4 * ratio, 2.4 * ratio);
        }
        const name = canvas.getAttribute("aria-label").split(",")[0], { length } = this.points;
        canvas.setAttribute("aria-label", `${name}, light from ${digits(this.lobes.thetaI)}°, ${length} measured points`);
    }

    // The surface's quadrangles, the farthest first, and how much each faces the viewer.
    faces(surface) {
        const seen = surface.map((point) => this.seen(point)), found = [];
        for (let k = 0; k < AWAY; ++k) {
            for (let j = 0; j < ROUND; ++j) {
                const at = [k, k + 1, k + 1, k].map((row, n) => row * (ROUND + 1) + j + (n > 1 ? 1 : 0));
                if (at.every((place) => this.directions[place].below)) continue;
                const corners = at.map((place) => seen[place]), [a, b, c] = corners;
                const [u, v] = [0, 1].map((n) => [0, 1, 2].map((axis) => [b, c][n][axis] - a[axis]));
                const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                const lit = Math.abs(0.45 * normal[0] - 0.5 * normal[1] - 0.75 * normal[2]) / (Math.hypot(...normal) || 1);
                found.push({ corners, lit, depth: corners.reduce((sum, corner) => sum + corner[2], 0) });
            }
        }
        return found.sort((one, other) => one.depth - other.depth);
    }

    // A model's colour, darker where its surface turns away.
    shades(canvas, k) {
        canvas.style.backgroundColor = `var(${k === 0 ? "--one" : "--other"})`;
        const parts = getComputedStyle(canvas).backgroundColor.match(/[\d.]+/g).slice(0, 3).map(Number);
        canvas.style.backgroundColor = "";
        return (lit) => `rgb(${parts.map((part) => Math.round(part * (0.45 + 0.6 * Math.min(lit, 0.92)))).join(",")})`;
    }
}
