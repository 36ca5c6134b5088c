// The hand's page: each finger's newest sample as a picture of its tip, and the chosen one's last ten seconds.
//
// - All that is drawn came over the link: mm in the tip's frame, x right and y down as in the camera's image.
// - A finger's colour of touch is its contact's; how deep the skin is pressed in tints the whole tip.

import { Chart, Line, arrow, chartCanvas, fit, keys, number, remember, rgb, scheduler, showFaults, showState, toast } from "./kit.js";

const $ = (id) => document.getElementById(id);
const SHEAR_GAIN = 3; // a shear of 1 mm is a firm one; a tip is 10 mm and more in radius
const TIP_MM = 10;
const DEPTH_FULL_MM = 4;
// The edge's two palettes (edge/view/palette.py), as far as this page has the same marks.
const PALETTES = {
  paper: { compressed: [214, 30, 38], contact: [10, 30, 200], shear: [0, 0, 0], halo: [255, 255, 255] },
  safe: { compressed: [230, 140, 0], contact: [0, 110, 90], shear: [0, 0, 0], halo: [255, 255, 255] },
};
// Charts of values come from the table of fields, in `hello`; these are what a page knows besides.
const CHARTS = [
  { title: "Rate", unit: "Hz", least: 50, of: null },
  { title: "Latency to this host", unit: "ms", least: 2, of: ["latency_ms"] },
];
const VALUES = [
  ["depth", "mm", (s) => number(s.displacement_mm, 2)],
  ["shear", "mm", (s) => (s.shear_x_mm === null ? "–" : number(Math.hypot(s.shear_x_mm, s.shear_y_mm), 2))],
  ["force", "N", (s) => number(s.force_n, 2)],
  ["tangential", "N", (s) => (s.force_x_n === null ? "–" : number(Math.hypot(s.force_x_n, s.force_y_n), 2))],
];

let hello = null;
let may = [];
let packet = null;
let clock = null;
let chosen = null;
let palette = remember("palette") === "safe" ? "safe" : "paper";
const cards = new Map(); // node -> {box, canvas, ...}
const series = new Map(); // node -> {seen, charts}

let rows = CHARTS; // all charts
let charts = []; // their canvases

function makeCharts() {
  $("charts").replaceChildren();
  rows = [...hello.charts, ...CHARTS];
  charts = rows.map(chartCanvas);
}

function seriesOf(node) {
  if (!series.has(node))
    series.set(node, { seen: 0, charts: rows.map((what, i) => new Chart(charts[i], what)) });
  return series.get(node);
}

function takeRows(finger) {
  const mine = seriesOf(finger.node);
  const width = hello.chart.length;
  const values = packet.arrays[`rows${finger.node}`];
  const n = values.length / width;
  const first = finger.rows_n - n;
  for (let i = Math.max(0, mine.seen - first); i < n; i++)
    rows.forEach(({ of }, k) => {
      if (of) mine.charts[k].add(packet.now_s + values[i * width], of.map((name) => values[i * width + hello.chart.indexOf(name)]));
    });
  mine.seen = finger.rows_n;
  rows.forEach(({ of }, k) => of || mine.charts[k].add(packet.now_s, [finger.rate_hz]));
}

// ---- fingers ----------------------------------------------------------------------------------------------

function choose(node) {
  chosen = node;
  for (const [n, card] of cards) card.box.ariaPressed = String(n === node);
  $("whose").textContent = node === null ? "" : `Last ten seconds of ${nameOf(node)} ${node}`;
  schedule();
}

function nameOf(node) {
  return hello.names[node] ?? "finger";
}

function makeCards() {
  const nodes = packet.fingers.map((f) => f.node);
  const shown = nodes.join();
  if ($("hand").dataset.shown === shown) return;
  $("hand").dataset.shown = shown;
  $("none").hidden = nodes.length > 0;
  $("next").disabled = nodes.length < 2;
  for (const box of document.querySelectorAll(".finger")) box.remove();
  cards.clear();
  const asHand = nodes.filter((n) => hello.hand.includes(n)).length > 1;
  const places = asHand ? [...hello.hand, ...nodes.filter((n) => !hello.hand.includes(n))] : nodes;
  $("hand").className = places.length > 5 ? "crowd" : asHand ? "many" : nodes.length === 1 ? "one" : "";
  if (hello.left && asHand) places.splice(0, hello.hand.length, ...hello.hand.toReversed());
  for (const node of places) {
    const box = document.createElement("button");
    box.type = "button";
    box.className = `finger place${hello.hand.indexOf(node)}`;
    if (!nodes.includes(node)) {
      box.classList.add("absent");
      box.disabled = true;
      box.innerHTML = `<h2>${nameOf(node)} ${node}</h2><p>not heard</p>`;
      $("hand").append(box);
      continue;
    }
    box.innerHTML =
      `<h2><span title="${nameOf(node)} ${node}">${nameOf(node)} <small>${node}</small></span><small class="rate"></small></h2><canvas></canvas><dl>` +
      VALUES.map(([name, unit]) => `<dt>${name}</dt><dd></dd><dd class="unit">${unit}</dd>`).join("") +
      `</dl><p></p>`;
    box.onclick = () => choose(node);
    $("hand").append(box);
    const values = box.querySelectorAll("dd:not(.unit)");
    cards.set(node, { box, canvas: box.querySelector("canvas"), values, message: box.querySelector("p") });
  }
  if (!cards.has(chosen)) choose(cards.keys().next().value ?? null);
}

