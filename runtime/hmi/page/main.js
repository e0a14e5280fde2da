// The page: which part is shown, the stream from the controller's computer, and the header.
import { model, on, tell, ask, learn, byId, mode, time } from "./model.js";
import * as machine from "./machine.js";
import * as around from "./around.js";
import * as trends from "./trends.js";
import * as lists from "./lists.js";
import * as control from "./control.js";
import * as player from "./player.js";

const PAGES = ["machine", "trends", "alarms", "statistics", "signals"];
const OLD_MS = 1500; // without a frame: what is shown is old
const FORCED = 2048;
let heard = performance.now();
let refused = ""; // why the controller's computer shows nothing, in its own words

function turn() {
  const wanted = PAGES.includes(location.hash.slice(1)) ? location.hash.slice(1) : "machine";
  for (const page of PAGES) byId(page).hidden = page !== wanted;
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === `#${wanted}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  tell("page", wanted);
}

function show(frame) {
  model.frame = frame;
  old(false);
  tell("frame", frame);
  header();
}

function old(now) {
  model.stale = now;
  document.body.classList.toggle("stale", now);
}

function banner(level, mark, text, cause) {
  const at = byId("banner");
  at.className = `banner ${level}`;
  byId("banner-mark").textContent = mark;
  byId("banner-text").textContent = text;
  byId("banner-cause").textContent = cause;
}

function header() {
  byId("mode").textContent = model.stale ? "unknown" : mode();
  byId("mode").className = `mode ${mode() === "fault" && !model.stale ? "critical" : ""}`;
  byId("forced").hidden = !(model.frame && model.frame.flags & FORCED);
  if (model.frame) {
    byId("clock").textContent = time(model.frame.t);
    byId("day").textContent = model.catalogue.clock === "run" ? "of the run" : new Date(1000 * model.frame.t).toLocaleDateString("sv-SE");
  }
  const live = model.catalogue.source === "live";
  const t = model.frame?.t ?? 0;
  const there = model.alarms.list.filter((a) => (live ? a.gone === null : a.since <= t && (a.gone === null || a.gone > t)));
  const top = there[0];
  const left = live ? model.alarms.list.filter((a) => a.gone !== null) : [];
  if (model.stale && refused) banner("critical", "!!", "This display is not up to date", refused);
  else if (model.stale) banner("critical", "!!", "This display is not up to date", "no news from the control process: rely on the machine, not on this page");
  else if (top) banner(top.level, { critical: "!!", warning: "!" }[top.level] ?? "F", top.text, (there.length > 1 ? `(and ${there.length - 1} more) ` : "") + top.cause);
  else if (left.length) banner("past", "i", left.length > 1 ? `${left.length} gone, not acknowledged` : `Gone, not acknowledged: ${left[0].text}`, left[0].cause);
  else banner("", "", "No alarms", "");
}

function listen() {
  const stream = new EventSource("api/stream");
  stream.addEventListener("open", () => (refused = ""));
  stream.addEventListener("error", () => stream.readyState === EventSource.CLOSED && closed());
  const take = (kind, action) => stream.addEventListener(kind, (event) => action(JSON.parse(event.data)));
  take("frame", (frame) => ((heard = performance.now()), show(frame)));
  take("stale", () => (old(true), header()));
  take("alarms", (alarms) => ((model.alarms = alarms), tell("alarms"), header()));
  take("modbus", (found) => ((model.modbus = found), tell("modbus", found)));
  take("work", (work) => ((model.work = work), tell("work", work)));
  setInterval(() => {
    if (performance.now() - heard < OLD_MS) return;
    if (!model.stale || stream.readyState !== EventSource.OPEN) tell("lost");
    old(true);
    header();
  }, 500);
}

// An event stream does not say why it was refused: asked once more in another way, and again later.
async function closed() {
  refused = await ask("api/full").then((found) => found.full, () => "");
  old(true);
  header();
  setTimeout(() => location.reload(), 5000);
}

async function begin() {
  learn(await ask("api/catalogue"));
  const about = model.catalogue.about;
  byId("source").textContent = model.catalogue.source === "live" ? about.machine : `PLAYBACK: ${about.machine}`;
  byId("source").title = Object.entries(about).map(([k, x]) => `${k}: ${x}`).join("\n");
  byId("banner").addEventListener("click", () => (location.hash = "#alarms"));
  for (const part of [machine, around, trends, lists, control]) part.start();
  addEventListener("hashchange", turn);
  turn();
  if (model.catalogue.source === "live") listen();
  else {
    on("shown", show);
    player.start();
  }
  document.body.dataset.ready = "yes";
}

begin().catch(() => {
  byId("banner-text").textContent = "No answer from the controller's computer";
  setTimeout(() => location.reload(), 3000);
});
