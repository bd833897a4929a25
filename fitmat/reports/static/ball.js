// The ball of two materials: what one sees, and controls for light, view, surface and parameters. Draws on change only.
"use strict";

const GREY = 0.18; // mean luminance of the lit part when the exposure is found, white being 1
const ACROSS = 320; // pixels of a picture, times what the display has

class Ball {
    constructor(root, data) {
        this.root = root;
        this.data = data;
        this.gpu = new Gpu(document.createElement("canvas"));
        this.display = this.gpu.program(DISPLAY);
        this.programs = data.models.map(({ source }) => this.gpu.program(source + BALL));
        this.values = data.models.map(({ fit }) => [...fit]);
        this.drawn = 0;
        this.drawnWith = []; // what else is drawn anew with the ball
        this.state = {
            light: [...data.light], orbit: [0, 0], lit: this.gpu.slow ? "light" : "both", dents: 0, bumps: 0, stops: 0, soft: 0,
            wipe: data.models.length > 1 ? 0.5 : 1, amplified: 4,
        };
        this.dragging = false;
        this.rounds = this.gpu.slow ? 24 : 48; // of four directions of the sky for each pixel
        this.resize();
        this.expose();
        this.build();
        this.changed();
        addEventListener("resize", () => this.resize() && this.changed());
    }

    // Whether the display's pixels are others than before.
    resize() {
        const size = Math.round(ACROSS * Math.min(Math.max(devicePixelRatio || 1, 1), 2));
        if (size === this.size) return false;
        this.size = this.gpu.canvas.width = this.gpu.canvas.height = size;
        return true;
    }

    // A pixel is the mean of so many points in each direction.
    get fine() {
        return this.state.lit === "light" && this.size < 500 ? 2 : 1;
    }

    uniforms(k) {
        const found = {};
        for (const { uniform, start, spectrum, shared } of this.data.models[k].parameters) {
            if (uniform === null) continue;
            const at = (c) => this.values[k][start + (shared ? 0 : c)];
            found[uniform] = spectrum ? [at(0), at(1), at(2)] : at(0);
        }
        return found;
    }

    // Radiances of material k in the present light, four numbers a pixel in a target of its own.
    rendered(k) {
        const { state, data } = this, across = this.size * this.fine;
        const target = this.gpu.target(across, across), [angle, direction] = state.light;
        this.gpu.draw(this.programs[k], {
            ...this.uniforms(k),
            ...data.sky,
            turn: turned(state.orbit),
            light: [sin(angle) * cos(direction), sin(angle) * sin(direction), cos(angle)],
            irradiance: state.lit === "sky" ? 0 : Math.PI,
            sky: state.lit === "light" ? 0 : 1,
            rounds: this.dragging ? 6 : this.rounds,
            size: across,
            dents: state.dents,
            bumps: state.bumps,
        }, target);
        return target;
    }

    // Finds the exposure: of the last material, as it is now.
    expose() {
        const target = this.rendered(this.programs.length - 1), seen = this.gpu.pixels(target), m = this.data.colours;
        this.gpu.remove(target);
        let total = 0, count = 0;
        for (let p = 0; p < seen.length; p += 4) {
            const at = (c) => m[c] * seen[p] + m[3 + c] * seen[p + 1] + m[6 + c] * seen[p + 2];
            const luminance = 0.2126 * at(0) + 0.7152 * at(1) + 0.0722 * at(2);
            if (luminance > 0) [total, count] = [total + luminance, count + 1];
        }
        this.exposure = count > 0 ? (GREY * count) / total : 1;
    }

    // Asks for one drawing, at the next frame.
    changed() {
        if (this.pending) return;
        this.pending = true;
        requestAnimationFrame(() => {
            this.pending = false;
            this.draw();
        });
    }

    draw() {
        const targets = this.programs.map((_, k) => this.rendered(k)), { state } = this;
        const [one, other] = [targets[0].texture, targets[targets.length - 1].texture];
        for (const { canvas, wipe, amplified } of this.views) {
            if (canvas.width !== this.size) canvas.width = canvas.height = this.size;
            this.gpu.draw(this.display, {
                one, other, wipe: wipe(), amplified: amplified(), soft: state.soft, fine: this.fine, size: this.size,
                colours: this.data.colours, exposure: this.exposure * 2 ** state.stops,
            });
            const context = canvas.getContext("2d");
            context.clearRect(0, 0, this.size, this.size);
            context.drawImage(this.gpu.canvas, 0, 0);
        }
        targets.forEach((target) => this.gpu.remove(target));
        this.said.textContent = this.words();
        this.drawnWith.forEach((draw) => draw());
    }

