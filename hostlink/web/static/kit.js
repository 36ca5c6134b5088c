// The pages share this: the connection, packets, strip charts.
//
// - The connection says what it is doing, all the time: connecting, live, stale, disconnected (and when it will
//   try again), refused, full. It comes back by itself.
// - Each packet is answered ("got n"): the server sends no more than two ahead, so that a slow line shows the
//   newest picture late, never an old one.
// - Nothing is loaded from anywhere else.

const SILENCE_MS = 3000; // the server says something 4 times a second; a line that is silent this long is dead
const STALE_S = 1;
const RETRY_MS = [500, 1000, 2000, 4000, 5000];
const DENIED = 4401;
const FULL = 1013;

/** A packet as {header fields..., arrays: {name: typed array}}; layout: hostlink/web/packet.py. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const packet = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const types = { f4: Float32Array, u2: Uint16Array, i2: Int16Array, u1: Uint8Array, jpeg: Uint8Array };
  for (const [name, [kind, bytes, at]] of Object.entries(packet.arrays)) {
    const Type = types[kind];
    packet.arrays[name] = new Type(buffer, 4 + length + at, bytes / Type.BYTES_PER_ELEMENT);
  }
  return packet;
}

/** The line to the server. `on` has hello(hello, may), packet(packet), state(name, message), answer(answer). */
export class Line {
  constructor(on, wants = []) {
    this.on = on;
    this.wants = new Set(wants);
    this.state = "";
    this.failures = 0;
    this.token = new URLSearchParams(location.hash.slice(1)).get("token") ?? "";
    addEventListener("online", () => this.retry());
    document.addEventListener("visibilitychange", () => document.hidden || this.retry());
    setInterval(() => this.watch(), 250);
    this.open();
  }

  open() {
    clearTimeout(this.timer);
    this.retryAt = 0;
    this.got = 0;
    this.heard = performance.now();
    this.say("connecting", "connecting");
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify({ token: this.token, want: [...this.wants] }));
    socket.onclose = (event) => this.socket === socket && this.closed(event);
    socket.onmessage = (event) => {
      this.heard = performance.now();
      if (typeof event.data === "string") {
        const said = JSON.parse(event.data);
        if (said.hello) {
          this.failures = 0;
          this.on.hello(said.hello, said.may);
        } else this.on.answer(said);
        return;
      }
      socket.send(JSON.stringify({ got: ++this.got }));
      const packet = unpack(event.data);
      this.judge(packet);
      this.on.packet(packet);
    };
  }

  judge(packet) {
    if (packet.age_s > STALE_S) this.say("stale", `nothing new for ${Math.floor(packet.age_s)} s`);
    else this.say("live", packet.rate_hz === null ? "live" : `live, ${Math.round(packet.rate_hz)} Hz`);
  }

  closed(event) {
    if (event.code === DENIED) {
      this.say("refused", "the token is missing or wrong: open the page by the address that the program printed");
      return;
    }
    this.why = event.code === FULL ? event.reason : "disconnected";
    const wait = event.code === FULL ? 5000 : RETRY_MS[Math.min(this.failures++, RETRY_MS.length - 1)];
    this.retryAt = performance.now() + wait;
    this.timer = setTimeout(() => this.open(), wait);
    this.watch();
  }

  retry() {
    if (this.retryAt) this.open();
  }

  watch() {
    const now = performance.now();
    if (this.retryAt) {
      const left = Math.max(1, Math.ceil((this.retryAt - now) / 1000));
      this.say("disconnected", `${this.why}; trying again in ${left} s`);
    } else if (this.socket.readyState === WebSocket.OPEN && now - this.heard > SILENCE_MS) {
      const socket = this.socket;
      this.socket = null; // a dead line answers no goodbye: do not wait for one
      socket.close();
      this.socket = socket;
      this.closed({ code: 1006, reason: "" });
      socket.onclose = null;
    }
  }

  say(state, message) {
    if (state === this.state && message === this.message) return;
    [this.state, this.message] = [state, message];
    this.on.state(state, message);
  }

  want(name, on) {
    if (on) this.wants.add(name);
    else this.wants.delete(name);
    this.send({ want: [...this.wants] });
  }

  /** Ask for a command. */
  do(name, more = {}) {
    return this.send({ do: name, ...more });
  }

  send(what) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(what));
    return true;
  }
}

/** The canvas at the screen's own resolution, with a context whose unit is the CSS pixel. */
export function fit(canvas) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, width, height);
  return { g, width, height };
}

