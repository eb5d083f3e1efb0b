// What a person does with the page: switch rules, look at one result, go along its drive.

const data = JSON.parse(document.getElementById("data").textContent);

const WORDS = {
  right: "right",
  wrong: "wrong",
  missed: "rejected, though known",
  unseen: "rejected, and unknown",
};
const ERROR_EDGES_M = [10, 20, 40, 80];
const ERROR_WORDS = ["below 10 m", "10 to 20 m", "20 to 40 m", "40 to 80 m", "80 m and more"];
const SAMPLE_WORDS = ["query", "matched", "nearest right"];

function ruleSwitch() {
  for (const button of document.querySelectorAll("button[data-shows]")) {
    const section = button.closest("section"); // each table has rules of its own
    button.addEventListener("click", () => {
      for (const one of section.querySelectorAll("button[data-shows]")) {
        one.setAttribute("aria-pressed", String(one === button));
      }
      for (const block of section.querySelectorAll("[data-rule]")) {
        block.hidden = block.dataset.rule !== button.dataset.shows;
      }
    });
  }
}

// Metres from each query to the item answered, null where there is no answer or no position.
function errors(result) {
  const here = data.positions[result.query_xy];
  const there = data.positions[result.item_xy];
  return result.item.map((item, query) => {
    if (!here || !there || item < 0 || here[query][0] === null || there[item][0] === null) return null;
    return Math.hypot(here[query][0] - there[item][0], here[query][1] - there[item][1]);
  });
}

function legend(entries) {
  const place = element("div", { class: "key" });
  for (const [name, colour, hollow] of entries) {
    const swatch = svg("svg", { width: 14, height: 14, "aria-hidden": "true" });
    const look = hollow ? { fill: "none", stroke: colour, "stroke-width": 2 } : { fill: colour };
    svg("circle", { cx: 7, cy: 7, r: 5, ...look }, swatch);
    place.append(element("span", {}, swatch, name));
  }
  return place;
}

const named = (kind) => data.outcomes.indexOf(kind);

// The item answered at each point of the drive; answers of no item stand on a line below.
function itemsPlot(place, result, show) {
  const canvas = element("div", { class: "canvas" });
  const known = data.outcomes.map((kind) => [WORDS[kind], `var(--${kind})`]);
  const right = result.true ? [["the right item", "var(--faint)"]] : [];
  place.append(canvas, legend([...right, ...known]));
  const plot = {};
  drawn(canvas, (width) => {
    const height = Math.min(360, Math.max(240, width * 0.4));
    const count = result.item.length;
    const items = result.figures.items;
    const x = { low: 0, high: Math.max(1, count - 1), step: niceStep(count, width / 90), name: "query" };
    const y = { low: -0.06 * items, high: items, step: niceStep(items, 6), name: "map item" };
    const made = axes(canvas, { width, height }, x, { ...y });
    made.picture.setAttribute("aria-label", "The map item answered at each query of the drive");
    const at = (query, item) => [made.atX(query), made.atY(item < 0 ? -0.045 * items : item)];
    if (result.true) {
      const faint = result.true.flatMap((item, query) => (item < 0 ? [] : [at(query, item)]));
      dots(made.picture, faint, { stroke: "var(--faint)", "stroke-width": 7 });
    }
    data.outcomes.forEach((kind, number) => {
      const chosen = result.item.flatMap((item, query) => (result.outcome[query] === number ? [at(query, item)] : []));
      dots(made.picture, chosen, { stroke: `var(--${kind})`, "stroke-width": kind === "wrong" ? 4.5 : 3.5 });
    });
    const line = svg("line", { y1: 8, y2: height - 40, class: "cursor" }, made.picture);
    const dot = svg("circle", { r: 6, class: "cursor" }, made.picture);
    plot.mark = (query) => {
      const [cx, cy] = at(query, result.item[query]);
      for (const end of ["x1", "x2"]) line.setAttribute(end, cx);
      dot.setAttribute("cx", cx);
      dot.setAttribute("cy", cy);
    };
    whilePointing(made.picture, (at) => {
      const share = (at - 46) / (width - 56);
      show(Math.round(Math.min(1, Math.max(0, share)) * (count - 1)));
    });
    if (plot.query !== undefined) plot.mark(plot.query);
  });
  return (query) => plot.mark((plot.query = query));
}

