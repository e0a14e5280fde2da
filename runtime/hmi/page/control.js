// Values on the main page, signing in, control of the target, forcing.  The page holds a right as long as it beats.
import { model, on, tell, ask, attempt, byId, element, value, status, signal, shown, kept, text, toast } from "./model.js";
import { mark, pose } from "./machine.js";

const BEAT_MS = 100; // the right ends 500 ms after the last beat
const FIELDS = [["target_x", "x"], ["target_y", "y"], ["target_z", "z"], ["pace", "pace"], ["load_told", "load"]];
const UNITS = { target_x: "m", target_y: "m", target_z: "m", pace: "", load_told: "kg" };
let hasControl = false;
let forcing = false;
const confirmed = { control: false, force: false }; // the stream says so, too
let beating = 0;
let waiting = 0;
let rights = 0; // got so far: a beat from before the newest says nothing about it
let inputs = {};

// --- values ---

const VALUES = [["Slew", "q_slew"], ["Boom", "q_boom"], ["Stick", "q_stick"], ["Sway left", "imu_tool_roll"], ["Sway in", "imu_tool_pitch"], ["Pump", "p_pump"], ["Load, estimated", "load_estimate"]];
const GAUGES = [["Slew command", "u_slew"], ["Boom command", "u_boom"], ["Stick command", "u_stick"]];
const places = {};

function buildValues() {
  const add = (key, name) => {
    places[key] = element("dd");
    byId("values").append(element("dt", {}, name), places[key]);
  };
  add("distance", "To the target");
  for (const [title, name] of VALUES) add(name, title);
  add("grab", "Grab, radius / height");
  for (const [title, name] of GAUGES) {
    const bar = element("i", { ariaHidden: "true" });
    const number = element("output");
    places[name] = { bar, number };
    byId("values").append(element("div", { className: "gauge", title: signal(name).description }, element("span", {}, title), bar, number));
  }
}

function fill(at, number, unit, how = 0) {
  const part = element("span", { className: how === 8 ? "is-forced" : how > 1 ? "wrong" : "" }, number);
  at.replaceChildren(part, element("small", {}, unit ? ` ${unit}` : ""));
}

function showValues(frame) {
  for (const [, name] of VALUES) {
    const x = value(name);
    const number = name === "load_estimate" && Number.isFinite(x) ? String(Math.round(x)) : text(signal(name), x);
    fill(places[name], number, signal(name).unit, name === "load_estimate" ? 0 : status(name));
  }
  for (const [, name] of GAUGES) {
    const x = value(name);
    places[name].bar.style.setProperty("--x", Number.isFinite(x) ? String(x) : "0");
    places[name].number.textContent = text(signal(name), x);
  }
  const p = pose(frame);
  fill(places.grab, p.known ? `${Math.hypot(p.grab[0], p.grab[1]).toFixed(1)} / ${p.grab[2].toFixed(1)}` : "–", "m");
  const to = ["target_x", "target_y", "target_z"].map((n) => value(n));
  const far = value("target_valid") > 0.5 && p.known ? Math.hypot(...to.map((x, i) => x - p.grab[i])) : NaN;
  fill(places.distance, Number.isFinite(far) ? far.toFixed(2) : "none", Number.isFinite(far) ? "m" : "");
}

// --- the right to write ---

async function beat() {
  if (waiting > 2) return; // an answer that does not come is a loss by itself
  waiting += 1;
  const before = rights;
  try {
    await ask("api/beat", {});
  } catch {
    if (before === rights) end(hasControl ? "Control has ended" : "Forcing has ended");
  } finally {
    waiting -= 1;
  }
}

function begin() {
  if (!beating) beating = setInterval(beat, BEAT_MS);
}

function end(message) {
  if (!hasControl && !forcing) return;
  hasControl = forcing = confirmed.control = confirmed.force = false;
  stop();
  mark("draft", null);
  if (message) toast(message);
  buildControl();
}

// One of the rights is over, by what the stream says; the other may go on.
function ended(which, message) {
  if (which === "control") hasControl = confirmed.control = false;
  else forcing = confirmed.force = false;
  toast(message);
  if (!hasControl && !forcing) stop();
  if (which === "control") mark("draft", null), buildControl();
}

function stop() {
  clearInterval(beating);
  beating = 0;
}

async function take() {
  if (await attempt(() => ask("api/control", {}))) {
    hasControl = true;
    rights += 1;
    begin();
    buildControl();
  }
}

