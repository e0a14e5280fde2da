// The scope over the trends: hold what is shown, read it with two cursors, or let a trigger hold it.
import { model, on, tell, byId, element, value, signal, text, shown, exact } from "./model.js";

const GAP_S = 2; // between samples: nothing is read in between
const AFTER = 0.5; // of the span that is shown after the trigger
const scope = { held: null, cursors: [], armed: null, found: null };
let before = null; // {t, v} of the trigger's signal in the frame before
let get = () => ({ span: 60, chosen: [], series: new Map() });

// What is drawn: {now, series}, as it comes or as it was held; nothing to draw without a frame.
export const view = () => scope.held ?? (model.frame ? { now: model.frame.t, series: get().series } : null);
export const cursors = () => scope.cursors;
export const trigger = () => scope.armed ?? scope.found;

export function hold(now) {
  const copy = new Map([...get().series].map(([name, s]) => [name, { t: [...s.t], v: [...s.v] }]));
  scope.held = now === null ? null : { now, series: copy };
  changed();
}

// A cursor at a time: the first A, the second B, then anew.
export function place(t) {
  scope.cursors = scope.cursors.length === 1 ? [...scope.cursors, t] : [t];
  changed();
}

// The value of a signal at a time, on a straight line between samples; of a word, that of the sample before.
export function at(name, t, series) {
  const s = series.get(name) ?? { t: [], v: [] };
  const i = s.t.findLastIndex((x) => x <= t);
  if (i < 0) return NaN;
  if (i + 1 >= s.t.length || signal(name).values) return t - s.t[i] > GAP_S ? NaN : s.v[i];
  const [a, b] = [s.t[i], s.t[i + 1]];
  return b - a > GAP_S ? NaN : s.v[i] + ((s.v[i + 1] - s.v[i]) * (t - a)) / (b - a);
}

function watch(frame) {
  const wanted = scope.armed;
  if (wanted) {
    const now = { t: frame.t, v: shown(signal(wanted.name), value(wanted.name, frame)) };
    const sign = wanted.rising ? 1 : -1;
    const step = before ? now.t - before.t : 0;
    if (step > 0 && step <= GAP_S && sign * (before.v - wanted.level) < 0 && sign * (now.v - wanted.level) >= 0) {
      const share = (wanted.level - before.v) / (now.v - before.v);
      Object.assign(scope, { armed: null, found: { ...wanted, t: before.t + share * step } });
      changed();
    }
    before = now;
  }
  if (scope.found && !scope.held && !scope.found.shown && frame.t >= scope.found.t + AFTER * get().span) {
    scope.found.shown = true;
    hold(scope.found.t + AFTER * get().span);
  }
}

function arm() {
  const [name, level] = [byId("scope-signal").value, Number(byId("scope-level").value)];
  before = null;
  const armed = name && !scope.armed ? { name, level, rising: byId("scope-edge").value === "rises" } : null;
  Object.assign(scope, { armed, found: null });
  hold(null);
}

function state() {
  if (scope.armed) return `waits until ${scope.armed.name} ${scope.armed.rising ? "rises above" : "falls below"} ${scope.armed.level}`;
  const held = scope.held ? "held" : "";
  return scope.found ? `triggered at ${exact(scope.found.t)}${held ? ", held" : ""}` : held;
}

function lines() {
  const now = view();
  if (!scope.cursors.length || !now) return [];
  const [a, b] = scope.cursors;
  const head = b === undefined ? `A ${exact(a)}` : `A ${exact(a)}, B ${exact(b)}, B − A ${(b - a).toFixed(3)} s`;
  const one = (name) => {
    const s = signal(name);
    const [x, y] = [at(name, a, now.series), b === undefined ? NaN : at(name, b, now.series)];
    const difference = s.values || b === undefined ? "" : ` (${text({ ...s, offset: 0 }, y - x)})`;
    return `${name} ${text(s, x)}${b === undefined ? "" : ` → ${text(s, y)}`}${difference} ${s.unit}`.trim();
  };
  return [head, ...get().chosen.map(one)];
}

export function changed() {
  byId("scope-state").textContent = state();
  byId("scope-hold").textContent = scope.held ? "Go on" : "Hold";
  byId("scope-arm").textContent = scope.armed ? "Disarm" : "Arm";
  byId("scope-arm").disabled = !byId("scope-signal").value;
  byId("scope-clear").disabled = !scope.cursors.length;
  byId("scope-read").replaceChildren(...lines().map((x) => element("span", {}, x)));
  tell("scope");
}

// The trigger may be any of the signals that are shown.
export function offer(names) {
  const select = byId("scope-signal");
  const kept = names.includes(select.value) ? select.value : "";
  select.replaceChildren(element("option", { value: "" }, "Trigger …"), ...names.map((n) => element("option", { value: n, selected: n === kept }, signal(n).unit ? `${n} [${signal(n).unit}]` : n)));
  changed();
}

// `shows`: the span in s, the chosen signals and their series, as they are at that moment.
export function start(shows) {
  get = shows;
  const button = (id, title, action) => {
    const made = element("button", { type: "button", id }, title);
    made.addEventListener("click", action);
    return made;
  };
  const select = element("select", { id: "scope-signal", ariaLabel: "Signal that triggers" });
  select.addEventListener("change", () => ((scope.armed = null), changed()));
  const edge = element("select", { id: "scope-edge", ariaLabel: "Edge" }, element("option", { value: "rises" }, "rises above"), element("option", { value: "falls" }, "falls below"));
  const level = element("input", { id: "scope-level", type: "number", step: "any", value: "0", ariaLabel: "Level" });
  const holding = button("scope-hold", "Hold", () => (scope.held ? hold(null) : model.frame && hold(model.frame.t)));
  const clear = button("scope-clear", "Cursors off", () => ((scope.cursors = []), changed()));
  byId("scope-bar").append(select, edge, level, button("scope-arm", "Arm", arm), element("output", { id: "scope-state", className: "grow" }), holding, clear);
  on("frame", watch);
}
