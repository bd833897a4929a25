// Controls: elements, labelled sliders and choices of the ball and the lobes. They know no material.
"use strict";

// An element with attributes (functions are listeners) and children.
function made(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
        if (typeof value === "function") element.addEventListener(name, value);
        else if (value !== null) element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
}

// A symbol of the literature, "k_d", with its index below.
function written(symbol) {
    const [letter, below] = symbol.split("_");
    return below === undefined ? [letter] : [letter, made("sub", {}, below)];
}

function digits(value) {
    const size = Math.abs(value);
    return size >= 1e4 || (size < 1e-3 && size > 0) ? value.toExponential(2) : String(Number(value.toPrecision(3)));
}

// A labelled slider from 0 to 1 on a scale, with the value in words beside it and marks below.
function slider(label, { low, high, log = false, value, words = digits, marks = [], changed }) {
    const [from, to] = log ? [Math.log(low), Math.log(high)] : [low, high];
    const place = (x) => Math.min(Math.max(((log ? Math.log(Math.max(x, low)) : x) - from) / (to - from), 0), 1);
    const input = made("input", { type: "range", min: 0, max: 1, step: 0.001 }), output = made("output");
    const bands = marks.map(([start, end, kind]) => {
        const band = made("i", { class: kind });
        band.style.left = `${100 * place(start)}%`;
        band.style.width = `${100 * (place(end) - place(start))}%`;
        return band;
    });
    const set = (x) => {
        input.value = place(x);
        output.textContent = words(x);
        input.setAttribute("aria-valuetext", output.textContent);
    };
    input.addEventListener("input", () => {
        const at = from + (to - from) * Number(input.value), x = log ? Math.exp(at) : at;
        output.textContent = words(x);
        input.setAttribute("aria-valuetext", output.textContent);
        changed(x);
    });
    set(value);
    const track = made("span", { class: "track" }, made("span", { class: "marks", "aria-hidden": "true" }, ...bands), input);
    const row = made("label", { class: "slider" }, made("span", {}, ...[label].flat()), track, output);
    return { row, set };
}

function choice(label, named, changed) {
    const options = Object.entries(named).map(([value, words]) => made("option", { value }, words));
    const select = made("select", { change: () => changed(select.value) }, ...options);
    return { row: made("label", { class: "choice" }, made("span", {}, label), select), select };
}

const sin = (degrees) => Math.sin((degrees * Math.PI) / 180), cos = (degrees) => Math.cos((degrees * Math.PI) / 180);
const degrees = (x) => `${Math.round(x)}°`;

// World to viewer, by columns: turned about y, then about x.
function turned([azimuth, elevation]) {
    const [c, s, d, e] = [cos(azimuth), sin(azimuth), cos(elevation), sin(elevation)];
    return [c, e * s, -d * s, 0, d, e, s, -e * c, d * c];
}
