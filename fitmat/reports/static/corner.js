/* The corner: every parameter of a posterior against every other, on a canvas, drawn when its part is unfolded. */
"use strict";
fitmat.part("corner", (place, {figures}) => {
  const {element, number} = fitmat, names = Object.keys(figures.draws);
  let chosen = names[names.length - 1];
  document.getElementById("corner-controls").append(element("label", {}, "posterior of", element("select", {id: "corner-model", onchange: event => { chosen = event.target.value; draw(); }},
    ...names.map(name => element("option", {textContent: name, value: name, selected: name === chosen})))));
  document.getElementById("sure").addEventListener("toggle", event => { if (event.target.open) draw(); });
  fitmat.redraw(() => { if (document.getElementById("sure").open) draw(); });

  function draw() {
    const d = figures.draws[chosen], count = d.names.length;
    const columns = d.values.map((list, k) => {
      const bend = d.log[k] ? Math.log : v => v, values = list.map(v => bend(d.low[k] + d.step[k] * v));
      const sorted = [...values].sort((a, b) => a - b), at = share => sorted[Math.round(share * (sorted.length - 1))];
      const low = at(0.002), high = at(0.998);
      return {values, low, high: high > low ? high : low + 1, ends: [at(0.025), at(0.975)], best: bend(d.best[k]), back: d.log[k] ? Math.exp : v => v};
    });
    const size = 900, left = 70, bottom = 60, cell = (size - left - bottom / 2) / count;
    const canvas = element("canvas", {width: size, height: left / 2 + count * cell + bottom, role: "img"});
    canvas.setAttribute("aria-label", said(d, columns));
    place.replaceChildren(canvas);
    const ctx = canvas.getContext("2d"), ink = fitmat.colour("ink"), faint = fitmat.colour("faint"), line = fitmat.colour("line"), best = fitmat.colour("model0"), fill = fitmat.colour("accent");
    ctx.font = "15px system-ui, sans-serif";
    ctx.textAlign = "center";
    for (let r = 0; r < count; r++) for (let c = 0; c <= r; c++) {
      const x0 = left + c * cell, y0 = 10 + r * cell, w = cell - 8, x = columns[c], y = columns[r];
      const along = (column, v) => Math.min(Math.max((v - column.low) / (column.high - column.low), 0), 1);
      ctx.strokeStyle = line; ctx.lineWidth = 1; ctx.strokeRect(x0, y0, w, w);
      if (r === c) histogram(ctx, x, x0, y0, w, along, fill); else density(ctx, x, y, x0, y0, w, along, fill);
      ctx.strokeStyle = faint; ctx.setLineDash([4, 4]);
      if (r === c) for (const end of x.ends) stroke(ctx, x0 + w * along(x, end), y0, x0 + w * along(x, end), y0 + w);
      ctx.setLineDash([]); ctx.strokeStyle = best; ctx.lineWidth = 2;
      stroke(ctx, x0 + w * along(x, x.best), y0, x0 + w * along(x, x.best), y0 + w);
      if (r !== c) stroke(ctx, x0, y0 + w * (1 - along(y, y.best)), x0 + w, y0 + w * (1 - along(y, y.best)));
      ctx.fillStyle = ink;
      if (r === count - 1) {
        ctx.fillText(label(d, c), x0 + w / 2, y0 + w + 42);
        ctx.fillStyle = faint; ctx.font = "13px system-ui, sans-serif";
        ctx.textAlign = "left"; ctx.fillText(number(x.back(x.low), 3), x0, y0 + w + 18);
        ctx.textAlign = "right"; ctx.fillText(number(x.back(x.high), 3), x0 + w, y0 + w + 18);
        ctx.textAlign = "center"; ctx.font = "15px system-ui, sans-serif";
      }
      if (c === 0 && r > 0) {
        ctx.save(); ctx.translate(18, y0 + w / 2); ctx.rotate(-Math.PI / 2); ctx.fillStyle = ink; ctx.fillText(label(d, r), 0, 0); ctx.restore();
        ctx.fillStyle = faint; ctx.textAlign = "right"; ctx.font = "13px system-ui, sans-serif";
        ctx.fillText(number(y.back(y.high), 3), left - 4, y0 + 13); ctx.fillText(number(y.back(y.low), 3), left - 4, y0 + w);
        ctx.textAlign = "center"; ctx.font = "15px system-ui, sans-serif";
      }
    }
    if (d.left_out) place.append(element("p", {className: "faint", textContent: `${d.left_out} more parameters, of other channels, are not drawn; their draws are in the file of the posterior.`}));
  }

  function label(d, k) { return d.symbols[k].replace("_", "") + d.names[k].replace(/^\S+/, ""); }
  function stroke(ctx, a, b, c, d) { ctx.beginPath(); ctx.moveTo(a, b); ctx.lineTo(c, d); ctx.stroke(); }

  function histogram(ctx, x, x0, y0, w, along, fill) {
    const bins = new Array(28).fill(0);
    for (const v of x.values) bins[Math.min(Math.floor(along(x, v) * 28), 27)]++;
    const most = Math.max(...bins);
    ctx.fillStyle = fill; ctx.globalAlpha = 0.55;
    bins.forEach((n, k) => ctx.fillRect(x0 + k * w / 28, y0 + w - 0.92 * w * n / most, w / 28 + 0.5, 0.92 * w * n / most));
    ctx.globalAlpha = 1;
  }

  function density(ctx, x, y, x0, y0, w, along, fill) {
    const side = 26, cells = new Array(side * side).fill(0);
    x.values.forEach((v, i) => { cells[Math.min(Math.floor(along(y, y.values[i]) * side), side - 1) * side + Math.min(Math.floor(along(x, v) * side), side - 1)]++; });
    const most = Math.max(...cells);
    ctx.fillStyle = fill;
    cells.forEach((n, k) => {
      if (!n) return;
      ctx.globalAlpha = 0.12 + 0.88 * n / most;
      ctx.fillRect(x0 + (k % side) * w / side, y0 + w - (Math.floor(k / side) + 1) * w / side, w / side + 0.4, w / side + 0.4);
    });
    ctx.globalAlpha = 1;
  }

  function said(d, columns) {
    let best = [0, null, null];
    columns.forEach((x, i) => columns.slice(0, i).forEach((y, j) => {
      const r = correlation(x.values, y.values);
      if (Math.abs(r) > Math.abs(best[0])) best = [r, i, j];
    }));
    return best[1] === null ? `Posterior of ${chosen}: ${d.names.join(", ")}` :
      `Posterior of ${chosen} over ${d.names.join(", ")}; most alike are ${d.names[best[2]]} and ${d.names[best[1]]}, correlation ${best[0].toFixed(2)}`;
  }

  function correlation(a, b) {
    const mean = list => list.reduce((s, v) => s + v, 0) / list.length, ma = mean(a), mb = mean(b);
    let top = 0, one = 0, two = 0;
    a.forEach((v, i) => { top += (v - ma) * (b[i] - mb); one += (v - ma) ** 2; two += (b[i] - mb) ** 2; });
    return one > 0 && two > 0 ? top / Math.sqrt(one * two) : 0;
  }
});