function showFinger(finger) {
  const card = cards.get(finger.node);
  const state = finger.state;
  card.values.forEach((cell, i) => (cell.textContent = state ? VALUES[i][2](state) : "–"));
  card.box.querySelector(".rate").textContent = `${number(finger.rate_hz, 0)} Hz`;
  const parts = [state ? "" : "no samples", finger.message, finger.lost_n ? `${finger.lost_n} lost` : ""];
  card.message.textContent = parts.filter(Boolean).join("; ");
}

function drawTip(canvas, state) {
  const { g, width } = fit(canvas);
  const colours = PALETTES[palette];
  const far = Math.max(TIP_MM, ...(state?.contacts ?? []).map((c) => Math.hypot(c.x_mm, c.y_mm) + 2));
  const scale = (width / 2 - 3) / far;
  const at = (mm) => width / 2 + mm * scale;
  const depth = Math.min(1, Math.max(0, (state?.displacement_mm ?? 0) / DEPTH_FULL_MM));
  g.beginPath();
  g.arc(width / 2, width / 2, far * scale, 0, 7);
  g.fillStyle = rgb(colours.compressed, 0.3 * depth);
  g.fill();
  g.strokeStyle = "#c7ccd2";
  g.lineWidth = 1;
  for (let r = 5; r <= far; r += 5) {
    g.beginPath();
    g.arc(width / 2, width / 2, r * scale, 0, 7);
    g.stroke();
  }
  g.beginPath();
  for (const [dx, dy] of [[1, 0], [0, 1]]) {
    g.moveTo(at(-0.6 * dx), at(-0.6 * dy));
    g.lineTo(at(0.6 * dx), at(0.6 * dy));
  }
  g.stroke();
  if (!state) return;
  for (const contact of state.contacts) {
    const [x, y] = [at(contact.x_mm), at(contact.y_mm)];
    g.beginPath();
    g.arc(x, y, (0.8 + 0.6 * Math.min(3, contact.depth_mm ?? 0)) * scale, 0, 7);
    g.fillStyle = rgb(colours.compressed, 0.9);
    g.fill();
  }
  const first = state.contacts[0];
  if (state.orientation_deg !== null && first) {
    const angle = (state.orientation_deg * Math.PI) / 180;
    const [dx, dy] = [0.45 * far * Math.cos(angle), 0.45 * far * Math.sin(angle)];
    g.strokeStyle = rgb(colours.contact);
    g.lineWidth = 2.5;
    g.setLineDash([6, 4]);
    g.beginPath();
    g.moveTo(at(first.x_mm - dx), at(first.y_mm - dy));
    g.lineTo(at(first.x_mm + dx), at(first.y_mm + dy));
    g.stroke();
    g.setLineDash([]);
  }
  if (state.shear_x_mm !== null && state.shear_y_mm !== null) {
    const [x, y] = first ? [first.x_mm, first.y_mm] : [0, 0];
    const [dx, dy] = [SHEAR_GAIN * state.shear_x_mm, SHEAR_GAIN * state.shear_y_mm];
    if (Math.hypot(dx, dy) > 0.1)
      arrow(g, at(x), at(y), at(x + dx), at(y + dy), Math.max(3, width / 55), rgb(colours.shear), rgb(colours.halo));
  }
}

function draw() {
  if (!packet) return;
  for (const finger of packet.fingers) drawTip(cards.get(finger.node).canvas, finger.state);
  const now = line.state === "live" ? clock.server + (performance.now() - clock.here) / 1000 : clock.server;
  if (chosen !== null) for (const chart of seriesOf(chosen).charts) chart.draw(now);
}

const schedule = scheduler(draw);

function showColours() {
  const colours = PALETTES[palette];
  for (const name of ["compressed", "contact", "shear"]) document.body.style.setProperty(`--${name}`, rgb(colours[name]));
  document.body.style.setProperty("--tint", rgb(colours.compressed, 0.3));
  $("safe").ariaPressed = String(palette === "safe");
}

// ---- the line -----------------------------------------------------------------------------------------------

const line = new Line({
  state(state, message) {
    showState(state, message);
    if (state !== "live") schedule();
  },
  hello(said, allowed) {
    [hello, may] = [said, allowed];
    series.clear();
    makeCharts();
    $("source").textContent = said.address;
    document.title = `${said.address} – voronoi-touch`;
    $("tare").disabled = !may.includes("tare");
    $("tare").title = may.includes("tare") ? "" : "read-only: open the page with its token (--token)";
  },
  packet(fresh) {
    if ($("hold").ariaPressed === "true" && packet) return;
    packet = fresh;
    clock = { server: fresh.now_s, here: performance.now() };
    makeCards();
    for (const finger of fresh.fingers) {
      takeRows(finger);
      showFinger(finger);
    }
    showFaults(fresh.faults);
    document.body.dataset.packets = Number(document.body.dataset.packets ?? 0) + 1;
    schedule();
  },
  answer({ did, ok, message }) {
    toast(message, ok, did === "tare" && !ok ? ["Tare anyway", () => line.do("tare", { finger: chosen, force: true })] : null);
  },
});

$("tare").onclick = () => chosen !== null && line.do("tare", { finger: chosen });
$("next").onclick = () => {
  const nodes = [...cards.keys()];
  if (nodes.length) choose(nodes[(nodes.indexOf(chosen) + 1) % nodes.length]);
};
$("safe").onclick = () => {
  palette = palette === "safe" ? "paper" : "safe";
  remember("palette", palette);
  showColours();
  schedule();
};
$("hold").onclick = () => ($("hold").ariaPressed = String($("hold").ariaPressed !== "true"));
addEventListener("resize", schedule);
showColours();
keys();
