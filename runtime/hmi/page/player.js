// Playback: a slider over the recording, play speeds, and frames fetched in pieces.
import { model, on, tell, ask, attempt, byId, element, time } from "./model.js";
import { fetchSeries } from "./trends.js";

const PIECE_S = 20;
const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 30];
const pieces = new Map();
let at = 0; // s since the start
let speed = 1;
let playing = false;
let shownAt = -1;
let trendsAt = -Infinity;
let overview = { alarms: [], work: null, done: false };
const parts = {};

function piece(number) {
  if (!pieces.has(number)) {
    if (pieces.size > 30) pieces.delete(pieces.keys().next().value);
    const from = number * PIECE_S;
    pieces.set(number, attempt(() => ask(`api/frames?from=${from}&to=${from + PIECE_S}`)).then((x) => x?.frames ?? []));
  }
  return pieces.get(number);
}

// The frame at a time, between its neighbours; angles and all other values in straight lines.
export function between(a, b, t) {
  if (!b || b.t <= a.t || b.t - a.t > 1) return a;
  const share = Math.min(1, Math.max(0, (t - a.t) / (b.t - a.t)));
  const v = a.v.map((x, i) => (x === null || b.v[i] === null || model.catalogue.signals[i].values ? x : x + share * (b.v[i] - x)));
  return { ...a, t, v };
}

async function show() {
  const number = Math.floor(at / PIECE_S);
  const frames = await piece(number);
  if (at > (number + 0.5) * PIECE_S && (number + 1) * PIECE_S < model.catalogue.duration) piece(number + 1);
  if (Math.floor(at / PIECE_S) !== number || !frames.length) return;
  const t = model.catalogue.begin + at;
  let i = frames.findIndex((f) => f.t > t);
  i = i < 0 ? frames.length - 1 : Math.max(0, i - 1);
  tell("shown", between(frames[i], frames[i + 1], t));
  const w = Number(sessionStorage.getItem("span") ?? 60);
  if (Math.abs(t - trendsAt) > Math.max(0.5, w / 120) * Math.max(1, speed / 2)) {
    trendsAt = t;
    fetchSeries(undefined, t);
  }
}

function seek(to) {
  at = Math.min(model.catalogue.duration, Math.max(0, to));
  parts.slider.value = String(at);
  parts.slider.setAttribute("aria-valuetext", label());
  parts.time.textContent = label();
  if (Math.abs(at - shownAt) < 1e-3) return;
  shownAt = at;
  show();
}

const clock = (s) => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;
const label = () => `${clock(at)} / ${clock(model.catalogue.duration)}`;

function play(wanted) {
  playing = wanted;
  parts.play.textContent = playing ? "❚❚ Pause" : "▶ Play";
  if (playing && at >= model.catalogue.duration) seek(0);
  if (playing) requestAnimationFrame((now) => step(now, now));
}

function step(then, now) {
  if (!playing) return;
  if (now - then < 33) return void requestAnimationFrame((next) => step(then, next));
  seek(at + (speed * Math.min(500, now - then)) / 1000);
  if (at >= model.catalogue.duration) play(false);
  else requestAnimationFrame((next) => step(now, next));
}

async function look() {
  overview = (await attempt(() => ask("api/overview"))) ?? overview;
  model.alarms = { list: overview.alarms, past: [] };
  tell("alarms");
  if (overview.work) tell("work", (model.work = overview.work));
  parts.ticks.replaceChildren(...overview.alarms.slice(0, 300).map(tick));
  if (!overview.done) setTimeout(look, 1000);
}

function tick(alarm) {
  const made = element("i", { className: alarm.level, title: alarm.text });
  made.style.left = `${(100 * (alarm.since - model.catalogue.begin)) / model.catalogue.duration}%`;
  return made;
}

export function start() {
  const bar = byId("player");
  bar.hidden = false;
  parts.play = element("button", { type: "button", id: "play", className: "main" }, "▶ Play");
  parts.play.addEventListener("click", () => play(!playing));
  const back = element("button", { type: "button", ariaLabel: "Back to the start" }, "|◀");
  back.addEventListener("click", () => seek(0));
  parts.slider = element("input", { type: "range", id: "slider", min: "0", max: String(model.catalogue.duration), step: "0.1", value: "0", ariaLabel: "Time" });
  parts.slider.addEventListener("input", () => seek(Number(parts.slider.value)));
  parts.ticks = element("div", { className: "ticks" });
  parts.time = element("output", { id: "at" }, label());
  const speeds = element("select", { id: "speed", ariaLabel: "Play speed" }, ...SPEEDS.map((x) => element("option", { value: String(x), selected: x === 1 }, `${x} ×`)));
  speeds.addEventListener("change", () => (speed = Number(speeds.value)));
  bar.append(parts.play, back, element("div", { className: "track" }, parts.ticks, parts.slider), parts.time, speeds);
  on("page", () => show());
  show();
  look();
}