async function release() {
  hasControl = confirmed.control = false;
  if (!forcing) stop();
  await attempt(() => ask("api/control/end", {}));
  mark("draft", null);
  buildControl();
}

function asked() {
  const found = {};
  for (const [name] of FIELDS) if (inputs[name].value.trim() !== "") found[name] = Number(inputs[name].value);
  return found;
}

async function go() {
  if (await attempt(() => ask("api/target", asked()))) mark("draft", null);
}

function draft() {
  const found = asked();
  mark("draft", [found.target_x, found.target_y, found.target_z].map((x) => x ?? NaN));
}

// A touch in a view proposes a target; nothing moves before "Go to target".
function touched(at) {
  if (!hasControl) return;
  const set = (name, x) => (inputs[name].value = x.toFixed(1));
  if ("z" in at) {
    set("target_z", Math.max(at.z, 0));
    const angle = Math.atan2(Number(inputs.target_y.value), Number(inputs.target_x.value));
    set("target_x", at.radius * Math.cos(angle));
    set("target_y", at.radius * Math.sin(angle));
  } else {
    set("target_x", at.x);
    set("target_y", at.y);
  }
  draft();
}

function button(title, action, more = {}) {
  const made = element("button", { type: "button", ...more }, title);
  made.addEventListener("click", action);
  return made;
}

function buildControl() {
  const at = byId("control");
  at.replaceChildren(element("ol", { id: "ladder" }), element("p", { id: "writer" }));
  if (model.catalogue.source !== "live") {
    at.append(element("p", { id: "target-text" }), element("p", { className: "hint" }, "Playback: nothing can be changed."));
  } else if (!model.session) {
    at.append(element("p", { id: "target-text" }), element("p", {}, "Sign in to set targets. Manual, automatic and the enabling switch are on the operator's panel."));
  } else if (!hasControl) {
    at.append(element("p", { id: "target-text" }), element("div", { className: "buttons" }, button("Take control of the target", take, { id: "take", className: "main" })));
  } else {
    const kept = Object.fromEntries(Object.entries(inputs).map(([k, x]) => [k, x.value]));
    inputs = Object.fromEntries(FIELDS.map(([name]) => [name, element("input", { id: name, inputMode: "decimal", type: "number", step: name === "load_told" ? "50" : "0.1", value: kept[name] ?? first(name) })]));
    for (const field of Object.values(inputs)) field.addEventListener("input", draft);
    const labels = FIELDS.map(([name, title]) => element("label", { title: signal(name).description }, UNITS[name] ? `${title} [${UNITS[name]}]` : title, inputs[name]));
    const buttons = [button("HOLD", () => attempt(() => ask("api/hold", {})), { id: "hold", className: "main" }), button("Go to target", go, { id: "go" }), button("Give back", release, { id: "release" })];
    at.append(element("div", { className: "fields" }, ...labels), element("div", { className: "buttons" }, ...buttons));
  }
  showControl();
}

function first(name) {
  const x = value(name);
  if (value("target_valid") > 0.5 && Number.isFinite(x)) return x.toFixed(name === "load_told" ? 0 : 2);
  const p = pose(model.frame);
  const rest = { target_x: p.grab[0], target_y: p.grab[1], target_z: p.grab[2], pace: 1, load_told: 0 }[name];
  return Number.isFinite(rest) ? rest.toFixed(name === "load_told" ? 0 : 1) : "";
}

// What keeps the machine from its next mode, as the controller's own state machine sees it.
function showLadder() {
  const rungs = model.frame.ladder ?? [];
  const next = rungs.findIndex((r) => !r.reached);
  const lines = rungs.map((r, i) => {
    const missing = r.missing.length ? `: ${r.missing.join("; ")}` : "";
    return element("li", { className: r.reached ? "reached" : i === next ? "next" : "" }, element("b", {}, `${r.reached ? "✓ " : ""}${r.to}`), missing);
  });
  const why = model.catalogue.no_ladder || "the recording begins between two states of the controller";
  if (!lines.length && model.catalogue.source !== "live") lines.push(element("li", {}, `What kept it from moving is not known here: ${why}`));
  byId("ladder").replaceChildren(...lines);
}

