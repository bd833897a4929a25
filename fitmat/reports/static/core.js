/* The page's data, colours and state; a room of its own draws each part.
   A part registers with fitmat.part(id, draw): draw(section, data) runs once when the page is ready, where an element
   of that id exists; fitmat.redraw(callback) is called when the colour scheme or the width of the page changes. */
"use strict";
const fitmat = (() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  document.documentElement.classList.add("drawn");  // what stands in for charts makes way, before any is measured
  const redraws = [];
  const state = {channel: Math.floor(data.figures.channels.length / 2), scale: null, shared: true, bands: true,
                 models: new Set(data.figures.models), incidences: null, zoom: null, map: "measured"};

  const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const modelColour = name => colour("model" + Math.max(data.figures.models.indexOf(name), 0) % 4);

  const dashes = [[9, 4], undefined, [11, 3, 2, 3], [3, 3]];  // as in page.css
  const modelDash = name => dashes[Math.max(data.figures.models.indexOf(name), 0) % 4];

  /* A piece of a line, for a legend; the colour as CSS has it. */
  function key(colour, dash) {
    let at = 0;
    const parts = (dash || [24]).map((length, k) => `${k % 2 ? "transparent" : colour} ${at}px ${at += length}px`);
    return element("span", {className: "key", style: `background:repeating-linear-gradient(90deg,${parts.join(",")})`, ariaHidden: "true"});
  }

  function element(tag, attributes = {}, ...children) {
    const made = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (key in made && key !== "list" && key !== "role") made[key] = value;
      else made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
  }

  function number(value, digits = 4) {
    if (value === null || value === undefined || !Number.isFinite(value)) return "–";
    if (value === 0) return "0";
    const size = Math.abs(value);
    if (size >= 1e5 || size < 1e-3) return value.toExponential(Math.max(digits - 2, 1)).replace("e", "·10^").replace("^+", "^");
    return String(Number(value.toPrecision(digits)));
  }

  const fitOf = name => data.record.fits.find(fit => fit.model === name);

  function part(id, draw) {
    const section = document.getElementById(id);
    if (section) draw(section, data);
  }

  function redraw(callback) { redraws.push(callback); }

  let width = document.documentElement.clientWidth, waiting = 0;
  const again = () => { for (const callback of redraws) callback(); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  for (const [event, onPaper] of [["beforeprint", true], ["afterprint", false]]) addEventListener(event, () => {
    document.documentElement.classList.toggle("paper", onPaper);
    again();
  });
  addEventListener("resize", () => {
    if (document.documentElement.clientWidth === width) return;
    width = document.documentElement.clientWidth;
    clearTimeout(waiting);
    waiting = setTimeout(again, 120);
  });

  return {data, state, colour, modelColour, modelDash, key, element, number, fitOf, part, redraw};
})();