// How far each item stands out at each query, the darker the further, and the path of the answers over it.
function similarityPlot(place, result, show) {
  const canvas = element("div", { class: "canvas" });
  place.append(canvas, legend([["accepted answers", "var(--accent)"]]));
  const plot = {};
  drawn(canvas, (width) => {
    const height = Math.min(360, Math.max(240, width * 0.6));
    const count = result.item.length;
    const items = result.figures.items;
    const x = { low: 0, high: Math.max(1, count - 1), step: niceStep(count, width / 90), name: "query" };
    const y = { low: 0, high: Math.max(1, items - 1), step: niceStep(items, 6), name: "map item" };
    const { picture, atX, atY } = axes(canvas, { width, height }, x, y);
    picture.setAttribute("aria-label", "Similarity of each query with each map item, and the accepted answers");
    const box = { x: atX(0), y: atY(y.high), width: atX(x.high) - atX(0), height: atY(0) - atY(y.high) };
    svg("image", { ...box, href: result.similarity, preserveAspectRatio: "none", class: "matrix" }, picture);
    const accepted = result.item.flatMap((item, query) =>
      (item >= 0 && [named("right"), named("wrong")].includes(result.outcome[query]) ? [[atX(query), atY(item)]] : []));
    dots(picture, accepted, { stroke: "var(--accent)", "stroke-width": 2 });
    const line = svg("line", { y1: atY(y.high), y2: atY(0), class: "cursor" }, picture);
    plot.mark = (query) => { for (const end of ["x1", "x2"]) line.setAttribute(end, atX(query)); };
    whilePointing(picture, (at) => {
      const share = (at - atX(0)) / (atX(x.high) - atX(0));
      show(Math.round(Math.min(1, Math.max(0, share)) * (count - 1)));
    });
    if (plot.query !== undefined) plot.mark(plot.query);
  });
  return (query) => plot.mark((plot.query = query));
}