/** Steps of 1, 2 or 5 times a power of ten, at most `most` of them over the span. */
export function step(span, most) {
  const power = 10 ** Math.floor(Math.log10(span / most));
  return [1, 2, 5, 10].map((m) => m * power).find((s) => span / s <= most + 1e-9);
}

const LABEL_PX = 14; // from the middle of a label to that of the next one
const INK = "#1b1f24";
const MUTED = "#59626d";
const GRID = "#e3e6ea";
const SERIES = ["#0060a8", "#c24a00", "#007a5a"]; // dark shades of Okabe and Ito's blue, vermilion, green
const DASHES = [[], [6, 3], [2, 2]]; // distinguishable without colour too

/** A strip chart: the last `seconds` of a few series over time, with axes. Values may be null or NaN: a gap. */
export class Chart {
  /** least: the smallest span of the vertical axis; names: of the series, for the legend; unit: of all, % of
   *  shares. It is hidden until there is a value. */
  constructor(canvas, { unit, least = 1, names = [], seconds = 10 }) {
    Object.assign(this, { canvas, unit, least, names, seconds });
    this.clear();
  }

  clear() {
    this.times = [];
    this.values = [];
    this.known = false;
  }

  add(time, values) {
    if (this.times.length && time <= this.times.at(-1)) return;
    this.times.push(time);
    this.values.push(values);
    this.known ||= values.some(Number.isFinite);
    if (this.times.length > 256 && this.times[128] < time - this.seconds) {
      this.times.splice(0, 128);
      this.values.splice(0, 128);
    }
  }

  /** Lowest and highest value of an axis of this height, px, and the step of its labels, which keep apart. */
  range(px) {
    let [low, high] = [0, 0]; // zero is always in view
    const first = this.times.findIndex((t) => t >= (this.times.at(-1) ?? 0) - this.seconds);
    for (let i = Math.max(first, 0); i < this.values.length; i++)
      for (const v of this.values[i])
        if (Number.isFinite(v)) {
          if (v < low) low = v;
          if (v > high) high = v;
        }
    for (let most = 4; ; most--) {
      const size = step(Math.max(high - low, this.least), most);
      const first = Math.floor(low / size + 0.1) * size; // noise about zero makes no step of its own
      const last = Math.max(Math.ceil(high / size - 0.1) * size, first + Math.ceil(this.least / size) * size);
      if (most === 1 || px * size >= LABEL_PX * (last - first)) return { low: first, high: last, size };
    }
  }

  draw(now) {
    this.canvas.closest(".chart").hidden = !this.known;
    const { g, width, height } = fit(this.canvas);
    if (!width || !height) return;
    const [left, right, top, bottom] = [46, width - 10, 8, height - 19];
    const { low, high, size } = this.range(bottom - top);
    const x = (t) => right + ((t - now) / this.seconds) * (right - left);
    const y = (v) => bottom - ((v - low) / (high - low)) * (bottom - top);
    const factor = this.unit === "%" ? 100 : 1;
    const digits = Math.max(0, -Math.floor(Math.log10(size * factor) + 1e-9));
    g.font = "11px system-ui, sans-serif";
    g.lineWidth = 1;
    g.textBaseline = "middle";
    g.textAlign = "right";
    for (let k = Math.round(low / size); k * size <= high + size / 2; k++) {
      const level = Math.round(y(k * size)) + 0.5;
      g.strokeStyle = k === 0 ? "#9aa2ab" : GRID;
      g.beginPath();
      g.moveTo(left, level);
      g.lineTo(right, level);
      g.stroke();
      g.fillStyle = MUTED;
      g.fillText((k * size * factor).toFixed(digits).replace("-", "−"), left - 6, level);
    }
    g.textBaseline = "top";
    for (let s = 0; s <= this.seconds; s += this.seconds / 2) {
      const at = Math.round(x(now - s)) + 0.5;
      g.strokeStyle = GRID;
      g.beginPath();
      g.moveTo(at, top);
      g.lineTo(at, bottom);
      g.stroke();
      g.fillStyle = MUTED;
      g.textAlign = s === 0 ? "right" : s === this.seconds ? "left" : "center";
      g.fillText(s === 0 ? "now" : `−${s} s`, at, bottom + 5);
    }
    this.series(g, now, x, y, { left, right, top, bottom });
  }

