// The finger's page: what was felt, what was seen, and how both went over the last ten seconds.
//
// - The server sends pins and triangles; cells are made here: corners are the triangles' circumcentres, in the
//   order of their angle about the pin.
// - Places are px of the camera's image, pixel centres on integers; `square` is the part of it that both panels
//   show, so that one can be compared with the other.

import { Chart, Line, arrow, chartCanvas, fit, keys, number, remember, rgb, scheduler, showFaults, showState, toast } from "./kit.js";

const $ = (id) => document.getElementById(id);
const RING = "#ffc800";

let hello = null;
let may = [];
let scene = null; // the packet on the screen, with `bitmap`
let rowsSeen = 0;
let clock = null; // the server's clock and ours at the newest packet
let tares = null;
let palette = remember("palette") === "safe" ? "safe" : "paper";

// ---- numbers and charts: what, where from, how it is shown ------------------------------------------------

/** Longest of vectors of n parts; null where nothing is known. */
function largest(values, n = 1) {
  let most = -1;
  for (let i = 0; i < (values?.length ?? 0); i += n) {
    const length = n === 1 ? values[i] : Math.hypot(values[i], values[i + 1]);
    if (length > most) most = length; // not of NaN
  }
  return most < 0 ? null : most;
}

/** What is shown without a calibration alone. */
const raw = (value, digits) => (p) => [p.calibrated ? null : value(p) ?? null, digits];

// The table of fields is in `hello`; a page knows these besides.
const NUMBERS = [
  ["Largest area change", "%", raw((p) => p.arrays.change && 100 * largest(p.arrays.change), 0)],
  ["Largest pin motion", "px", raw((p) => largest(p.arrays.motion, 2), 2)],
  ["Mean motion x", "px", raw((p) => p.shear_px?.[0], 2)],
  ["Mean motion y", "px", raw((p) => p.shear_px?.[1], 2)],
  ["Contacts", "", (p) => [p.contacts?.length ?? null, 0]],
  ["Pins held", "", (p) => [p.held_n ?? null, 0, null, p.pins_n ? `of ${p.pins_n}` : ""]],
  ["Rate", "Hz", (p) => [p.rate_hz, 0]],
  ["Latency", "ms", (p) => [p.values?.latency_us == null ? null : p.values.latency_us / 1000, 1]],
];
const CHARTS = [
  { title: "Rate", unit: "Hz", least: 50, of: null },
  { title: "Latency", unit: "ms", least: 2, of: ["latency_ms"] },
];
// Without a calibration there are no millimetres; then the same is shown in the camera's own px.
const RAW = {
  Displacement: { title: "Volume of deformation", unit: "px²", least: 100, of: ["volume_px2"] },
  Shear: { title: "Mean motion of the pins", unit: "px", least: 1, names: ["x", "y"], of: ["shear_x_px", "shear_y_px"] },
}; // prettier-ignore

/** A row of the table of fields as a row of NUMBERS. */
function numberOf({ name, unit, of, sigma, factor, digits }) {
  const read = ({ values }) => [values?.[of] == null ? null : factor * values[of], digits, sigma && values?.[sigma]];
  return [name, unit, read];
}

let numbers = NUMBERS;

function makeNumbers() {
  numbers = [...hello.numbers.map(numberOf), ...NUMBERS];
  $("numbers").replaceChildren();
  for (const [name, unit] of numbers) {
    const box = document.createElement("div");
    box.hidden = true; // until there is a value
    box.innerHTML = `<dt>${name}<small class="unit">${unit}</small></dt><dd><span></span><small class="unit"></small></dd>`;
    $("numbers").append(box);
  }
}

function showNumbers(packet) {
  numbers.forEach(([, , read], i) => {
    const [value, digits, sigma, after] = read(packet);
    const box = $("numbers").children[i];
    if (Number.isFinite(value)) box.hidden = false;
    box.querySelector("span").textContent = number(value, digits);
    box.querySelector("dd small").textContent =
      after || (Number.isFinite(sigma) && Number.isFinite(value) ? `±${number(sigma, digits)}` : "");
  });
}

let charts = [];

function makeCharts(calibrated) {
  $("charts").replaceChildren();
  charts = [...hello.charts, ...CHARTS].map((row) => {
    const what = (!calibrated && RAW[row.title]) || row;
    return { ...what, chart: new Chart(chartCanvas(what), what) };
  });
  charts.calibrated = calibrated;
}

