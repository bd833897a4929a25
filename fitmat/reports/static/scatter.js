// Two columns of a batch against each other: a point for each file that is shown, with its interval where there is one.
"use strict";
(() => {
  const place = document.getElementById("scatter"), table = document.getElementById("files");
  if (!place) return;
  const data = JSON.parse(document.getElementById("data").textContent), rows = [...table.tBodies[0].rows];
  const chosen = ["across", "up"].map((id) => document.getElementById(id));
  const told = document.getElementById("point"), counted = document.getElementById("drawn");
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const short = (value) => {
    const size = Math.abs(value);
    return size !== 0 && (size >= 1e5 || size < 1e-3) ? value.toExponential(2) : String(Number(value.toPrecision(4)));
  };
  const DECADES = 30, NEAR = 12;  // ratio from which on a scale is logarithmic; pixels within which a point is meant
  let chart = null, points = [], nearest = null;

  function looked(name) {
    const values = data.columns[name];
    const ends = ["_low", "_high"].map((end) => data.columns[name + end]);
    return (k) => {
      const [low, high] = ends.map((column) => (column ? column[k] : null));
      return values[k] === null ? null : {value: values[k], low: low ?? values[k], high: high ?? values[k], known: low !== null && high !== null};
    };
  }

  function scaled(cells) {
    const values = cells.map((cell) => cell.value), least = Math.min(...values), most = Math.max(...values);
    const log = least > 0 && most / least >= DECADES;
    const room = log ? (most / least) ** 0.05 : 0.06 * (most - least || Math.abs(most) || 1);
    return {log, range: log ? [least / room, most * room] : [least - room, most + room]};
  }

  /* Of a logarithmic axis: powers of ten; of less than four decades also 2 and 5. */
  function powers(u, axis, least, most) {
    const found = [], leads = most / least < 1e4 ? [1, 2, 5] : [1];
    for (let power = Math.floor(Math.log10(least)); power <= Math.log10(most); power++)
      for (const lead of leads) found.push(Number(`${lead}e${power}`));
    return found.filter((tick) => tick >= least && tick <= most);
  }

  function draw() {
    const [across, up] = chosen.map((select) => select.value), [x, y] = [looked(across), looked(up)];
    points = rows.map((row, k) => ({row, name: data.names[k], x: x(k), y: y(k)}))
      .filter((point) => !point.row.hidden && point.x && point.y).sort((a, b) => a.x.value - b.x.value);
    nearest = null;
    chart?.destroy();
    chart = null;
    place.replaceChildren();
    const shown = rows.filter((row) => !row.hidden).length;
    counted.textContent = `${points.length} of ${shown} files have both numbers.`;
    told.textContent = "";
    if (!points.length) return;
    const scales = [scaled(points.map((point) => point.x)), scaled(points.map((point) => point.y))];
    const axis = {stroke: colour("faint"), grid: {stroke: colour("grid"), width: 1}, ticks: {stroke: colour("grid"), size: 4},
                  font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 18, values: (u, ticks) => ticks.map((tick) => (tick === null ? "" : short(tick)))};
    const scale = ({log, range}) => ({time: false, distr: log ? 3 : 1, range: () => range});
    const words = [across, up].map((name, k) => name + (scales[k].log ? " (logarithmic)" : ""));
    chart = new uPlot({
      width: Math.max(place.clientWidth, 200), height: 360, legend: {show: false},
      series: [{}, {paths: () => null, points: {show: false}}],
      scales: {x: scale(scales[0]), y: scale(scales[1])},
      axes: scales.map(({log}, k) => ({...axis, label: words[k], size: [30, 60][k], splits: log ? powers : undefined, filter: (u, ticks) => ticks})),
      cursor: {drag: {x: false, y: false}, x: false, y: false, points: {show: false}},
      hooks: {draw: [marked], setCursor: [meant]},
    }, [points.map((point) => point.x.value), points.map((point) => point.y.value)], place);
    chart.over.addEventListener("click", () => nearest && go(nearest));
    place.setAttribute("role", "img");
    place.setAttribute("aria-label", `${words[1]} against ${words[0]} of ${points.length} files; their numbers are in the table`);
  }

  function marked(u) {
    const {ctx, bbox} = u, pixel = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const point of points) {
      const [x, y] = [u.valToPos(point.x.value, "x", true), u.valToPos(point.y.value, "y", true)];
      ctx.strokeStyle = ctx.fillStyle = colour(point === nearest ? "ink" : "accent");
      ctx.globalAlpha = point === nearest ? 1 : 0.45;
      ctx.lineWidth = pixel;
      ctx.beginPath();
      ctx.moveTo(end(u, point.x.low, "x"), y); ctx.lineTo(end(u, point.x.high, "x"), y);
      ctx.moveTo(x, end(u, point.y.low, "y")); ctx.lineTo(x, end(u, point.y.high, "y"));
      ctx.stroke();
      ctx.globalAlpha = 1;
      ctx.beginPath();
      ctx.arc(x, y, (point === nearest ? 5 : 3.5) * pixel, 0, 2 * Math.PI);
      ctx.fill();
    }
    ctx.restore();
  }

  /* An end of an interval; one that a logarithmic scale does not reach lies at its border. */
  const end = (u, value, scale) => u.valToPos(Math.max(value, u.scales[scale].distr === 3 ? u.scales[scale].min : -Infinity), scale, true);

  function meant(u) {
    const {left, top} = u.cursor;
    const far = (point) => Math.hypot(u.valToPos(point.x.value, "x") - left, u.valToPos(point.y.value, "y") - top);
    const best = points.reduce((a, b) => (a && far(a) <= far(b) ? a : b), null);
    const found = left >= 0 && best && far(best) <= NEAR ? best : null;
    if (found === nearest) return;
    nearest = found;
    u.over.style.cursor = found ? "pointer" : "";
    told.textContent = found ? `${found.name}: ${said(chosen[0].value, found.x)}, ${said(chosen[1].value, found.y)}` : "";
    u.redraw(false);
  }

  const said = (name, cell) => `${name} ${short(cell.value)}${cell.known ? ` (${short(cell.low)} to ${short(cell.high)})` : ""}`;

  function go(point) {
    for (const row of rows) row.classList.toggle("meant", row === point.row);
    point.row.scrollIntoView({block: "center"});
  }

  for (const select of chosen) select.addEventListener("change", draw);
  table.addEventListener("shown", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  let width = place.clientWidth;
  addEventListener("resize", () => { if (place.clientWidth !== width) { width = place.clientWidth; draw(); } });
  draw();
})();
