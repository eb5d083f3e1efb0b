// The page: listens to the service, and draws what it says. Nothing is asked of any other machine.

const $ = (id) => document.getElementById(id);
const TOKEN = new URLSearchParams(location.search).get("token");
const SPAN_US = 30e6; // what the history and the trail show
const AGAIN_MS = [300, 600, 1200, 2500, 5000]; // until the next try to connect
const STATES = ["localised", "standing", "ambiguous", "unseen", "lost", "no-events"];
const SURE = ["localised", "standing"];
const WINDS = ["north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"];

let map = null; // the route, once it is known
let match = null; // the last match
let recent = []; // {t_us, state, probability, easting, northing, item}
let tries = 0;
let dirty = true; // whether something is to be drawn

function address(path, scheme = location.protocol) {
  const at = new URL(path, location.href);
  at.protocol = scheme;
  if (TOKEN) at.searchParams.set("token", TOKEN);
  return at;
}

async function json(path) {
  const answer = await fetch(address(path));
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

// Words

function words(m) {
  const place = m.place === null ? "an unknown place" : `place ${m.place}`;
  return {
    localised: `At ${place}`,
    standing: `Standing at ${place}`,
    ambiguous: `Perhaps at ${place}`,
    unseen: "Not on the map",
    lost: "Lost, looking everywhere",
    "no-events": "No events come",
  }[m.state];
}

function explained(m) {
  const parts = [];
  if (m.item !== null && m.state !== "no-events" && map && map.along[m.item] !== null) {
    parts.push(`${Math.round(map.along[m.item])} m along the route`);
  }
  if (m.probability !== null) parts.push(m.probability > 0.999 ? "more than 99.9 % sure" : `${percent(m.probability)} sure`);
  if (m.last && !SURE.includes(m.state)) parts.push(`last at place ${m.last.place}`);
  if (m.state === "no-events" && m.silent_s >= 1) parts.push(`none for ${m.silent_s.toFixed(0)} s`);
  return parts.join(" · ");
}

const percent = (share) => `${(100 * share).toFixed(share > 0.995 && share < 1 ? 1 : 0)} %`;
const number = (value, digits, unit) => (value === null ? "–" : `${value.toFixed(digits)}${unit}`);
const wind = (degrees) => `${Math.round(degrees)}° ${WINDS[Math.round(degrees / 45) % 8]}`;

function short(value) {
  if (value >= 1e9) return `${(value / 1e9).toFixed(2)} G`;
  if (value >= 1e6) return `${(value / 1e6).toFixed(2)} M`;
  return value >= 1e4 ? `${(value / 1e3).toFixed(0)} k` : `${value}`;
}

function say(m) {
  document.body.dataset.state = m.state;
  $("badge").textContent = m.state === "no-events" ? "no events" : m.state;
  $("words").textContent = words(m);
  $("more").textContent = explained(m);
  $("geodetic").textContent =
    m.latitude === null ? "–" : `${m.latitude.toFixed(6)}, ${m.longitude.toFixed(6)}`;
  $("utm").textContent = m.easting === null ? "–" : `${m.easting.toFixed(1)}, ${m.northing.toFixed(1)} m`;
  $("utm-name").textContent = m.epsg ? `Easting, northing (EPSG ${m.epsg})` : "Easting, northing";
  $("heading").textContent = m.heading_deg === null ? "–" : wind(m.heading_deg);
  $("uncertainty").textContent = m.uncertainty_m === null ? "–" : `± ${m.uncertainty_m.toFixed(1)} m`;
  $("latency").textContent = number(m.latency_ms, 1, " ms");
  $("rate").textContent = short(m.rate);
  for (const name of ["backlog", "skipped", "overflows", "recorded"]) $(name).textContent = short(m[name]);
  for (const tile of document.querySelectorAll("[data-warn]")) tile.classList.toggle("warn", m[tile.dataset.warn] > 0);
}

let spokenAt = -Infinity;
let spoken = "";
function speak(m) {
  const now = performance.now();
  const text = `${words(m)}. ${explained(m)}`;
  const changed = words(m) !== spoken;
  if (!changed || now < spokenAt + 2000) return; // a screen reader must be able to follow
  [spokenAt, spoken] = [now, words(m)];
  $("spoken").textContent = text;
}

// Pictures

let shownItem = null;
function showReference(m) {
  const item = m.state === "no-events" ? shownItem : m.item;
  if (item === shownItem) return;
  shownItem = item;
  const image = $("reference");
  const has = item !== null && map && map.has_images;
  $("reference-name").textContent = item === null ? "" : m.place === null ? `· image ${item}` : `· place ${m.place}`;
  $("no-reference").textContent = map && !map.has_images ? "this map keeps no images" : "no match";
  $("no-reference").hidden = has;
  image.hidden = !has;
  if (!has) return;
  image.alt = `The map's image ${item}`;
  image.src = address(`reference/${item}.png`);
}

function showPicture(data) {
  const view = new DataView(data);
  const [width, height] = [view.getUint16(8, true), view.getUint16(10, true)];
  const grey = new Uint8Array(data, 12);
  const canvas = $("now");
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  for (let at = 0; at < grey.length; at++) {
    image.data.fill(grey[at], 4 * at, 4 * at + 3);
    image.data[4 * at + 3] = 255;
  }
  context.putImageData(image, 0, 0);
}

// Drawing

let colours = {};
function readColours() {
  const style = getComputedStyle(document.body);
  const names = ["ink", "soft", "line", "track", "panel", "page", "waiting", ...STATES];
  colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  dirty = true;
}

function fresh(canvas) {
  const scale = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  return { context, width, height };
}

function disc(context, [x, y], radius, fill, stroke = null, line = 2) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) Object.assign(context, { fillStyle: fill }), context.fill();
  if (stroke) Object.assign(context, { strokeStyle: stroke, lineWidth: line }), context.stroke();
}