  series(g, now, x, y, box) {
    g.save();
    g.beginPath();
    g.rect(box.left, box.top - 2, box.right - box.left, box.bottom - box.top + 4);
    g.clip();
    g.lineJoin = "round";
    g.lineWidth = 1.6;
    const n = this.values.at(-1)?.length ?? 0;
    for (let k = 0; k < n; k++) {
      g.strokeStyle = SERIES[k];
      g.setLineDash(DASHES[k]);
      g.beginPath();
      let before = -Infinity;
      for (let i = 0; i < this.times.length; i++) {
        const [t, v] = [this.times[i], this.values[i][k]];
        if (t < now - this.seconds - 1 || !Number.isFinite(v)) continue;
        if (t - before > 0.5 || !Number.isFinite(this.values[i - 1]?.[k])) g.moveTo(x(t), y(v));
        else g.lineTo(x(t), y(v));
        before = t;
      }
      g.stroke();
    }
    g.restore();
  }
}

/** The canvas of a chart in a card with title and legend, among the page's charts; hidden until there is a value. */
export function chartCanvas({ title, unit, names = [] }) {
  const box = document.createElement("section");
  box.className = "card chart";
  box.innerHTML = `<h2><span>${title} <small>${unit}</small></span></h2><canvas role="img"></canvas>`;
  names.forEach((name, k) => {
    const key = document.createElement("span");
    key.className = k ? "key dashed" : "key";
    key.style.setProperty("--c", SERIES[k]);
    key.textContent = name;
    box.querySelector("h2").append(key);
  });
  box.hidden = true;
  document.getElementById("charts").append(box);
  const canvas = box.querySelector("canvas");
  canvas.setAttribute("aria-label", `${title}, ${unit}, last ten seconds`);
  return canvas;
}

/** A function that has `draw` called with the screen's next picture, once however often it was asked. */
export function scheduler(draw) {
  let due = false;
  return () => {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      draw();
    });
  };
}

/** An arrow of a page's shear: filled, with a light rim so that it stands out from anything. */
export function arrow(g, x0, y0, x1, y1, width, colour, halo) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < width) return; // too short to have a direction
  const [ux, uy] = [(x1 - x0) / length, (y1 - y0) / length];
  const barb = Math.min(4 * width, 0.6 * length);
  const point = (along, across) => [x0 + along * ux - across * uy, y0 + along * uy + across * ux];
  const half = width / 2;
  const outline = [
    [0, half], [length - barb, half], [length - barb, barb * 0.45], [length, 0],
    [length - barb, -barb * 0.45], [length - barb, -half], [0, -half],
  ]; // prettier-ignore
  g.fillStyle = colour;
  g.strokeStyle = halo;
  g.lineWidth = width * 0.8;
  g.lineJoin = "round";
  g.beginPath();
  outline.forEach(([a, b], i) => (i ? g.lineTo(...point(a, b)) : g.moveTo(...point(a, b))));
  g.closePath();
  g.stroke();
  g.fill();
}

export const rgb = (colour, alpha = 1) => `rgb(${colour.join(" ")} / ${alpha})`;

/** A number with a true minus sign; a dash where it is not known. */
export function number(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

let toastTimer;
/** Words that go by themselves; with a button if `more` is [label, function]. */
export function toast(message, ok = true, more = null) {
  const box = document.getElementById("toast");
  box.textContent = message;
  box.className = ok ? "" : "bad";
  if (more) {
    const button = document.createElement("button");
    button.textContent = more[0];
    button.onclick = () => {
      box.hidden = true;
      more[1]();
    };
    box.append(button);
  }
  box.hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => (box.hidden = true), more ? 8000 : 4000);
}

/** Buttons with data-key: a click and the key do the same. */
export function keys() {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    const key = event.key === " " ? "space" : event.key.toLowerCase();
    const button = document.querySelector(`button[data-key="${CSS.escape(key)}"]`);
    if (!button || button.disabled || (key === "space" && event.target instanceof HTMLButtonElement)) return;
    event.preventDefault();
    button.click();
  });
}

/** The connection's state as words and a class; the whole page is dimmed by it where it is not live. */
export function showState(state, message) {
  const box = document.getElementById("state");
  box.textContent = message;
  document.body.dataset.state = state;
}

/** The page's faults, one a line. */
export function showFaults(faults) {
  const list = document.getElementById("faults");
  if (list.dataset.shown === faults.join("\n")) return;
  list.dataset.shown = faults.join("\n");
  list.replaceChildren(...faults.map((message) => Object.assign(document.createElement("li"), { textContent: message })));
}

/** A palette of the page, kept for the next time where the browser allows it. */
export function remember(name, value) {
  try {
    if (value === undefined) return localStorage.getItem(name);
    localStorage.setItem(name, value);
  } catch {
    return null; // storage is switched off: nothing is kept
  }
  return value;
}
export { INK, MUTED };
