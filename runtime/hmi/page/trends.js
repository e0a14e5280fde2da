// Signals over time, one lane each: nothing needs a colour to be told from its neighbour.
import { model, on, ask, attempt, byId, element, value, signal, text, shown } from "./model.js";
import * as scope from "./scope.js";

const MOST = 6;
const KEPT_S = 600;
const GAP_S = 2; // without values: no line is drawn across
const series = new Map(); // name -> {t, v}
const plots = [];
let chosen = JSON.parse(sessionStorage.getItem("trends") ?? "null") ?? ["q_slew", "imu_tool_roll", "imu_tool_pitch", "u_slew", "p_pump"];
let span = 60;
const style = () => getComputedStyle(document.documentElement);

class Plot {
  // `view`: what is drawn until when; `marks`: the cursors and the trigger of the scope.
  constructor(canvas, names, seconds, titles, view, marks = () => []) {
    Object.assign(this, { canvas, names, seconds, titles, view, marks });
    plots.push(this);
  }

  draw() {
    const { canvas } = this;
    const seen = this.view();
    if (!seen) return;
    const now = seen.now;
    this.series = seen.series;
    const [w, h, dpr] = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio];
    if (!w || !h) return;
    if (canvas.width !== Math.round(w * dpr) || canvas.height !== Math.round(h * dpr)) [canvas.width, canvas.height] = [Math.round(w * dpr), Math.round(h * dpr)];
    const c = canvas.getContext("2d");
    c.setTransform(dpr, 0, 0, dpr, 0, 0);
    c.clearRect(0, 0, w, h);
    const names = this.names().filter((n) => model.place.has(n));
    const height = (h - 16) / Math.max(1, names.length);
    const colours = Object.fromEntries(["ink", "soft", "faint", "line", "text"].map((n) => [n, style().getPropertyValue(`--${n}`)]));
    names.forEach((name, i) => this.lane(c, name, { x: 8, y: i * height, w: w - 150, h: height }, now, colours));
    this.times(c, { x: 8, w: w - 150, y: h - 4 }, colours);
    for (const mark of this.marks()) this.mark(c, mark, { x: 8, w: w - 150, h: h - 16 }, now, colours);
  }

  // A vertical line with its letter; nothing where its time is not shown.
  mark(c, { t, letter }, box, now, colours) {
    const x = box.x + (1 + (t - now) / this.seconds()) * box.w;
    if (x < box.x || x > box.x + box.w) return;
    this.line(c, [[x, 0], [x, box.h]], colours.text, 1);
    c.fillStyle = colours.text;
    c.font = "600 12px system-ui, sans-serif";
    c.textBaseline = "top";
    c.fillText(letter, x + 3, 2);
  }

  // The time at a place of the canvas in CSS pixels.
  time(x) {
    const [seen, w] = [this.view(), this.canvas.clientWidth - 150];
    const share = Math.min(1, Math.max(0, (x - 8) / w));
    return seen ? seen.now - (1 - share) * this.seconds() : null;
  }

  lane(c, name, box, now, colours) {
    const s = signal(name);
    const points = this.series.get(name) ?? { t: [], v: [] };
    const from = now - this.seconds();
    let first = points.t.findIndex((t) => t >= from);
    if (first < 0) first = points.t.length;
    const seen = points.v.slice(first).filter(Number.isFinite).map((x) => shown(s, x));
    let [low, high] = seen.length ? [Math.min(...seen), Math.max(...seen)] : [0, 1];
    const least = Math.max(Math.abs(s.factor) * 0.01, 1e-3 * Math.max(Math.abs(low), Math.abs(high)), 1e-3);
    if (high - low < 4 * least) [low, high] = [(low + high) / 2 - 2 * least, (low + high) / 2 + 2 * least];
    const [top, tall] = [box.y + 8, box.h - 14];
    const x = (t) => box.x + ((t - from) / this.seconds()) * box.w;
    const y = (v) => top + tall - ((shown(s, v) - low) / (high - low)) * tall;
    c.strokeStyle = colours.faint;
    c.strokeRect(box.x, box.y + 3.5, box.w, box.h - 5);
    if (low < 0 && high > 0) this.line(c, [[box.x, y(-s.offset / s.factor)], [box.x + box.w, y(-s.offset / s.factor)]], colours.line, 1);
    const path = [];
    for (let i = first; i < points.t.length; i++) {
      if (i > first && points.t[i] - points.t[i - 1] > GAP_S) path.push(null);
      path.push(Number.isFinite(points.v[i]) ? [x(points.t[i]), y(points.v[i])] : null);
    }
    this.line(c, path, colours.ink, 1.6);
    this.label(c, s, name, points, { low, high }, box, colours);
  }

  line(c, path, colour, width) {
    c.beginPath();
    let pen = false;
    for (const p of path) {
      if (p && pen) c.lineTo(...p);
      else if (p) c.moveTo(...p);
      pen = Boolean(p);
    }
    [c.strokeStyle, c.lineWidth] = [colour, width];
    c.stroke();
  }

  label(c, s, name, points, range, box, colours) {
    const left = box.x + box.w + 8;
    const middle = box.y + box.h / 2;
    c.textBaseline = "middle";
    c.fillStyle = colours.soft;
    c.font = "12px system-ui, sans-serif";
    c.fillText(this.titles[name] ?? name, left, middle - 12, 134);
    if (box.h > 62) {
      c.fillText(short(range.high), left, box.y + 9);
      c.fillText(short(range.low), left, box.y + box.h - 7);
    }
    c.fillStyle = colours.text;
    c.font = "600 16px system-ui, sans-serif";
    c.fillText(`${text(s, points.v.at(-1) ?? NaN)} ${s.unit}`, left, middle + 6);
  }

  times(c, at, colours) {
    c.fillStyle = colours.soft;
    c.font = "11px system-ui, sans-serif";
    c.textBaseline = "alphabetic";
    for (const share of [0, 0.25, 0.5, 0.75]) c.fillText(`−${Math.round((1 - share) * this.seconds())} s`, at.x + share * at.w + 2, at.y);
  }
}