    // The conditions of the picture, in words.
    words() {
        const { state } = this, [angle, direction] = state.light.map(Math.round);
        const light = `one light ${angle}° from the viewer, at ${direction}° on the screen (counter-clockwise from the right)`;
        const from = { light, sky: this.data.surroundings, both: `${light}; ${this.data.surroundings}` }[state.lit];
        const tone = state.soft ? "L/(1 + L)" : "none, cut at white";
        return `Light: ${from}. Exposure ×${digits(this.exposure * 2 ** state.stops)}; tone curve: ${tone}; sRGB. ${this.data.words}`;
    }

    set(name, value) {
        this.state[name] = value;
        this.changed();
    }

    // Turns the viewer about the ball: light, sky and object stay where they are.
    orbit(to) {
        const [angle, direction] = this.state.light, before = turned(this.state.orbit), after = turned(to);
        const light = [sin(angle) * cos(direction), sin(angle) * sin(direction), cos(angle)];
        const world = [0, 1, 2].map((j) => light.reduce((sum, part, i) => sum + before[3 * j + i] * part, 0));
        const [x, y, z] = [0, 1, 2].map((i) => world.reduce((sum, part, j) => sum + after[3 * j + i] * part, 0));
        this.state.orbit = to;
        this.aim([Math.acos(Math.min(Math.max(z, -1), 1)), Math.atan2(y, x)].map((a) => (a * 180) / Math.PI));
        this.sliders.azimuth.set(to[0]);
        this.sliders.elevation.set(to[1]);
    }

    aim([angle, direction]) {
        this.state.light = [angle, ((direction % 360) + 360) % 360];
        this.sliders.angle.set(this.state.light[0]);
        this.sliders.direction.set(this.state.light[1]);
        this.changed();
    }

    // The light goes where the pointer is, as if the mirror's normal were there; with Shift or the right button one orbits.
    dragged(canvas, event) {
        const box = canvas.getBoundingClientRect();
        if (this.turning || event.shiftKey || event.buttons === 2) {
            const [azimuth, elevation] = this.state.orbit, bent = elevation + (event.movementY * 180) / box.height;
            const round = ((azimuth + (event.movementX * 180) / box.width + 540) % 360) - 180;
            this.orbit([round, Math.min(Math.max(bent, -90), 90)]);
            return;
        }
        const x = ((event.clientX - box.left) / box.width) * 2 - 1, y = 1 - ((event.clientY - box.top) / box.height) * 2;
        const away = Math.min(Math.hypot(x, y) * EXTENT, 1);
        this.aim([(2 * Math.asin(away) * 180) / Math.PI, (Math.atan2(y, x) * 180) / Math.PI]);
    }

    watch(canvas) {
        canvas.addEventListener("contextmenu", (event) => event.preventDefault());
        canvas.addEventListener("pointerdown", (event) => {
            canvas.setPointerCapture(event.pointerId);
            this.dragging = true;
            if (!this.turning && !event.shiftKey && event.button === 0) this.dragged(canvas, event);
        });
        canvas.addEventListener("pointermove", (event) => this.dragging && event.buttons && this.dragged(canvas, event));
        for (const end of ["pointerup", "pointercancel"]) {
            canvas.addEventListener(end, () => {
                this.dragging = false;
                this.changed();
            });
        }
    }

    view(label, words, wipe, amplified = () => 0) {
        const canvas = made("canvas", { role: "img", "aria-label": label, width: this.size, height: this.size });
        this.watch(canvas);
        this.views.push({ canvas, wipe, amplified });
        return made("figure", {}, canvas, made("figcaption", {}, ...words));
    }

    build() {
        const { state, data } = this, names = data.models.map(({ role }) => role), two = names.length > 1;
        this.views = [];
        const pictures = [this.view(`Lit ball of ${names[0]}`, two ? [this.wiped()] : [made("b", {}, names[0])], () => state.wipe)];
        if (two) {
            const apart = `Difference of ${names[0]} and ${names[1]}`;
            pictures.push(this.view(`Lit ball of ${names[1]}`, [made("b", {}, names[1])], () => 0));
            pictures.push(this.view(apart, [this.amplifier(names)], () => 0, () => state.amplified));
        }
        this.said = made("p", { class: "said", "aria-live": "polite" });
        this.panels = data.models.map((_, k) => this.parameters(k));
        this.root.replaceChildren(
            made("div", { class: "pictures" }, ...pictures),
            made("div", { class: "panels" }, ...this.panels.map(({ panel }) => panel), this.lighting(), this.surface()),
            this.said,
        );
    }

    wiped() {
        const [one, other] = this.data.models.map(({ role }) => role);
        const words = (x) => (x >= 1 ? one : x <= 0 ? other : `${Math.round(100 * x)} %`);
        const options = { low: 0, high: 1, value: this.state.wipe, words, changed: (x) => this.set("wipe", x) };
        return slider(made("b", {}, `${one} | ${other}`), options).row;
    }

