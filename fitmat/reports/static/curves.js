/* Curves: one panel an incidence, its residuals below, and the controls of both. */
"use strict";
fitmat.part("panels", (place, {figures}) => {
  const {state, element, number} = fitmat;
  const positive = figures.curves.flatMap(c => c.measured.flat()).filter(v => v > 0);
  const least = positive.reduce((a, b) => Math.min(a, b), Infinity), most = positive.reduce((a, b) => Math.max(a, b), 0);
  state.scale = positive.length && Math.log10(most / least) > 1.5 ? "log" : "linear";
  state.incidences = new Set(figures.curves.map((_, k) => k));
  let drawn = [];

  controls(document.getElementById("curve-controls"));
  draw();
  fitmat.redraw(draw);
  addEventListener("fitmat-state", draw);
  table(document.getElementById("curve-table"));

  function change(edit) {
    edit();
    dispatchEvent(new Event("fitmat-state"));
  }

  function controls(bar) {
    const choice = (legend, name, options, chosen, pick) => element("fieldset", {}, element("legend", {textContent: legend}),
      ...options.map((text, k) => element("label", {}, element("input", {type: "radio", name, checked: text === chosen || k === chosen, onchange: () => change(() => pick(text, k))}), text)));
    const tick = (text, on, pick, key) => element("label", {}, element("input", {type: "checkbox", checked: on, onchange: event => change(() => pick(event.target.checked))}),
      ...(key ? [key] : []), text);
    bar.append(element("fieldset", {}, element("legend", {textContent: "models"}), ...figures.models.map((name, k) =>
      tick(name, true, on => on ? state.models.add(name) : state.models.delete(name), fitmat.key(`var(--model${k % 4})`, fitmat.modelDash(name))))));
    bar.append(tick("95 % bands", true, on => { state.bands = on; }));
    bar.append(choice("scale", "scale", ["linear", "log", "cube root"], state.scale, text => { state.scale = text; }));
    bar.append(tick("one scale for all", true, on => { state.shared = on; }));
    if (figures.channels.length > 1)
      bar.append(element("label", {}, "channel", element("select", {onchange: event => change(() => { state.channel = event.target.selectedIndex; })},
        ...figures.channels.map((name, k) => element("option", {textContent: name, selected: k === state.channel})))));
    if (figures.curves.length > 1)
      bar.append(element("fieldset", {}, element("legend", {textContent: "incidences"}), ...figures.curves.map((c, k) =>
        tick(title(c, true), true, on => on ? state.incidences.add(k) : state.incidences.delete(k)))));
    bar.append(element("button", {type: "button", id: "whole", textContent: "all angles", disabled: true, onclick: () => zoom(null)}));
  }

  function title(c, brief) {
    return `${brief ? "" : "incidence "}${number(c.theta_i)}°${c.phi_i ? `, azimuth ${number(c.phi_i)}°` : ""}`;
  }

  function zoom(ends) {
    state.zoom = ends;
    document.getElementById("whole").disabled = !ends;
    for (const chart of drawn) chart.redraw(true, true);
    for (const chart of drawn) chart.setScale("x", {min: (ends || [-90, 90])[0], max: (ends || [-90, 90])[1]});
  }

  function draw() {
    for (const chart of drawn) chart.destroy();
    drawn = [];
    place.replaceChildren();
    const names = figures.models.filter(name => state.models.has(name));
    const shown = figures.curves.filter((_, k) => state.incidences.has(k));
    const whole = range(shown, names);
    const boxes = shown.map(c => frame(c, names));
    place.append(...boxes.map(parts => parts.box));  // before any chart: their widths follow from all of them
    shown.forEach((c, n) => panel(c, names, state.shared ? whole : range([c], names), boxes[n]));
  }

  function frame(c, names) {
    const upper = element("div", {className: "chart"}), lower = element("div", {className: "chart"});
    const readout = element("p", {className: "readout", ariaLive: "polite"});
    const box = element("div", {className: "panel", tabIndex: 0, role: "group"}, element("h3", {textContent: title(c)}), upper, lower, readout);
    box.setAttribute("aria-label", said(c, names));
    readout.textContent = "Point at a curve to read it.";
    return {box, upper, lower, readout};
  }

  /* From the measured values; a fit may go past them by a factor of 3, not more. */
  function range(curves, names) {
    const measured = curves.flatMap(c => c.measured[state.channel]).filter(v => v !== null);
    const top = measured.reduce((a, b) => Math.max(a, b), 1e-6), above = measured.filter(v => v > 0);
    const fits = curves.flatMap(c => names.flatMap(n => c.models[n].value[state.channel])).reduce((a, b) => Math.max(a, b), 0);
    const high = Math.max(top, Math.min(fits, 3 * top));
    if (state.scale === "log") return [(above.length ? above.reduce((a, b) => Math.min(a, b)) : 1e-6) / 2.5, high * 1.6];
    return [Math.min(0, measured.reduce((a, b) => Math.min(a, b), 0) * 1.1), high * (state.scale === "linear" ? 1.06 : 1.15)];
  }

  function panel(c, names, yRange, {box, upper, lower, readout}) {
    const k = state.channel;
    const used = c.theta_o.map((x, i) => i).filter(i => c.measured[k][i] !== null);
    const x = merged(c, names, used);
    const at = new Map();
    let place_ = 0;
    for (const i of used) {
      while (x[place_] < c.theta_o[i]) place_++;
      at.set(place_++, i);
    }
    const series = names.map(name => {
      const m = c.models[name], band = state.bands && used.length > 1, inside = used.map(i => c.theta_o[i]);
      return {values: x.map(v => along(m.theta_o, m.value[k], v)), colour: fitmat.modelColour(name), dash: fitmat.modelDash(name),
              outlined: fitmat.fitOf(name).inadequate,
              low: band ? x.map(v => along(inside, used.map(i => m.low[k][i]), v, true)) : null,
              high: band ? x.map(v => along(inside, used.map(i => m.high[k][i]), v, true)) : null};
    });
    series.push({values: x.map((v, n) => at.has(n) ? c.measured[k][at.get(n)] : null), colour: fitmat.colour("measured"), points: true});
    const show = v => tell(c, names, used, v, readout);
    const common = {x, xRange: [-90, 90], zoom: () => state.zoom, zoomed: zoom, at: show, marks: [c.theta_i], label: said(c, names)};
    const one = fitmat.chart(upper, {...common, series, yScale: state.scale, yRange, yLabel: "BRDF / sr⁻¹", height: 250});
    const z = names.map(name => ({values: x.map((v, n) => at.has(n) ? c.models[name].residual[k][at.get(n)] : null),
                                  colour: fitmat.modelColour(name), points: true, size: 4, hollow: figures.models.indexOf(name) % 2 === 0}));
    const largest = names.flatMap(name => used.map(i => Math.abs(c.models[name].residual[k][i] || 0))).reduce((a, b) => Math.max(a, b), 0);
    const most = Math.min(Math.max(largest * 1.1, 3.5), 12);
    const two = fitmat.chart(lower, {...common, series: z, yRange: [-most, most], strip: [-2, 2], xLabel: "θₒ, positive on the mirror side", yLabel: "residual / sd", height: 150, ySplits: [-10, -5, -2, 0, 2, 5, 10]});
    drawn.push(one, two);
    box.addEventListener("keydown", event => keys(event, c, used, [one, two], show));
  }

  /* All angles at which something is known, rising; those of the points with their repeats. */
  function merged(c, names, used) {
    const points = used.map(i => c.theta_o[i]), there = new Set(points);
    const lines = new Set(names.flatMap(name => c.models[name].theta_o).filter(v => !there.has(v)));
    return [...points, ...lines].sort((a, b) => a - b);
  }

  function along(xs, ys, x, inside) {
    const last = xs.length - 1;
    if (x < xs[0] || x > xs[last]) return inside || last < 0 ? null : x < xs[0] ? ys[0] : ys[last];
    let low = 0, high = last;
    while (high - low > 1) { const middle = (low + high) >> 1; if (xs[middle] <= x) low = middle; else high = middle; }
    if (ys[low] === null || ys[high] === null) return null;
    return xs[high] === xs[low] ? ys[low] : ys[low] + (ys[high] - ys[low]) * (x - xs[low]) / (xs[high] - xs[low]);
  }

  function nearest(c, used, x) {
    return used.reduce((best, i) => Math.abs(c.theta_o[i] - x) < Math.abs(c.theta_o[best] - x) ? i : best, used[0]);
  }

  function tell(c, names, used, x, readout) {
    if (!used.length) return;
    const i = nearest(c, used, x), k = state.channel;
    const parts = names.flatMap(name => {
      const m = c.models[name];
      return [" · ", element("b", {textContent: name}), ` ${number(along(m.theta_o, m.value[k], c.theta_o[i]))}, residual ${number(m.residual[k][i], 2)} sd`];
    });
    readout.replaceChildren(element("b", {textContent: `θₒ ${number(c.theta_o[i])}°`}), `: measured ${number(c.measured[k][i])} sr⁻¹`, ...parts);
  }

  function keys(event, c, used, charts, show) {
    if (event.target.tagName === "INPUT" || event.ctrlKey || event.metaKey || event.altKey) return;
    const box = event.currentTarget;
    const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    const [min, max] = state.zoom || [-90, 90];
    if (step && used.length) {
      const now = Math.min(Math.max((box.dataset.at === undefined ? (step > 0 ? -1 : used.length) : Number(box.dataset.at)) + step, 0), used.length - 1);
      box.dataset.at = now;
      const x = c.theta_o[used[now]];
      for (const chart of charts) chart.setCursor({left: chart.valToPos(x, "x"), top: 10}, false);
      show(x);
    } else if (event.key === "+" || event.key === "-") {
      const middle = box.dataset.at === undefined ? (min + max) / 2 : c.theta_o[used[Number(box.dataset.at)]];
      const half = (max - min) / 2 * (event.key === "+" ? 0.6 : 1 / 0.6);
      zoom(half >= 90 ? null : [Math.max(middle - half, -90), Math.min(middle + half, 90)]);
    } else if (event.key === "0") zoom(null);
    else return;
    event.preventDefault();
  }

  function said(c, names) {
    const k = state.channel, used = c.theta_o.map((_, i) => i).filter(i => c.measured[k][i] !== null);
    const parts = names.map(name => {
      const z = used.map(i => c.models[name].residual[k][i]).filter(v => v !== null);
      return `${name} within 2 standard deviations at ${Math.round(100 * z.filter(v => Math.abs(v) <= 2).length / Math.max(z.length, 1))} % of them`;
    });
    return `${title(c)}: ${used.length} measured points; ${parts.join("; ")}`;
  }

  function table(details) {
    details.addEventListener("toggle", () => {
      const scroll = details.querySelector(".scroll");
      if (!details.open || scroll.childElementCount) return;
      const head = ["θᵢ / °", "θₒ / °", "channel", "measured / sr⁻¹", ...figures.models.flatMap(name => [name, "residual / sd"])];
      const body = element("tbody");
      for (const c of figures.curves) c.theta_o.forEach((x, i) => figures.channels.forEach((channel, k) => {
        if (c.measured[k][i] === null) return;
        const cells = [number(c.theta_i), number(x), channel, number(c.measured[k][i], 5)];
        for (const name of figures.models) cells.push(number(along(c.models[name].theta_o, c.models[name].value[k], x), 5), number(c.models[name].residual[k][i], 3));
        body.append(element("tr", {}, ...cells.map(text => element("td", {className: "number", textContent: text}))));
      }));
      scroll.append(element("table", {}, element("thead", {}, element("tr", {}, ...head.map(text => element("th", {scope: "col", textContent: text})))), body));
    });
  }
});