const STRIP = ["q_slew", "imu_tool_roll", "u_slew"];
const TITLES = { q_slew: "Slew", imu_tool_roll: "Sway left", u_slew: "Slew command" };
const short = (x) => text({ unit: " ", factor: 1, offset: 0 }, x);
const wanted = () => [...new Set([...STRIP, ...chosen])];

export async function fetchSeries(names = wanted(), until = null) {
  const from = until === null ? "" : `&until=${until}`;
  const found = await attempt(() => ask(`api/history?signals=${names.join(",")}&seconds=${KEPT_S}${from}`));
  if (found) names.forEach((name, i) => series.set(name, { t: [...found.t], v: found.v[i].map((x) => (x === null ? NaN : x)) }));
  draw();
}

function append(frame) {
  for (const name of wanted()) {
    const points = series.get(name) ?? { t: [], v: [] };
    series.set(name, points);
    if (points.t.length && frame.t <= points.t.at(-1)) continue;
    points.t.push(frame.t);
    points.v.push(value(name, frame));
    if (points.t.length > 12 * KEPT_S) [points.t, points.v] = [points.t.slice(-10 * KEPT_S), points.v.slice(-10 * KEPT_S)];
  }
}

export function draw() {
  for (const plot of plots) if (plot.canvas.offsetParent !== null) plot.draw();
}

function bar() {
  const at = byId("trend-bar");
  at.replaceChildren();
  const select = element("select", { ariaLabel: "Add a signal" }, element("option", { value: "" }, "Add a signal …"));
  for (const s of model.catalogue.signals) if (!chosen.includes(s.name)) select.append(element("option", { value: s.name, title: s.description }, s.unit ? `${s.name} [${s.unit}]` : s.name));
  select.disabled = chosen.length >= MOST;
  select.addEventListener("change", () => choose([...chosen, select.value]));
  at.append(select);
  for (const name of chosen) {
    const chip = element("button", { type: "button", className: "chip", title: signal(name)?.description ?? "", ariaLabel: `Remove ${name}` }, `${name} ✕`);
    chip.addEventListener("click", () => choose(chosen.filter((n) => n !== name)));
    at.append(chip);
  }
  at.append(element("span", { className: "grow" }));
  for (const seconds of [30, 60, 120, 300, 600]) {
    const button = element("button", { type: "button", ariaPressed: String(seconds === span) }, seconds < 60 ? `${seconds} s` : `${seconds / 60} min`);
    button.addEventListener("click", () => ((span = seconds), bar(), draw()));
    at.append(button);
  }
  scope.offer(chosen);
}

function marks() {
  const found = scope.cursors().map((t, i) => ({ t, letter: "AB"[i] }));
  return scope.trigger()?.t === undefined ? found : [...found, { t: scope.trigger().t, letter: "T" }];
}

function choose(names) {
  chosen = names.filter(Boolean).slice(0, MOST);
  sessionStorage.setItem("trends", JSON.stringify(chosen));
  bar();
  fetchSeries(wanted(), model.catalogue.source === "live" ? null : model.frame?.t);
}

export function start() {
  chosen = chosen.filter((n) => model.place.has(n));
  const live = () => model.frame && { now: model.frame.t, series };
  new Plot(byId("strip"), () => STRIP, () => 60, TITLES, live);
  const plot = new Plot(byId("plot"), () => chosen, () => span, {}, scope.view, marks);
  scope.start(() => ({ span, chosen, series }));
  byId("plot").addEventListener("pointerdown", (e) => {
    const t = plot.time(e.offsetX);
    if (t !== null) scope.place(t);
  });
  on("scope", draw);
  bar();
  if (model.catalogue.source === "live") {
    on("frame", (frame) => (append(frame), draw()));
    fetchSeries();
  }
  on("page", draw);
  addEventListener("resize", draw);
}