// The drive from above, north up and as wide as high a metre, coloured by error.
function routePlot(place, result, far, show) {
  const here = data.positions[result.query_xy];
  const there = data.positions[result.item_xy] || [];
  const all = [...here, ...there].filter((at) => at[0] !== null);
  const span = (axis) => all.reduce(([low, high], at) => [Math.min(low, at[axis]), Math.max(high, at[axis])], [1e18, -1e18]);
  const [west, east] = span(0);
  const [south, north] = span(1);
  const canvas = element("div", { class: "canvas" });
  const bands = ERROR_WORDS.map((name, band) => [name, `var(--e${band})`]);
  place.append(canvas, legend([...bands, ["rejected", "var(--rejected)", true], ["the map", "var(--faint)"]]));
  const accepted = (query) => result.outcome[query] === named("right") || result.outcome[query] === named("wrong");
  const band = (query) => ERROR_EDGES_M.filter((edge) => far[query] >= edge).length;
  const plot = {};
  drawn(canvas, (width) => {
    const edge = 22;
    const bar = 34;
    const scale = Math.min((width - 2 * edge) / Math.max(east - west, 1), 420 / Math.max(north - south, 1));
    const height = Math.max(90, (north - south) * scale) + 2 * edge + bar;
    const picture = svg("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label":
      "The route from above, coloured by error" });
    const at = ([x, y]) => [
      width / 2 + (x - (west + east) / 2) * scale,
      (height - bar) / 2 - (y - (south + north) / 2) * scale,
    ];
    dots(picture, there.filter((xy) => xy[0] !== null).map(at), { stroke: "var(--faint)", "stroke-width": 9 });
    const placed = here.flatMap((xy, query) => (xy[0] === null ? [] : [query]));
    const rejected = placed.filter((query) => !accepted(query) && result.outcome[query] >= 0);
    dots(picture, rejected.map((query) => at(here[query])), { stroke: "var(--rejected)", "stroke-width": 7 });
    dots(picture, rejected.map((query) => at(here[query])), { stroke: "var(--panel)", "stroke-width": 3.5 });
    // In the order of the drive, a path for each stretch of one colour: no colour lies over all others.
    const stretches = [];
    for (const query of placed.filter((one) => accepted(one) && far[one] !== null)) {
      const last = stretches.at(-1);
      if (last && last.band === band(query)) last.queries.push(query);
      else stretches.push({ band: band(query), queries: [query] });
    }
    for (const { band: number, queries } of stretches) {
      dots(picture, queries.map((query) => at(here[query])), { stroke: `var(--e${number})`, "stroke-width": 6 });
    }
    // From where the camera was to where it was taken to be.
    for (const query of placed.filter((one) => accepted(one) && far[one] !== null && far[one] >= ERROR_EDGES_M[0])) {
      const [[x1, y1], [x2, y2]] = [at(here[query]), at(there[result.item[query]])];
      svg("line", { x1, y1, x2, y2, class: "off" }, picture);
    }
    scaleBar(picture, height - 12, width, scale);
    const arrow = svg("g", { class: "north", transform: `translate(${width - 16} ${height - 34})` }, picture);
    svg("path", { d: "M0 0l6 16-6-4-6 4z" }, arrow);
    svg("text", { x: 0, y: 28, "text-anchor": "middle" }, arrow, "N");
    const link = svg("line", { class: "cursor" }, picture);
    const dot = svg("circle", { r: 7, class: "cursor" }, picture);
    canvas.replaceChildren(picture);
    plot.mark = (query) => {
      const shown = here[query][0] !== null;
      dot.setAttribute("visibility", shown ? "visible" : "hidden");
      link.setAttribute("visibility", shown && far[query] !== null ? "visible" : "hidden");
      if (!shown) return;
      const [x, y] = at(here[query]);
      const [x2, y2] = far[query] === null ? [x, y] : at(there[result.item[query]]);
      for (const [key, value] of Object.entries({ x1: x, y1: y, x2, y2 })) link.setAttribute(key, value);
      dot.setAttribute("cx", x);
      dot.setAttribute("cy", y);
    };
    whilePointing(picture, (x, y) => {
      const off = placed.map((query) => Math.hypot(at(here[query])[0] - x, at(here[query])[1] - y));
      const nearest = off.reduce((best, value, index) => (value < off[best] ? index : best), 0);
      if (off[nearest] < 30) show(placed[nearest]);
    });
    if (plot.query !== undefined) plot.mark(plot.query);
  });
  return (query) => plot.mark((plot.query = query));
}

function scaleBar(picture, y, width, scale) {
  const metres = niceStep(width / 4 / scale, 1.999);
  const end = 22 + metres * scale;
  svg("path", { d: `M22 ${y - 5}v5H${end}v-5`, class: "scale" }, picture);
  svg("text", { x: end + 8, y }, picture, metres >= 1000 ? `${metres / 1000} km` : `${short(metres)} m`);
}

function samples(result) {
  const place = element("div", { class: "samples" });
  for (const [query, sources] of result.samples) {
    const kind = data.outcomes[result.outcome[query]];
    const row = element("figure", { class: kind });
    sources.forEach((source, column) => {
      const item = [null, result.item[query], result.true ? result.true[query] : null][column];
      const words = SAMPLE_WORDS[column] + (column ? (item === null || item < 0 ? ": none" : ` ${item}`) : ` ${query}`);
      const image = source ? element("img", { src: source, alt: words }) : element("span", { class: "none" });
      row.append(element("div", {}, image, element("small", {}, words)));
    });
    row.append(element("figcaption", {}, WORDS[kind]));
    place.append(row);
  }
  return place;
}

function pairs(values) {
  const list = element("dl", {});
  for (const [key, value] of Object.entries(values)) {
    const text = typeof value === "string" ? value : JSON.stringify(value);
    list.append(element("dt", {}, key), element("dd", {}, text));
  }
  return list;
}