    amplifier([one, other]) {
        const words = (x) => `× ${digits(x)}`, changed = (x) => this.set("amplified", x);
        const { row } = slider(made("b", {}, "Difference"), { low: 1, high: 32, log: true, value: this.state.amplified, words, changed });
        const colours = [made("i", { class: "warm" }), ` ${one} brighter `, made("i", { class: "cool" }), ` ${other} brighter`];
        return made("span", {}, row, made("small", {}, ...colours));
    }

    // The sliders of a material, which begin at the fit.
    parameters(k) {
        const { parameters, fit, role, name, draws, held } = this.data.models[k], rows = [], sets = [];
        for (const { symbol, unit, doc, uniform, start, channels, low, high, log, intervals } of parameters) {
            channels.forEach((channel, c) => {
                const value = fit[start + c], label = [...written(symbol), channel && ` ${channel}`];
                const words = (x) => digits(x) + (unit === "1" ? "" : unit);
                const changed = (x) => {
                    this.values[k][start + c] = x;
                    this.changed();
                };
                const [least, most] = [Math.min(low, value), Math.max(high, value)];
                const marks = [[...intervals[c], "range"], [value, value, "fit"]];
                const { row, set } = slider(label, { low: least, high: most, log, value, words, marks, changed });
                row.title = doc;
                row.querySelector("input").disabled = uniform === null;
                rows.push(row);
                sets.push([start + c, set]);
            });
        }
        const put = (vector) => {
            this.values[k] = [...vector];
            sets.forEach(([place, set]) => set(vector[place]));
            this.changed();
        };
        const buttons = [made("button", { type: "button", click: () => put(fit) }, "Reset to fit")];
        if (draws.length > 0 && k === 0) buttons.push(this.shaker());
        const legend = made("legend", {}, `${role} `, made("code", {}, name));
        const note = held ? [made("small", {}, held)] : [];
        return { panel: made("fieldset", {}, legend, ...rows, ...note, made("div", { class: "buttons" }, ...buttons)), put };
    }

    // One button for all materials: the next draw of each posterior.
    shaker() {
        const button = made("button", { type: "button", click: () => this.shake() }, "Shake: a posterior draw");
        this.counted = made("output", { "aria-live": "polite" });
        return made("span", {}, button, " ", this.counted);
    }

    shake() {
        const draws = Math.min(...this.data.models.map(({ draws }) => draws.length || Infinity));
        this.data.models.forEach((model, k) => model.draws.length > 0 && this.panels[k].put(model.draws[this.drawn]));
        this.drawn = (this.drawn + 1) % draws;
        this.counted.textContent = `draw ${this.drawn || draws} of ${draws}`;
    }

    lighting() {
        const { state } = this, [angle, direction] = state.light;
        const lit = choice("Lit by", { light: "one light", sky: "sky and windows", both: "both" }, (value) => {
            state.lit = value;
            this.expose();
            this.changed();
        });
        const aimed = (k) => (x) => this.aim(k ? [state.light[0], x] : [x, state.light[1]]);
        const orbited = (k) => (x) => this.orbit(k ? [state.orbit[0], x] : [x, state.orbit[1]]);
        const turn = (label, low, high, value, changed) => slider(label, { low, high, value, words: degrees, changed });
        this.sliders = {
            angle: turn("Light from viewer", 0, 180, angle, aimed(0)),
            direction: turn("Light on screen", 0, 360, direction, aimed(1)),
            azimuth: turn("Orbit around", -180, 180, 0, orbited(0)),
            elevation: turn("Orbit over", -90, 90, 0, orbited(1)),
        };
        lit.select.value = state.lit;
        const drag = choice("Dragging", { light: "moves the light", orbit: "orbits (or Shift)" }, (value) => {
            this.turning = value === "orbit";
        });
        const rows = [lit, ...Object.values(this.sliders), drag].map(({ row }) => row);
        return made("fieldset", {}, made("legend", {}, "Light and view"), ...rows);
    }

    surface() {
        const put = (name) => (x) => this.set(name, x);
        const share = (x) => (x === 0 ? "none" : digits(x));
        const rows = [
            choice("Shape", { 0: "sphere", 0.07: "dented sphere" }, (value) => this.set("dents", Number(value))),
            slider("Fine waves", { low: 0, high: 0.1, value: 0, words: share, changed: put("bumps") }),
            slider("Exposure", { low: -4, high: 4, value: 0, words: (x) => `${x.toFixed(1)} EV`, changed: put("stops") }),
            choice("Tone curve", { 0: "none, cut at white", 1: "L/(1 + L)" }, (value) => this.set("soft", Number(value))),
        ];
        return made("fieldset", {}, made("legend", {}, "Surface and display"), ...rows.map(({ row }) => row));
    }
}