/** Rows come with some of the last packet's again: those that are known are skipped by their number. */
function takeRows(packet) {
  if (charts.calibrated !== packet.calibrated) {
    makeCharts(packet.calibrated);
    makeNumbers();
  }
  const width = hello.chart.length;
  const rows = packet.arrays.rows;
  const n = rows.length / width;
  const first = packet.rows_n - n;
  for (let i = Math.max(0, rowsSeen - first); i < n; i++) {
    const time = packet.now_s + rows[i * width];
    for (const { chart, of } of charts)
      if (of) chart.add(time, of.map((name) => rows[i * width + hello.chart.indexOf(name)]));
  }
  rowsSeen = packet.rows_n;
  for (const { chart, of } of charts) if (!of) chart.add(packet.now_s, [packet.rate_hz]);
}

// ---- panels ---------------------------------------------------------------------------------------------

/** Where a packet's square lies on a canvas: px of the image to CSS px. */
function placer(packet, width) {
  const [w, h] = packet.size_px ?? [640, 480];
  const side = Math.max(w, h);
  const [x0, y0, size] = packet.square ?? [(w - side) / 2 - 0.5, (h - side) / 2 - 0.5, side];
  const scale = width / size;
  return { scale, x: (v) => (v - x0 + 0.5) * scale, y: (v) => (v - y0 + 0.5) * scale };
}

/** The colour of a change of area, [r, g, b]; of a lost pin's that of the edges. */
function colourOf(change, colours) {
  if (!Number.isFinite(change)) return colours.edge;
  const share = (change / hello.full_change + 1) / 2;
  return colours.cells[Math.round(Math.min(1, Math.max(0, share)) * (colours.cells.length - 1))];
}

/** One polygon a pin: flat [x, y, x, y, ...], CSS px. */
function cells(points, triangles, n, at) {
  const corners = Array.from({ length: n }, () => []);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const [ax, ay] = [points[2 * a], points[2 * a + 1]];
    const [ux, uy] = [points[2 * b] - ax, points[2 * b + 1] - ay];
    const [vx, vy] = [points[2 * c] - ax, points[2 * c + 1] - ay];
    const cross = 2 * (ux * vy - uy * vx);
    const [u2, v2] = [ux * ux + uy * uy, vx * vx + vy * vy];
    const x = ax + (vy * u2 - uy * v2) / cross;
    const y = ay + (ux * v2 - vx * u2) / cross;
    if (!Number.isFinite(x + y)) continue;
    for (const pin of [a, b, c])
      if (pin < n) corners[pin].push([Math.atan2(y - points[2 * pin + 1], x - points[2 * pin]), at.x(x), at.y(y)]);
  }
  return corners.map((list) => list.sort((p, q) => p[0] - q[0]));
}

