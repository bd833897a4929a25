/* One chart: lines with bands, points, a shaded range; hover, zoom and keyboard alike for all. Built on uPlot.
   fitmat.chart(place, options) returns the chart; options:
     x (rising), series: [{label, values, low, high, colour, width, dash, points, outlined}], height, yScale
     ("linear" | "log" | "cube root"), xRange, yRange, xLabel, yLabel, marks: [x], shades: [[from, to]] along x,
     strip: [low, high] along y, label (what the chart shows, in words), zoomed(ends), at(x), ySplits. */
"use strict";
fitmat.chart = (place, options) => {
  const faint = fitmat.colour("faint"), grid = fitmat.colour("grid"), shade = fitmat.colour("shade");
  const data = [options.x], series = [{}], bands = [];
  const log = options.yScale === "log";
  const clean = values => log ? values.map(v => v !== null && v > 0 ? v : null) : values;
  for (const one of options.series) {
    if (one.low) {
      const edge = {stroke: one.outlined ? one.colour : "transparent", width: 1, dash: [2, 3], spanGaps: true, points: {show: false}};
      series.push({...edge}, {...edge});
      data.push(clean(one.high), clean(one.low));
      if (!one.outlined) bands.push({series: [series.length - 2, series.length - 1], fill: faded(one.colour, 0.18)});
    }
    series.push(one.points
      ? {stroke: one.colour, paths: () => null, points: {show: true, size: one.size || 4.5, width: 1, fill: one.hollow ? fitmat.colour("paper") : one.colour, stroke: one.colour}}
      : {stroke: one.colour, width: one.width || 2, dash: one.dash, spanGaps: true, points: {show: false}});
    data.push(clean(one.values));
  }
  const distribution = {linear: {distr: 1}, log: {distr: 3}, "cube root": {distr: 100, fwd: Math.cbrt, bwd: v => v ** 3}};
  const axis = {stroke: faint, grid: {stroke: grid, width: 1}, ticks: {stroke: grid, size: 4}, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 18, labelGap: 2};
  const chart = new uPlot({
    width: Math.max(place.clientWidth, 200), height: options.height || 260, series, bands,
    legend: {show: false},
    scales: {x: {time: false, range: (u, min, max) => options.zoom && options.zoom() || options.xRange},
             y: {...distribution[options.yScale || "linear"], range: () => options.yRange}},
    axes: [{...axis, label: options.xLabel, size: 30, values: (u, splits) => splits.map(v => v + "°"), splits: degrees},
           {...axis, label: options.yLabel, size: 56, splits: options.ySplits ? (u, axis, min, max) => options.ySplits.filter(v => v >= min && v <= max) : options.yScale === "cube root" ? evenly : log ? powers : undefined, filter: (u, splits) => splits,
            values: (u, splits) => splits.map(v => v === null || log && !told(v) ? "" : short(v))}],
    cursor: {drag: {x: Boolean(options.zoomed), y: false, setScale: false}, y: false, points: {show: false}},
    hooks: {
      drawClear: [u => under(u, options, shade, faint)],
      setSelect: [u => {
        if (u.select.width < 5 || !options.zoomed) return;
        const ends = [u.select.left, u.select.left + u.select.width].map(at => u.posToVal(at, "x"));
        u.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
        options.zoomed(ends);
      }],
      setCursor: [u => { if (options.at && u.cursor.left >= 0) options.at(u.posToVal(u.cursor.left, "x")); }],
    },
  }, data, place);
  chart.over.addEventListener("dblclick", () => options.zoomed && options.zoomed(null));
  place.setAttribute("role", "img");
  place.setAttribute("aria-label", options.label);
  return chart;

  function faded(text, part) {
    const found = text.match(/[0-9a-f]{2}/gi).map(pair => parseInt(pair, 16));
    return `rgba(${found.join(",")},${part})`;
  }
  function short(value) {
    const size = Math.abs(value);
    return size !== 0 && (size >= 1e5 || size < 1e-3) ? value.toExponential(0) : String(Number(value.toPrecision(3)));
  }
  /* Powers of ten; of less than two decades also 2 and 5. */
  function told(value) {
    const power = Math.floor(Math.log10(value) + 1e-9), lead = Math.round(value / 10 ** power * 1e6) / 1e6;
    return lead === 1 || options.yRange[1] / options.yRange[0] < 100 && (lead === 2 || lead === 5);
  }
  function degrees(u, axis, min, max) {
    const step = [1, 2, 5, 10, 15, 30].find(s => (max - min) / s <= Math.max(u.bbox.width / devicePixelRatio / 55, 2)) || 60;
    const found = [];
    for (let v = Math.ceil(min / step) * step; v <= max; v += step) found.push(v);
    return found;
  }
  /* 1 to 9 times powers of ten: uPlot's own never end where a scale does not begin at one of them. */
  function powers(u, axis, min, max) {
    const found = [];
    for (let power = Math.floor(Math.log10(min)); power <= Math.log10(max); power++)
      for (let lead = 1; lead < 10; lead++) found.push(Number(`${lead}e${power}`));
    return found.filter(v => v >= min && v <= max);
  }
  function evenly(u, axis, min, max) {
    const low = Math.cbrt(min), high = Math.cbrt(max), found = [];
    for (let k = 0; k <= 4; k++) found.push(Number(((low + (high - low) * k / 4) ** 3).toPrecision(2)));
    return found.filter(v => v >= min && v <= max);
  }
  function under(u, options, shade, faint) {
    const {ctx, bbox} = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = shade;
    for (const [from, to] of options.shades || []) {
      const a = u.valToPos(from, "x", true), b = u.valToPos(to, "x", true);
      ctx.fillRect(a, bbox.top, b - a, bbox.height);
    }
    if (options.strip) {
      const a = u.valToPos(options.strip[1], "y", true), b = u.valToPos(options.strip[0], "y", true);
      ctx.fillRect(bbox.left, a, bbox.width, b - a);
    }
    ctx.strokeStyle = faint;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
    for (const mark of options.marks || []) {
      const x = u.valToPos(mark, "x", true);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }
};
