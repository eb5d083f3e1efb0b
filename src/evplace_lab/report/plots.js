"use strict";

// Drawing: elements, axes, and three plots. Each plot is drawn to the width it has, and again when that changes.

const SVG = "http://www.w3.org/2000/svg";

function svg(name, attributes, parent, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

function element(name, attributes, ...inside) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...inside);
  return made;
}

const short = (value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(4))));
const percent = (share) => (share === null || share === undefined ? "–" : (100 * share).toFixed(1) + " %");

// Calls draw(width) now and whenever the width of the place changes; gives what draws once more.
function drawn(place, draw) {
  let last = 0;
  const again = () => {
    const width = Math.round(place.clientWidth);
    if (width > 0 && width !== last) draw((last = width));
  };
  new ResizeObserver(again).observe(place);
  again();
  return () => draw(last);
}

// 1, 2 or 5 times a power of ten, so that at most `many` of them make up `length`.
function niceStep(length, many) {
  const least = length / many;
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least * 0.999);
}

// Axes with a grid; gives the two scales and the layer to draw into.
function axes(place, box, x, y) {
  const { width, height, left = 46, right = 10, top = 8, bottom = 40 } = box;
  const picture = svg("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img" });
  const atX = (value) => left + ((value - x.low) / (x.high - x.low)) * (width - left - right);
  const atY = (value) => height - bottom - ((value - y.low) / (y.high - y.low)) * (height - top - bottom);
  const grid = svg("g", { class: "grid" }, picture);
  for (let value = Math.ceil(x.low / x.step) * x.step; value <= x.high + 1e-9; value += x.step) {
    svg("line", { x1: atX(value), x2: atX(value), y1: top, y2: height - bottom }, grid);
    svg("text", { x: atX(value), y: height - bottom + 15, "text-anchor": "middle" }, grid, short(value));
  }
  for (let value = Math.ceil(y.low / y.step) * y.step; value <= y.high + 1e-9; value += y.step) {
    svg("line", { x1: left, x2: width - right, y1: atY(value), y2: atY(value) }, grid);
    svg("text", { x: left - 6, y: atY(value) + 4, "text-anchor": "end" }, grid, short(value));
  }
  svg("text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle" }, grid, x.name);
  const turned = { transform: `translate(12 ${(top + height - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" };
  svg("text", turned, grid, y.name);
  place.replaceChildren(picture);
  return { picture, atX, atY };
}

// Calls onMove(x, y), in the picture's own units, where the mouse moves or a finger touches.
function whilePointing(picture, onMove) {
  const follow = (event) => {
    const box = picture.getBoundingClientRect();
    onMove(event.clientX - box.left, event.clientY - box.top);
  };
  picture.addEventListener("pointermove", follow);
  picture.addEventListener("pointerdown", follow);
}

// How the curves of each input are drawn, and the paper's, which are dashed.
const STYLES = {
  solid: { "stroke-width": 2.4, "stroke-dasharray": "none" },
  thin: { "stroke-width": 1.1, "stroke-dasharray": "none" },
  dotted: { "stroke-width": 2.2, "stroke-dasharray": "1.5 3.5" },
  dashdot: { "stroke-width": 1.8, "stroke-dasharray": "9 3 2 3" },
  dashed: { "stroke-width": 1.8, "stroke-dasharray": "6 4" },
};

// A point of a curve; large where it is the only one, hollow where it is the paper's.
function spot(parent, [cx, cy], line, look) {
  const hollow = line.style === "dashed";
  const r = line.points.length === 1 ? 4.5 : 2.3;
  svg("circle", { cx, cy, r, fill: hollow ? "var(--panel)" : look.stroke, stroke: look.stroke, "stroke-width": 1.5 }, parent);
}

// Precision over recall. Hovering or the arrow keys show values; the legend hides and shows curves.
function curvePlot(place, panel) {
  const lines = panel.lines.filter((line) => line.points.length);
  const canvas = element("div", { class: "canvas" });
  const readout = element("output", { "aria-live": "polite" });
  const legend = element("div", { class: "legend" });
  const hidden = new Set();
  const looks = lines.map((line) => ({ stroke: `var(--c${line.colour % 8})`, ...STYLES[line.style] }));
  const name = (line) => {
    const spread = line.spread === null ? "" : ` ± ${line.spread.toFixed(3)}`;
    return line.label + (line.ap === null ? "" : ` (AP ${line.ap.toFixed(3)}${spread})`);
  };
  const hint = "Point at a curve, or use the arrow keys, for its values.";
  lines.forEach((line, number) => {
    const swatch = svg("svg", { width: 26, height: 10, "aria-hidden": "true" });
    if (line.points.length === 1) spot(swatch, [13, 5], line, looks[number]);
    else svg("line", { x1: 1, x2: 25, y1: 5, y2: 5, ...looks[number] }, swatch);
    const button = element("button", { type: "button", "aria-pressed": "true" }, swatch, name(line));
    button.addEventListener("click", () => {
      if (!hidden.delete(number)) hidden.add(number);
      button.setAttribute("aria-pressed", String(!hidden.has(number)));
      redraw();
    });
    legend.append(button);
  });
  place.append(canvas, readout, legend);
  readout.textContent = hint;

  const redraw = drawn(canvas, (width) => {
    const unit = { low: 0, high: 1, step: 0.2 };
    const box = { width, height: Math.min(380, Math.max(240, width * 0.75)) };
    const plot = axes(canvas, box, { ...unit, name: "recall" }, { ...unit, name: "precision" });
    plot.picture.setAttribute("tabindex", 0);
    plot.picture.setAttribute("aria-label", `Precision over recall: ${panel.title}`);
    const spots = [];
    lines.forEach((line, number) => {
      if (hidden.has(number)) return;
      const places = line.points.map(([recall, precision]) => [plot.atX(recall), plot.atY(precision)]);
      const path = "M" + places.map((at) => at.map((value) => value.toFixed(1)).join(" ")).join("L");
      svg("path", { d: path, class: "curve", ...looks[number] }, plot.picture);
      if (places.length < 30) for (const at of places) spot(plot.picture, at, line, looks[number]);
      places.forEach((at, index) => spots.push({ at, number, index }));
    });
    const cursor = svg("circle", { r: 6, class: "cursor", visibility: "hidden" }, plot.picture);
    let chosen = null;
    const choose = (spot) => {
      chosen = spot;
      const line = lines[spot.number];
      const [recall, precision, value] = line.points[spot.index];
      cursor.setAttribute("cx", spot.at[0]);
      cursor.setAttribute("cy", spot.at[1]);
      cursor.setAttribute("visibility", "visible");
      const at = value === null ? "" : `, ${line.parameter} ${short(value)}`;
      readout.textContent = `${line.label}: recall ${recall.toFixed(3)}, precision ${precision.toFixed(3)}${at}`;
    };
    const leave = () => {
      chosen = null;
      cursor.setAttribute("visibility", "hidden");
      readout.textContent = hint;
    };
    whilePointing(plot.picture, (x, y) => {
      const far = (spot) => Math.hypot(spot.at[0] - x, spot.at[1] - y);
      const nearest = spots.reduce((best, spot) => (best && far(best) <= far(spot) ? best : spot), null);
      if (nearest && far(nearest) < 30) choose(nearest);
      else leave();
    });
    plot.picture.addEventListener("pointerleave", leave);
    plot.picture.addEventListener("keydown", (event) => {
      const along = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      const across = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (!spots.length || !(along || across)) return;
      event.preventDefault();
      if (!chosen) return choose(spots[0]);
      const at = spots.indexOf(chosen);
      if (along) return choose(spots[(at + along + spots.length) % spots.length]);
      const numbers = [...new Set(spots.map((spot) => spot.number))];
      const next = numbers[(numbers.indexOf(chosen.number) + across + numbers.length) % numbers.length];
      choose(spots.find((spot) => spot.number === next));
    });
  });
}

// Round dots as one path each: thousands cost no more than a few.
function dots(parent, places, attributes) {
  if (!places.length) return;
  const d = places.map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`).join("");
  svg("path", { d, class: "dots", ...attributes }, parent);
}
