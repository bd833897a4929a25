/* The match: albedos and distances against incidence. */
"use strict";
fitmat.part("albedo", (place, {figures, record}) => {
  const m = figures.match, {number} = fitmat, beside = document.getElementById("distance");
  const measured = m.measured_deg, shades = [[0, measured[0]], [measured[1], 90]];
  let drawn = [];
  draw();
  fitmat.redraw(draw);

  function draw() {
    for (const chart of drawn) chart.destroy();
    place.replaceChildren();
    beside.replaceChildren();
    const pair = [[m.empirical, m.albedo.empirical], [m.microfacet, m.albedo.microfacet]];
    const albedo = pair.map(([name, rows]) => ({label: name, values: rows[1], low: rows[0], high: rows[2], colour: fitmat.modelColour(name), dash: fitmat.modelDash(name), outlined: fitmat.fitOf(name).inadequate}));
    const regions = {core: [4, 3], tail: [8, 3], grazing: [1, 3], diffuse: [8, 3, 2, 3]};
    const lines = Object.entries(m.by_region).map(([name, rows], k) => ({label: name, values: rows[1], colour: fitmat.colour("model" + k), width: 1.5, dash: regions[name]}));
    lines.push({label: "all directions", values: m.distance[1], low: m.distance[0], high: m.distance[2], colour: fitmat.colour("measured")});
    const gap = record.match.albedo_gap_max;
    drawn = [
      one(place, albedo, "albedo ρ(θᵢ)", Math.max(1.02, ...pair.flatMap(([, rows]) => rows[1])) * 1.03,
          `Albedo against incidence: the largest gap is ${number(100 * gap.value, 3)} % of the light at ${number(gap.theta_i_deg, 3)}°`, [gap.theta_i_deg]),
      one(beside, lines, "relative distance", Math.min(Math.max(1.02, ...m.distance[1].filter(v => v !== null)) * 1.1, 3),
          `Distance against incidence: ${number(100 * m.distance[1][0], 3)} % at 0°, ${number(100 * m.distance[1][m.distance[1].length - 1], 3)} % at ${number(m.theta_i[m.theta_i.length - 1], 3)}°`, []),
    ];
  }

  function one(where, series, yLabel, top, label, marks) {
    const legend = fitmat.element("p", {className: "readout"});
    const box = fitmat.element("div", {className: "chart", tabIndex: 0});
    where.append(box, legend);
    const tell = x => {
      const i = m.theta_i.reduce((best, v, k) => Math.abs(v - x) < Math.abs(m.theta_i[best] - x) ? k : best, 0);
      legend.replaceChildren(...[`θᵢ ${number(m.theta_i[i])}°: `, ...series.flatMap((s, k) => [...(k ? [" · "] : []), fitmat.key(s.colour, s.dash), ` ${s.label} ${number(s.values[i], 3)}`])]);
    };
    legend.replaceChildren(...series.flatMap((s, k) => [...(k ? [" · "] : []), fitmat.key(s.colour, s.dash), ` ${s.label}`]));
    const chart = fitmat.chart(box, {x: m.theta_i, series, xRange: [0, 90], yRange: [0, top], xLabel: "incidence θᵢ", yLabel, shades, marks, label, at: tell, height: 270});
    let at = -1;
    box.addEventListener("keydown", event => {
      const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
      if (!step) return;
      at = Math.min(Math.max(at + step, 0), m.theta_i.length - 1);
      tell(m.theta_i[at]);
      event.preventDefault();
    });
    return chart;
  }
});
