// What is known: the catalogue, the newest frame, and how values are written.  No page elements here.
const listeners = new Map();
export const model = { catalogue: null, place: new Map(), frame: null, alarms: { list: [], past: [] }, work: null, modbus: null, stale: true, session: null };

export function on(kind, action) {
  if (!listeners.has(kind)) listeners.set(kind, []);
  listeners.get(kind).push(action);
}

export function tell(kind, content) {
  for (const action of listeners.get(kind) ?? []) action(content);
}

export class Refused extends Error {}

export async function ask(path, body) {
  const headers = model.session ? { Authorization: `Bearer ${model.session.key}` } : {};
  const options = body === undefined ? { headers } : { method: "POST", body: JSON.stringify(body), headers: { ...headers, "Content-Type": "application/json" } };
  const answer = await fetch(path, options);
  const content = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(content.error ?? `refused (${answer.status})`);
  return content;
}

export function learn(catalogue) {
  model.catalogue = catalogue;
  model.place = new Map(catalogue.signals.map((s, i) => [s.name, i]));
}

// The value of a signal in SI; NaN where nothing is known.
export function value(name, frame = model.frame) {
  const v = frame?.v[model.place.get(name)];
  return v === null || v === undefined ? NaN : v;
}

export function status(name, frame = model.frame) {
  return Number(frame?.s[model.place.get(name)] ?? 1);
}

export const signal = (name) => model.catalogue.signals[model.place.get(name)];
export const shown = (s, x) => x * s.factor + s.offset;
export const kept = (s, x) => (x - s.offset) / s.factor;

// A value as operators read it, with as many digits as are worth it.
export function text(s, x) {
  if (x === null || !Number.isFinite(x)) return "–";
  if (s.values && s.values[x] !== undefined) return s.values[x].replaceAll("_", " ");
  const y = shown(s, x);
  if (Number.isInteger(x) && s.unit === "") return String(x).replace("-", "−");
  const size = Math.abs(y);
  return y.toFixed(size >= 1000 ? 0 : size >= 10 ? 1 : 2).replace("-", "−");
}

export function mode(frame = model.frame) {
  const x = value("control_mode", frame);
  return Number.isFinite(x) ? model.catalogue.modes[x] ?? "?" : "–";
}

export function time(t, parts = { hour: "2-digit", minute: "2-digit", second: "2-digit" }) {
  if (model.catalogue?.clock === "run") return `${t.toFixed(1)} s`;
  return new Date(1000 * t).toLocaleTimeString(undefined, { hour12: false, ...parts });
}

// To the millisecond: when something happened.
export function exact(t) {
  if (model.catalogue?.clock === "run") return `${t.toFixed(3)} s`;
  return time(t, { hour: "2-digit", minute: "2-digit", second: "2-digit", fractionalSecondDigits: 3 });
}

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, x] of Object.entries(attributes)) key in made ? (made[key] = x) : made.setAttribute(key, x);
  made.append(...children); // strings become text, never markup
  return made;
}

export const byId = (id) => document.getElementById(id);

let hide = 0;
export function toast(message) {
  const shownAt = byId("toast");
  shownAt.textContent = message;
  shownAt.hidden = false;
  clearTimeout(hide);
  hide = setTimeout(() => (shownAt.hidden = true), 6000);
}

// Do something that may be refused, and say so if it is.
export async function attempt(action) {
  try {
    return await action();
  } catch (error) {
    toast(error instanceof Refused ? error.message : "no answer from the controller's computer");
    return undefined;
  }
}