function drawCells(g, packet, at, colours) {
  const { points, triangles, change } = packet.arrays;
  g.lineWidth = 1;
  g.strokeStyle = rgb(colours.edge);
  cells(points, triangles, change.length, at).forEach((corners, pin) => {
    if (corners.length < 3) return;
    g.beginPath();
    corners.forEach(([, x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
    g.closePath();
    g.fillStyle = rgb(colourOf(change[pin], colours));
    g.fill();
    g.stroke();
  });
}

const sheet = new OffscreenCanvas(1, 1);

function drawSurface(g, packet, at, colours) {
  const [x0, y0, size, n] = packet.grid;
  [sheet.width, sheet.height] = [n, n];
  const context = sheet.getContext("2d");
  const image = context.createImageData(n, n);
  packet.arrays.surface.forEach((height, i) => {
    if (Number.isFinite(height)) image.data.set([...colourOf(height, colours), 255], 4 * i);
  });
  context.putImageData(image, 0, 0);
  g.imageSmoothingEnabled = true;
  g.imageSmoothingQuality = "high";
  const side = n * size * at.scale;
  g.drawImage(sheet, at.x(x0) - (size * at.scale) / 2, at.y(y0) - (size * at.scale) / 2, side, side);
}

/** Words in the middle of a panel. */
function say(g, width, colour, message) {
  g.fillStyle = colour;
  g.font = "14px system-ui, sans-serif";
  g.textAlign = "center";
  g.fillText(message, width / 2, width / 2);
}

function drawTouch(packet) {
  const { g, width } = fit($("touch"));
  const colours = hello.palettes[palette];
  const at = placer(packet, width);
  const { pins, motion, change, surface } = packet.arrays;
  if (surface) drawSurface(g, packet, at, colours);
  else if (change) drawCells(g, packet, at, colours);
  if (!pins) {
    say(g, width, "#59626d", packet.taring ? "taking the rest frame: leave the tip untouched" : "no pins yet");
    return;
  }
  if (motion) {
    g.strokeStyle = rgb(colours.local);
    g.lineWidth = Math.max(1, width / 480);
    g.beginPath();
    for (let i = 0; i < motion.length; i += 2) {
      if (!Number.isFinite(motion[i] + pins[i])) continue;
      const [x, y] = [at.x(pins[i]), at.y(pins[i + 1])];
      g.moveTo(x, y);
      g.lineTo(x + hello.local_gain * at.scale * motion[i], y + hello.local_gain * at.scale * motion[i + 1]);
    }
    g.stroke();
  }
  g.fillStyle = rgb(colours.pin);
  g.beginPath();
  for (let i = 0; i < pins.length; i += 2) {
    if (!Number.isFinite(pins[i])) continue;
    g.moveTo(at.x(pins[i]), at.y(pins[i + 1]));
    g.arc(at.x(pins[i]), at.y(pins[i + 1]), Math.max(1.2, width * 0.004), 0, 7);
  }
  g.fill();
  if (packet.shear_px && packet.shear_px[0] !== null) {
    const [x, y] = [at.x(packet.centre[0]), at.y(packet.centre[1])];
    const [dx, dy] = packet.shear_px.map((v) => v * hello.global_gain * at.scale);
    arrow(g, x, y, x + dx, y + dy, width / 90, rgb(colours.shear), rgb(colours.halo));
  }
  for (const contact of packet.contacts ?? []) star(g, at.x(contact.xy[0]), at.y(contact.xy[1]), width / 40, colours);
}

/** The paper's asterisk. */
function star(g, x, y, arm, colours) {
  g.lineCap = "round";
  for (const [colour, width] of [[colours.halo, 0.36], [colours.contact, 0.18]]) {
    g.strokeStyle = rgb(colour);
    g.lineWidth = width * arm;
    g.beginPath();
    for (let k = 0; k < 3; k++) {
      const [dx, dy] = [arm * Math.cos((k * Math.PI) / 3 + Math.PI / 6), arm * Math.sin((k * Math.PI) / 3 + Math.PI / 6)];
      g.moveTo(x - dx, y - dy);
      g.lineTo(x + dx, y + dy);
    }
    g.stroke();
  }
  g.lineCap = "butt";
}

function drawCamera(packet) {
  const { g, width } = fit($("camera"));
  const at = placer(packet, width);
  if (packet.bitmap) {
    const [w, h] = packet.size_px;
    g.imageSmoothingQuality = "high";
    g.drawImage(packet.bitmap, at.x(-0.5), at.y(-0.5), w * at.scale, h * at.scale);
  } else {
    say(g, width, "#c3c9d0", line.wants.has("image") ? "no image yet" : "image off, to spare the line");
  }
  const { pins } = packet.arrays;
  if (!pins) return;
  g.strokeStyle = RING;
  g.lineWidth = 1;
  for (let i = 0; i < pins.length; i += 2) {
    if (!Number.isFinite(pins[i])) continue;
    g.beginPath();
    g.arc(at.x(pins[i]), at.y(pins[i + 1]), width * 0.009, 0, 7);
    g.stroke();
  }
}

function drawBar() {
  const canvas = $("bar");
  const colours = hello.palettes[palette].cells;
  [canvas.width, canvas.height] = [colours.length, 1];
  const g = canvas.getContext("2d");
  colours.forEach((colour, i) => {
    g.fillStyle = rgb(colour);
    g.fillRect(i, 0, 1, 1);
  });
  const full = Math.round(100 * hello.full_change);
  $("bar_low").textContent = `−${full} %`;
  $("bar_high").textContent = `+${full} %`;
  for (const name of ["local", "shear", "contact"])
    document.body.style.setProperty(`--${name}`, rgb(hello.palettes[palette][name]));
}

function draw() {
  if (!scene || !hello) return;
  drawTouch(scene);
  drawCamera(scene);
  const now = clock.server + (performance.now() - clock.here) / 1000;
  for (const { chart } of charts) chart.draw(line.state === "live" ? now : clock.server);
}

const schedule = scheduler(draw);

// ---- words ------------------------------------------------------------------------------------------------

function showWords(packet) {
  const faults = packet.faults.map(([meaning, message]) => (message && message !== meaning ? `${meaning}: ${message}` : meaning));
  if (packet.recording?.fault) faults.push(`recording ended: ${packet.recording.fault}`);
  if (packet.recording?.dropped_n) faults.push(`recording: ${packet.recording.dropped_n} messages lost, the disk is too slow`);
  if (packet.sure === false) faults.push("pins cannot be identified: values are withheld");
  showFaults(faults);
  const n = packet.contacts?.length ?? 0;
  $("felt_about").textContent = packet.taring
    ? "taking the rest frame"
    : packet.touched ? (n === 1 ? "1 contact" : `${n} contacts`) : packet.pins_n ? "untouched" : ""; // prettier-ignore
  $("seen_about").textContent = packet.pins_n ? `${packet.held_n} of ${packet.pins_n} pins held` : "no pins yet";
  $("frame_about").textContent =
    (packet.sequence === undefined ? "" : `frame ${packet.sequence}`) + (packet.dropped_n ? `, ${packet.dropped_n} skipped` : "");
  const record = $("record");
  const recording = packet.recording;
  record.classList.toggle("recording", Boolean(recording));
  record.firstChild.textContent = recording ? `Stop ${recording.frames_n}` : "Record";
  if (tares !== null && packet.tares_n > tares) toast("rest frame taken");
  tares = packet.tares_n;
}

function mayDo() {
  for (const name of ["tare", "record"]) {
    $(name).disabled = !may.includes(name);
    $(name).title = may.includes(name) ? "" : "read-only: open the page with its token (--view-token)";
  }
}

// ---- the line -----------------------------------------------------------------------------------------------

const line = new Line(
  {
    state(state, message) {
      showState(state, message);
      if (state !== "live") schedule();
    },
    hello(said, allowed) {
      [hello, may] = [said, allowed];
      [rowsSeen, tares] = [0, null];
      $("source").textContent = [said.serial, said.source.split("/").at(-1)].filter((s) => s && s !== "unnamed").join(", ");
      document.title = `${$("source").textContent} – voronoi-touch`;
      $("local_gain").textContent = said.local_gain;
      $("global_gain").textContent = said.global_gain;
      charts = [];
      drawBar();
      mayDo();
    },
    async packet(packet) {
      clock = { server: packet.now_s, here: performance.now() };
      takeRows(packet);
      const jpeg = packet.arrays.image;
      if (jpeg) packet.bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
      if (scene && scene.now_s > packet.now_s && scene.now_s - packet.now_s < 5) return; // overtaken while it was decoded
      if ($("hold").ariaPressed === "true" && scene) return;
      scene?.bitmap?.close();
      scene = packet;
      showWords(packet);
      showNumbers(packet);
      document.body.dataset.packets = Number(document.body.dataset.packets ?? 0) + 1;
      schedule();
    },
    answer({ did, ok, message }) {
      const force = did === "tare" && !ok && message.includes("force") ? ["Tare anyway", () => line.do("tare", { force: true })] : null;
      toast(message, ok, force);
    },
  },
  ["image"],
);

const press = (id, on) => ($(id).ariaPressed = String(on));
$("tare").onclick = () => line.do("tare");
$("record").onclick = () => line.do("record");
$("surface").onclick = () => {
  press("surface", !line.wants.has("surface"));
  line.want("surface", !line.wants.has("surface"));
};
$("picture").onclick = () => {
  press("picture", !line.wants.has("image"));
  line.want("image", !line.wants.has("image"));
};
$("safe").onclick = () => {
  palette = remember("palette", palette === "safe" ? "paper" : "safe") ?? (palette === "safe" ? "paper" : "safe");
  press("safe", palette === "safe");
  if (hello) drawBar();
  schedule();
};
$("hold").onclick = () => press("hold", $("hold").ariaPressed !== "true");
press("safe", palette === "safe");
addEventListener("resize", schedule);
keys();