function figures(result) {
  const shown = [["accuracy", "accuracy"], ["accuracy_seen", "on seen queries"], ["rejection_rate", "rejected"],
    ["precision", "precision"], ["recall", "recall"], ["chance", "chance"]];
  const tiles = shown.map(([key, name]) =>
    element("div", { class: "tile" }, element("strong", {}, percent(result.figures[key])), element("span", {}, name)));
  const tile = (value, words) => element("div", { class: "tile" }, element("strong", {}, value), element("span", {}, words));
  const count = result.item.length;
  const took = result.took_s === null ? [] : [tile(`${short((1000 * result.took_s) / count)} ms`, "an image, all in all")];
  return element("div", { class: "tiles small" }, tile(result.answers, "answers"), ...tiles, ...took);
}

const NOTHING = "No answer was accepted: the method stood by none of them. Either the drive is not on the map, or its " +
  "images differ too much from the map's; answers with a lag (--lag-s 2), a higher --false-accept, or evplace doctor may help.";
const nothingAccepted = (result) =>
  !result.outcome.some((kind) => kind === named("right") || kind === named("wrong"));

function panel(title, kind, fill) {
  const place = element("div", { class: `panel ${kind}` }, element("h3", {}, title));
  return [place, () => fill(place)];
}

// Everything about one result. Parts go into the page before they are drawn, because a plot needs its width.
function look(place, result) {
  const count = result.item.length;
  const far = errors(result);
  const slider = element("input", { type: "range", min: 0, max: count - 1, value: 0, "aria-label": "Query" });
  const readout = element("output", { "aria-live": "polite" });
  const marks = [];
  const show = (query) => {
    slider.value = query;
    for (const mark of marks) mark(query);
    const item = result.item[query] < 0 ? "no item" : `item ${result.item[query]}`;
    const kind = data.outcomes[result.outcome[query]];
    const off = far[query] === null ? "" : `, ${far[query].toFixed(0)} m off`;
    readout.textContent = `Query ${query}: ${item}, ${kind ? WORDS[kind] : "not judged"}${off}`;
  };
  slider.addEventListener("input", () => show(Number(slider.value)));
  const parts = [
    panel("Along the drive", "wide", (inside) => marks.push(itemsPlot(inside, result, show))),
    result.query_xy === null ? null
      : panel("From above: how far off", "", (inside) => marks.push(routePlot(inside, result, far, show))),
    result.similarity ? panel("Similarity, and the path", "", (inside) => marks.push(similarityPlot(inside, result, show))) : null,
    panel("Precision and recall", "", (inside) => curvePlot(inside, { title: result.name, lines: [result.curve] })),
  ].filter((part) => part !== null);
  const took = result.took_s === null ? "" : `, ${short(result.took_s)} s`;
  const details = element("details", { open: "" }, element("summary", {}, `Settings, versions and all figures${took}`),
    element("h3", {}, "Figures"), pairs(result.figures), element("h3", {}, "Settings"), pairs(result.settings),
    element("h3", {}, "Versions"), pairs(result.versions));
  place.replaceChildren(
    figures(result),
    ...(nothingAccepted(result) ? [element("p", { class: "remark" }, NOTHING)] : []),
    element("div", { class: "along" }, slider, readout),
    element("div", { class: "grid-2" }, ...parts.map(([made]) => made)),
    ...(result.samples.length ? [element("h3", {}, "Sample matches"), samples(result)] : []),
    details,
  );
  for (const [, fill] of parts) fill();
  show(0);
}

function closerLook(place) {
  const select = element("select", { id: "which" });
  for (const result of data.results) select.append(element("option", {}, result.name));
  const inside = element("div", { id: "looked-at" });
  place.append(element("label", { for: "which" }, "Result "), select, inside);
  select.addEventListener("change", () => look(inside, data.results[select.selectedIndex]));
  select.selectedIndex = data.best;
  look(inside, data.results[data.best]);
}

ruleSwitch();
const place = document.getElementById("panels");
for (const one of place ? data.panels : []) {
  const made = element("div", { class: "panel" }, element("h3", {}, one.title));
  place.append(made);
  curvePlot(made, one);
}
if (data.results.length) closerLook(document.getElementById("look-at"));
