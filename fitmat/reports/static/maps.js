/* Maps: each incidence seen from above, its points coloured by value or by what a model leaves over. */
"use strict";
fitmat.part("maps", (place, {figures}) => {
  const {state, element, number} = fitmat;
  const CIVIDIS = [[0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]];
  const DIVIDING = [[0, 90, 160], [86, 180, 233], [235, 235, 235], [240, 160, 100], [190, 70, 0]];
  controls(document.getElementById("curve-controls"));
  draw();
  fitmat.redraw(draw);
  addEventListener("fitmat-state", draw);

  function controls(bar) {
    const kinds = ["measured", ...figures.models.map(name => `residual of ${name}`)];
    bar.append(element("label", {}, "maps show", element("select", {id: "map-kind", onchange: event => {
      state.map = event.target.selectedIndex ? figures.models[event.target.selectedIndex - 1] : "measured";
      draw();
    }}, ...kinds.map(text => element("option", {textContent: text})))));
    if (!figures.curves.length && figures.channels.length > 1)
      bar.append(element("label", {}, "channel", element("select", {onchange: event => { state.channel = event.target.selectedIndex; draw(); }},
        ...figures.channels.map((name, k) => element("option", {textContent: name, selected: k === state.channel})))));
  }

  function values(m) { return (state.map === "measured" ? m.measured : m.residual[state.map])[state.channel]; }

  function scale() {
    if (state.map !== "measured") return {stops: DIVIDING, low: -4, high: 4, share: v => (v + 4) / 8};
    const positive = figures.maps.flatMap(m => m.measured[state.channel]).filter(v => v > 0).sort((a, b) => a - b);
    const low = positive[Math.floor(0.02 * positive.length)] || 1e-6, high = positive[positive.length - 1] || 1;
    const log = Math.log10(high / low) > 1.5;
    return {stops: CIVIDIS, low: log ? low : 0, high, log, share: v => log ? Math.log(Math.max(v, low) / low) / Math.log(high / low) : v / high};
  }

  function colour(stops, share) {
    const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
    return `rgb(${stops[k].map((v, c) => Math.round(v + (stops[k + 1][c] - v) * (at - k))).join(",")})`;
  }

  function draw() {
    const s = scale();
    place.replaceChildren();
    for (const m of figures.maps) one(m, s);
    const stops = s.stops.map(c => `rgb(${c.join(",")})`).join(",");
    const unit = state.map === "measured" ? `BRDF / sr⁻¹${s.log ? ", logarithmic" : ""}` : "residual / sd";
    place.append(element("div", {className: "map"}, element("span", {className: "scale", style: `background:linear-gradient(90deg,${stops})`}),
      element("div", {className: "ends"}, element("span", {textContent: number(s.low, 3)}), element("span", {textContent: unit}), element("span", {textContent: number(s.high, 3)}))));
  }

  function star(ctx, x, y) {
    ctx.beginPath();
    for (let k = 0; k < 10; k++) {
      const radius = k % 2 ? 6 : 14, turn = Math.PI * (k / 5 - 0.5);
      ctx.lineTo(x + radius * Math.cos(turn), y + radius * Math.sin(turn));
    }
    ctx.closePath();
    ctx.fillStyle = "#f0b000"; ctx.strokeStyle = "#000000"; ctx.lineWidth = 1.5;
    ctx.fill(); ctx.stroke();
  }

  function one(m, s) {
    const size = 480, middle = size / 2, reach = middle - 8, list = values(m);
    const canvas = element("canvas", {width: size, height: size, tabIndex: 0, role: "img"});
    const readout = element("p", {className: "readout", ariaLive: "polite"});
    const known = m.theta_o.map((_, i) => i).filter(i => list[i] !== null);
    const spots = known.map(i => ({i, x: middle + reach * m.theta_o[i] / 90 * Math.cos(m.phi[i] * Math.PI / 180), y: middle - reach * m.theta_o[i] / 90 * Math.sin(m.phi[i] * Math.PI / 180)}));
    const highest = known.reduce((best, i) => best === null || list[i] > list[best] ? i : best, null);
    canvas.setAttribute("aria-label", highest === null ? `Incidence ${m.name}: no value` :
      `Incidence ${m.name} from above: ${known.length} of ${m.points} points; the largest ${state.map === "measured" ? "value" : "residual"} ${number(list[highest], 3)} at θₒ ${number(m.theta_o[highest], 3)}°, azimuth ${number(m.phi[highest], 3)}° from the mirror side`);
    place.append(element("div", {className: "map"}, element("h4", {textContent: `incidence ${m.name}`}), canvas, readout));
    const ctx = canvas.getContext("2d"), radius = Math.min(Math.max(reach * 0.9 / Math.sqrt(known.length || 1), 4), 13);
    ctx.strokeStyle = fitmat.colour("line");
    for (const ring of [30, 60, 90]) { ctx.beginPath(); ctx.arc(middle, middle, reach * ring / 90, 0, 7); ctx.stroke(); }
    ctx.beginPath(); ctx.moveTo(8, middle); ctx.lineTo(size - 8, middle); ctx.moveTo(middle, 8); ctx.lineTo(middle, size - 8); ctx.stroke();
    for (const spot of [...spots].sort((a, b) => list[a.i] - list[b.i])) {
      ctx.fillStyle = colour(s.stops, s.share(list[spot.i]));
      ctx.beginPath(); ctx.arc(spot.x, spot.y, radius, 0, 7); ctx.fill();
    }
    ctx.strokeStyle = ctx.fillStyle = fitmat.colour("model0");
    ctx.lineWidth = 3;
    ctx.beginPath(); ctx.arc(middle + reach * m.theta_i / 90, middle, 13, 0, 7); ctx.stroke();
    star(ctx, middle - reach * m.theta_i / 90, middle);
    const tell = i => { readout.textContent = `θₒ ${number(m.theta_o[i], 3)}°, azimuth ${number(m.phi[i], 3)}°: measured ${number(m.measured[state.channel][i])} sr⁻¹, residual ` +
      figures.models.map(name => `${number(m.residual[name][state.channel][i], 2)} sd (${name})`).join(", "); };
    canvas.addEventListener("pointermove", event => {
      const box = canvas.getBoundingClientRect(), x = (event.clientX - box.left) * size / box.width, y = (event.clientY - box.top) * size / box.height;
      if (spots.length) tell(spots.reduce((a, b) => Math.hypot(b.x - x, b.y - y) < Math.hypot(a.x - x, a.y - y) ? b : a).i);
    });
    let place_ = -1;
    canvas.addEventListener("keydown", event => {
      const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
      if (!step || !known.length) return;
      place_ = Math.min(Math.max(place_ + step, 0), known.length - 1);
      tell(known[place_]);
      event.preventDefault();
    });
  }
});