function prepared(route) {
  const known = [...route.items, ...route.drive].filter((at) => at);
  if (!known.length) return { ...route, box: null, along: route.items.map(() => null) };
  const box = [0, 1].map((axis) => {
    const values = known.map((at) => at[axis]);
    return [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  });
  let [metres, last] = [0, null];
  const along = route.items.map((at) => {
    if (!at) return null;
    const step = last ? Math.hypot(at[0] - last[0], at[1] - last[1]) : 0;
    metres += step < 50 ? step : 0;
    last = at;
    return metres;
  });
  return { ...route, box, along };
}

function projection(width, height) {
  const [[west, east], [south, north]] = map.box;
  const rest = 34;
  const scale = Math.min((width - 2 * rest) / Math.max(east - west, 20), (height - 2 * rest) / Math.max(north - south, 20));
  const at = ([x, y]) => [
    width / 2 + (x - (west + east) / 2) * scale,
    height / 2 - (y - (south + north) / 2) * scale,
  ];
  return { at, scale };
}

function drawRoute() {
  const { context, width, height } = fresh($("route"));
  if (!map || !map.box) {
    Object.assign(context, { fillStyle: colours.soft });
    context.fillText(map ? "This map has no positions." : "", 12, 24);
    return;
  }
  const { at, scale } = projection(width, height);
  drawWay(context, at);
  drawScale(context, width, height, scale);
  drawTrail(context, at);
  if (match && match.easting !== null) drawBelief(context, at, scale);
  else if (match && match.last && match.last.easting !== null) {
    disc(context, at([match.last.easting, match.last.northing]), 8, colours.panel, colours["no-events"], 3);
  }
}

function drawWay(context, at) {
  const way = map.drive.some((point) => point) ? map.drive : map.items;
  Object.assign(context, { strokeStyle: colours.track, lineWidth: 5, lineJoin: "round", lineCap: "round" });
  context.beginPath();
  let last = null;
  for (const point of way) {
    if (point && last && Math.hypot(point[0] - last[0], point[1] - last[1]) < 50) context.lineTo(...at(point));
    else if (point) context.moveTo(...at(point));
    last = point;
  }
  context.stroke();
  const ends = [way.find((point) => point), way.findLast((point) => point)];
  for (const point of ends) if (point) disc(context, at(point), 5, colours.panel, colours.track, 3);
}

function drawTrail(context, at) {
  const until = recent.length ? recent[recent.length - 1].t_us : 0;
  for (const past of recent) {
    const age = (until - past.t_us) / SPAN_US;
    if (past.easting === null || age > 1 || !SURE.includes(past.state)) continue;
    context.globalAlpha = 0.65 * (1 - age);
    disc(context, at([past.easting, past.northing]), 3.5, colours[past.state]);
  }
  context.globalAlpha = 1;
}

function drawBelief(context, at, scale) {
  const here = at([match.easting, match.northing]);
  const colour = colours[match.state] || colours.waiting;
  if (match.uncertainty_m !== null) {
    context.globalAlpha = 0.22;
    disc(context, here, Math.max(match.uncertainty_m * scale, 9), colour);
    context.globalAlpha = 1;
  }
  for (const other of match.others) {
    if (other.easting !== null) disc(context, at([other.easting, other.northing]), 5, colours.panel, colour);
  }
  if (match.heading_deg !== null) drawHeading(context, here, match.heading_deg, colour);
  disc(context, here, 8, colour, colours.panel, 3);
}

function drawHeading(context, [x, y], degrees, colour) {
  const turn = ((degrees - 90) * Math.PI) / 180;
  const point = (angle, radius) => [x + radius * Math.cos(turn + angle), y + radius * Math.sin(turn + angle)];
  context.beginPath();
  context.moveTo(...point(0, 22));
  context.lineTo(...point(0.75, 8));
  context.lineTo(...point(-0.75, 8));
  context.closePath();
  Object.assign(context, { fillStyle: colour });
  context.fill();
}

function drawScale(context, width, height, scale) {
  const metres = [1000, 500, 200, 100, 50, 20, 10, 5].find((length) => length * scale < width / 4) || 5;
  Object.assign(context, { strokeStyle: colours.soft, fillStyle: colours.soft, lineWidth: 1.5 });
  const [x, y] = [12.5, height - 10.5];
  context.beginPath();
  context.moveTo(x, y - 5);
  context.lineTo(x, y);
  context.lineTo(x + metres * scale, y);
  context.lineTo(x + metres * scale, y - 5);
  context.stroke();
  context.fillText(`${metres} m`, x + 6, y - 5);
  context.beginPath();
  context.moveTo(width - 18, 12);
  context.lineTo(width - 12, 28);
  context.lineTo(width - 18, 24);
  context.lineTo(width - 24, 28);
  context.closePath();
  context.fill();
  context.fillText("N", width - 22, 42);
}

function drawHistory() {
  const { context, width, height } = fresh($("history"));
  const any = recent.some((past) => past.probability !== null);
  const [left, bottom, top] = [any ? 46 : 0, height - 20, 8];
  $("history-name").textContent = any ? "Probability" : "State";
  Object.assign(context, { strokeStyle: colours.line, fillStyle: colours.soft, lineWidth: 1, textAlign: "right" });
  for (const share of any ? [0, 0.5, 1] : []) {
    const y = Math.round(bottom - share * (bottom - top)) + 0.5;
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(width, y);
    context.stroke();
    context.fillText(`${100 * share} %`, left - 6, y + 4);
  }
  context.textAlign = "left";
  context.fillText("30 s ago", left, height - 4);
  context.textAlign = "right";
  context.fillText("now", width - 2, height - 4);
  context.textAlign = "left";
  drawBars(context, left, width, bottom, top, any);
}

function drawBars(context, left, width, bottom, top, any) {
  if (!recent.length) return;
  const until = recent[recent.length - 1].t_us;
  const x = (t_us) => width - ((until - t_us) / SPAN_US) * (width - left);
  for (const [n, past] of recent.entries()) {
    const start = x(past.t_us);
    if (start < left) continue;
    const next = n + 1 < recent.length ? Math.min(x(recent[n + 1].t_us), start + 12) : start + 3;
    const share = past.probability ?? (any ? 0 : 1);
    const tall = Math.max(share * (bottom - top), 3);
    context.fillStyle = colours[past.state] || colours.waiting;
    context.fillRect(start, bottom - tall, Math.max(next - start, 1) + 0.5, tall);
  }
}

function describe() {
  if (!match || !map) return;
  const where = match.easting === null ? "no believed place" : `${words(match)}, ${explained(match)}`;
  $("route").setAttribute("aria-label", `The route from above: ${where}; ${match.others.length} runners-up`);
  const now = match.probability === null ? match.state : percent(match.probability);
  $("history").setAttribute("aria-label", `Probability over the last half minute, now ${now}`);
}

function draw() {
  if (dirty) {
    dirty = false;
    drawRoute();
    drawHistory();
  }
  requestAnimationFrame(draw);
}

// Listening

function take(values) {
  match = values;
  const { t_us, state, probability, easting, northing, item } = values;
  if (recent.length && t_us < recent[recent.length - 1].t_us) recent = []; // times begin anew
  recent.push({ t_us, state, probability, easting, northing, item });
  while (recent[0].t_us < t_us - SPAN_US) recent.shift();
  say(values);
  speak(values);
  showReference(values);
  dirty = true;
}

function link(state, text) {
  $("link").dataset.link = state;
  $("link-words").textContent = text;
}

async function begin() {
  map = prepared(await json("map.json"));
  $("map-name").textContent = map.name;
  recent = (await json("recent")).map(([t_us, state, probability, easting, northing, item]) => ({
    t_us, state, probability, easting, northing, item,
  }));
  const from = recent.findLastIndex((past, n) => n && past.t_us < recent[n - 1].t_us);
  recent = recent.slice(Math.max(from, 0));
  const state = await json("state");
  if (state.match) take(state.match);
  showState(state);
}

function listen() {
  const live = new WebSocket(address("live", location.protocol.replace("http", "ws")));
  const pictures = new WebSocket(address("pictures", location.protocol.replace("http", "ws")));
  pictures.binaryType = "arraybuffer";
  pictures.onmessage = (message) => showPicture(message.data);
  live.onmessage = (message) => take(JSON.parse(message.data));
  live.onopen = () => {
    tries = 0;
    link("live", "live");
  };
  live.onclose = () => {
    pictures.close();
    again();
  };
}

function again() {
  link("lost", "connection lost, trying again");
  setTimeout(connect, AGAIN_MS[Math.min(tries++, AGAIN_MS.length - 1)]);
}

async function connect() {
  try {
    await begin();
  } catch {
    again();
    return;
  }
  listen();
}

function showState(state) {
  const { source, recording, map: of } = state;
  $("source-name").textContent = source.name.split("/").pop();
  const said = { live: "live", silent: `silent for ${source.silent_s.toFixed(0)} s`, paused: "paused", ended: "ended" };
  link(source.state, said[source.state]);
  const replay = source.replay;
  $("replay").hidden = !replay || !replay.can_change;
  if (replay) {
    $("played").textContent = `${replay.at_s.toFixed(1)} s${replay.loop > 1 ? `, round ${replay.loop}` : ""}`;
    $("pause").setAttribute("aria-pressed", replay.paused);
    $("pause").textContent = replay.paused ? "Go on" : "Pause";
    if (document.activeElement !== $("speed")) $("speed").value = String(replay.speed);
  }
  const remarks = [source.fault, recording && recording.fault, of.replaced && "Another map lies there by now: start the service again to use it."];
  const remark = remarks.filter(Boolean).join(" · ");
  if ($("remark").textContent !== remark) $("remark").textContent = remark;
  $("remark").hidden = !remark;
}

async function lookAtState() {
  try {
    if ($("link").dataset.link !== "lost" && map) showState(await json("state"));
  } catch {
    // the socket says that the connection is lost
  }
  describe();
  setTimeout(lookAtState, 1000);
}

async function control(values) {
  try {
    const body = JSON.stringify(values);
    await fetch(address("replay"), { method: "POST", headers: { "Content-Type": "application/json" }, body });
    showState(await json("state"));
  } catch {
    // the socket says that the connection is lost
  }
}

$("pause").addEventListener("click", () => control({ paused: $("pause").getAttribute("aria-pressed") !== "true" }));
$("back").addEventListener("click", () => control({ by_s: -10 }));
$("on").addEventListener("click", () => control({ by_s: 10 }));
$("speed").addEventListener("change", () => control({ speed: Number($("speed").value) }));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
new ResizeObserver(() => (dirty = true)).observe($("route"));
addEventListener("resize", () => (dirty = true));

readColours();
connect();
lookAtState();
requestAnimationFrame(draw);