function showControl() {
  if (!model.frame) return;
  showLadder();
  const writer = model.catalogue.writers[model.frame.writer] ?? "";
  const planner = model.modbus ? (model.modbus.writer ? `${model.modbus.writer}, over Modbus` : "a planner on the CAN bus") : "a planner on the CAN bus";
  const who = { nobody: "nobody", planner, hmi: model.frame.by || "this page" }[writer] ?? "–";
  byId("writer").textContent = model.catalogue.source === "live" ? `Targets come from: ${who}` : "";
  const line = byId("target-text");
  const to = ["target_x", "target_y", "target_z"].map((n) => text(signal(n), value(n)));
  if (line) line.textContent = value("target_valid") > 0.5 ? `Target ${to.join(" / ")} m, pace ${text(signal("pace"), value("pace"))}${value("target_in_reach") <= 0.5 ? ", out of reach" : ""}${value("target_reached") > 0.5 ? ", reached" : ""}` : "No target";
  confirmed.control ||= hasControl && model.frame.by !== "";
  confirmed.force ||= forcing && model.frame.forced_by !== "";
  if (confirmed.control && model.frame.by === "") ended("control", "Control has ended");
  if (confirmed.force && model.frame.forced_by === "") ended("force", "Forcing has ended");
}

// --- dialogs ---

function dialog(...content) {
  byId("dialog-form").replaceChildren(...content);
  byId("dialog").showModal();
}

const close = () => byId("dialog").close();

function signIn() {
  if (model.session) return signOut();
  const name = element("input", { id: "name", autocomplete: "off", maxLength: 40 });
  const token = element("input", { id: "token", type: "password", autocomplete: "off" });
  const submit = button("Sign in", async () => {
    const found = await attempt(() => ask("api/session", { name: name.value, token: token.value }));
    if (!found) return;
    model.session = { key: found.session, role: found.role, name: found.name };
    close();
    tell("session");
  }, { id: "sign-in", className: "main" });
  for (const field of [name, token]) field.addEventListener("keydown", (e) => e.key === "Enter" && (e.preventDefault(), submit.click()));
  const buttons = element("div", { className: "buttons" }, submit, button("Cancel", close));
  return dialog(element("h2", {}, "Sign in"), element("label", {}, "Your name, for the audit log", name), element("label", {}, "Token of your role", token), buttons);
}

async function signOut() {
  await attempt(() => ask("api/session/end", {}));
  end("");
  model.session = null;
  tell("session");
}

function force(s) {
  const field = element("input", { id: "force-value", type: "number", step: "any", inputMode: "decimal", value: Number.isFinite(value(s.name)) ? shown(s, value(s.name)).toFixed(3) : "" });
  const submit = button("Force", async () => {
    if (field.value.trim() === "") return;
    if (await attempt(() => ask("api/force", { signal: s.name, value: Number(kept(s, Number(field.value)).toPrecision(12)) }))) {
      forcing = true;
      rights += 1;
      begin();
      close();
    }
  }, { id: "force-go", className: "main" });
  const hint = element("p", {}, "It lasts until STANDBY is left, forcing is ended, or this page is closed or hidden.");
  dialog(element("h2", {}, `Force ${s.name}${s.unit ? ` [${s.unit}]` : ""}`), element("p", {}, s.description), field, hint, element("div", { className: "buttons" }, submit, button("Cancel", close)));
}

function shelve(a) {
  const minutes = element("input", { id: "shelve-minutes", type: "number", min: "1", max: "480", step: "1", value: "30" });
  const reason = element("input", { id: "shelve-reason", maxLength: 100, autocomplete: "off" });
  const submit = button("Shelve", async () => {
    if (await attempt(() => ask("api/shelve", { number: a.number, minutes: Number(minutes.value), reason: reason.value }))) close();
  }, { id: "shelve", className: "main" });
  const said = element("p", {}, "It is shown apart until then. What it means for the machine stays.");
  dialog(element("h2", {}, `Shelve: ${a.text}`), element("label", {}, "Minutes", minutes), element("label", {}, "Reason", reason), said, element("div", { className: "buttons" }, submit, button("Cancel", close)));
}

function showSession() {
  byId("who").textContent = model.session ? `${model.session.name} (${model.session.role})` : "read only";
  byId("sign").textContent = model.session ? "Sign out" : "Sign in";
  buildControl();
}

export function start() {
  on("shelve", shelve);
  buildValues();
  showSession();
  byId("sign").hidden = byId("who").hidden = model.catalogue.source !== "live";
  byId("sign").addEventListener("click", signIn);
  on("frame", (frame) => (showValues(frame), showControl()));
  on("session", showSession);
  on("touched", touched);
  on("force", force);
  on("lost", () => end("Control has ended: no connection"));
}
