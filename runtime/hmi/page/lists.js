// Alarms, the audit log, statistics of cycles and bus, and all signals.  Whatever comes from outside is text.
import { model, on, tell, ask, attempt, byId, element, value, status, text, signal, shown, kept, exact, mode } from "./model.js";

const MARKS = { critical: "!!", warning: "!", note: "F" };
const mark = (level) => element("span", { className: `mark ${level}`, title: level }, MARKS[level] ?? "?");
const cell = (content, className = "") => element("td", { className }, content);

const state = (a) => (a.shelved ? "shelved" : a.gone === null ? "present" : "gone");

// The alarms that the fields above the list ask for.
function chosen() {
  const [find, how, level] = ["alarm-find", "alarm-state", "alarm-level"].map((id) => byId(id).value);
  const words = find.toLowerCase();
  return [...model.alarms.list, ...model.alarms.past].filter((a) => `${a.text} ${a.cause}`.toLowerCase().includes(words) && (!how || state(a) === how) && (!level || a.level === level));
}

// What is shown, as a file; a text that a spreadsheet would take for a formula is marked as text.
function save() {
  const quoted = (x) => `"${String(x ?? "").replace(/^[=+\-@\t\r]/, "'$&").replaceAll('"', '""')}"`;
  const when = (t) => (t === null ? "" : model.catalogue.clock === "run" ? t.toFixed(3) : new Date(1000 * t).toISOString());
  const rows = chosen().map((a) => [when(a.since), when(a.gone), a.level, state(a), a.text, a.cause, a.acknowledged, a.shelved]);
  const lines = [["since", "gone", "priority", "state", "text", "cause", "acknowledged_by", "shelved"], ...rows].map((r) => r.map(quoted).join(","));
  const link = element("a", { href: URL.createObjectURL(new Blob([`${lines.join("\r\n")}\r\n`], { type: "text/csv" })), download: "alarms.csv" });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function shelving(a) {
  if (!model.session || a.gone !== null || a.level === "critical") return "";
  const button = element("button", { type: "button" }, a.shelved ? "Unshelve" : "Shelve …");
  button.addEventListener("click", () => (a.shelved ? attempt(() => ask("api/unshelve", { number: a.number })) : tell("shelve", a)));
  return button;
}

function showAlarms() {
  const { list } = model.alarms;
  const operator = Boolean(model.session);
  const rows = chosen().map((a) => {
    const button = element("button", { type: "button" }, "Acknowledge");
    button.addEventListener("click", () => attempt(() => ask("api/acknowledge", { number: a.number })));
    const how = a.shelved || (a.gone === null ? "present" : `gone\u00a0${exact(a.gone)}`);
    const by = a.acknowledged && a.acknowledged !== "–" ? `, seen by ${a.acknowledged}` : "";
    const last = list.includes(a) && !a.acknowledged && operator ? button : "";
    return element("tr", { className: a.gone === null ? a.level : "gone" }, cell(mark(a.level)), cell(exact(a.since), "time"), cell(a.text), cell(a.cause), element("td", {}, how + by), element("td", {}, last, shelving(a)));
  });
  byId("alarm-list").tBodies[0].replaceChildren(...rows);
  const present = list.filter((a) => a.gone === null).length;
  const open = list.filter((a) => !a.acknowledged).length;
  byId("count").textContent = open ? `(${open})` : "";
  byId("alarm-hint").textContent = model.catalogue.source === "live" ? `${present} present, ${open} not acknowledged${operator ? "" : "; sign in to acknowledge"}` : `${list.length} in this recording`;
  byId("acknowledge-all").hidden = model.catalogue.source !== "live";
  byId("acknowledge-all").disabled = !operator || !open;
}

async function showAudit() {
  const found = await attempt(() => ask("api/audit"));
  const one = (name, x) => (typeof x === "number" && model.place.has(name) ? `${text(signal(name), x)} ${signal(name).unit}`.trim() : String(x));
  const said = (x, name) => (x === undefined || x === null ? "" : typeof x === "object" ? Object.entries(x).map(([k, v]) => `${k} ${one(k, v)}`).join(", ") : one(name, x));
  const rows = (found?.entries ?? []).map((e) => {
    const about = said(e.signal ?? e.alarm);
    const change = e.new === undefined && e.old === undefined ? "" : `${said(e.old, e.signal) || "–"} → ${said(e.new, e.signal) || "–"}`;
    return element("tr", {}, cell(`${new Date(e.time).toLocaleDateString("sv-SE")} ${exact(new Date(e.time) / 1000)}`, "time"), cell(`${said(e.who)} (${said(e.role)})`), cell(`${said(e.what)} ${about}`), cell(change), cell(said(e.result)));
  });
  byId("audit-list").tBodies[0].replaceChildren(...rows);
}

// --- statistics ---

const figure = (name, x) => [element("dt", {}, name), element("dd", {}, x)];
let before = null;

function showWork(work) {
  const rows = [["Cycles", work.ticks], ["Overruns of our own", work.overruns], ["Stolen by the computer", work.stolen], ["Skipped", work.skipped], ["Not recorded", work.unrecorded], ["Latest start", `${(work.late_largest_ns / 1e6).toFixed(2)} ms`], ["Longest work", `${(work.work_largest_ns / 1e6).toFixed(2)} ms`]];
  byId("cycle").replaceChildren(element("b", {}, "Control cycle"), element("dl", { className: "figures" }, ...rows.flatMap(([n, x]) => figure(n, String(x)))));
  histogram(work);
  if (work.heard) bus(work);
}

function histogram(work) {
  const ns = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(ns, "svg");
  svg.setAttribute("viewBox", "0 0 320 220");
  const add = (name, attributes, content = "") => {
    const made = document.createElementNS(ns, name);
    for (const [k, x] of Object.entries(attributes)) made.setAttribute(k, x);
    made.textContent = content;
    svg.append(made);
  };
  [["late", "Start after its deadline", 0], ["work", "Work of a cycle", 110]].forEach(([key, title, y]) => {
    const counts = work[key];
    const most = Math.log10(Math.max(10, ...counts));
    add("text", { x: 0, y: y + 11 }, `${title}; columns: cycles (log), ${counts.reduce((a, b) => a + b, 0)} in all`);
    counts.forEach((n, k) => {
      const tall = n ? Math.max(2, (Math.log10(n + 1) / most) * 68) : 0;
      add("rect", { x: 2 + k * 20, y: y + 88 - tall, width: 16, height: tall, class: "grab" });
      if (k % 3 === 1) add("text", { x: 2 + k * 20, y: y + 101 }, k > 9 ? `<${2 ** (k - 10)} ms` : `<${2 ** k} µs`);
    });
    add("line", { x1: 0, x2: 320, y1: y + 88, y2: y + 88, class: "axis" });
  });
  byId("histogram").replaceChildren(element("b", {}, "How late, how long"), svg);
}

const counted = (n) => (n === undefined ? "–" : n ? element("span", { className: "wrong" }, String(n)) : "0");
const byModbus = () => model.catalogue.writers[model.frame?.writer] === "hmi" || Boolean(model.modbus);

// Who is connected to the Modbus server, and who writes.
function modbus() {
  const m = model.modbus;
  if (!m) return [];
  const writer = m.writer ? `writer ${m.writer}` : `nobody writes${m.last ? ` (${m.last})` : ""}`;
  const others = m.clients.filter((c) => c !== m.writer);
  const rest = others.length ? `; only reading: ${others.slice(0, 8).join(", ")}${others.length > 8 ? ` and ${others.length - 8} more` : ""}` : "";
  const text = `${writer}${rest}; ${m.clients.length} of ${m.places} places; ${m.refused} writes refused${m.displaced ? `; made room: ${m.displaced}` : ""}`;
  return [element("b", {}, "Modbus"), element("p", { id: "modbus" }, text)];
}

function bus(work) {
  const past = before && work.t > before.t && work.t - before.t < 30 ? before : null;
  if (!before || work.t - before.t > 4 || work.t < before.t) before = work;
  const rates = model.catalogue.messages.map((m, i) => (past ? (work.heard[i] - past.heard[i]) / (work.t - past.t) : NaN));
  const heard = model.catalogue.messages.reduce((sum, m, i) => sum + (rates[i] || 0) * m.bits, 0);
  const load = (100 * (heard + model.catalogue.sent_bits_per_s)) / model.catalogue.bit_rate;
  const rows = model.catalogue.messages.map((m, i) => {
    const age = model.frame?.a[i] ?? -1;
    const ms = age * 1000 * model.catalogue.tick_s;
    const elsewhere = m.sender === "Planner" && !(rates[i] > 0) && byModbus(); // its targets come another way
    const none = m.sender === "Policy" && age < 0; // most machines have none outside
    const late = !elsewhere && !none && (age < 0 || (m.timeout_ms && ms >= m.timeout_ms));
    const shownAge = element("span", { className: late ? "wrong" : "" }, elsewhere ? "by Modbus" : age < 0 ? "never" : ms > 9999 ? "> 10 s" : `${Math.round(ms)} ms`);
    return element("tr", { title: m.description }, cell(m.name), cell(m.sender), cell(Number.isFinite(rates[i]) ? rates[i].toFixed(1) : "–", "number"), cell((1000 / m.cycle_ms).toFixed(0), "number"), cell(shownAge, "number"), cell(counted(work.refused?.[i]), "number"), cell(counted(work.repeated?.[i]), "number"));
  });
  const head = element("tr", {}, ...["Message heard", "From", "a second", "due", "Age", "Refused", "Repeated"].map((x, i) => element("th", { className: i > 1 ? "number" : "" }, x)));
  const table = element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows));
  byId("bus").replaceChildren(...modbus(), element("b", {}, past ? `CAN bus: load at most ${load.toFixed(0)} % (messages heard and sent, as long as they can be)` : "CAN bus"), table);
}

// --- signals ---

const GROUPS = [["sensor", "Sensors"], ["operator", "Operator"], ["machine", "Machine"], ["planner", "Targets"], ["information", "Other"], ["own", "Controller"]];
let group = "sensor";
let rows = [];

function buildSignals() {
  byId("signal-bar").replaceChildren();
  for (const [key, title] of GROUPS) {
    const button = element("button", { type: "button", ariaPressed: String(key === group) }, title);
    button.addEventListener("click", () => ((group = key), buildSignals(), showSignals()));
    byId("signal-bar").append(button);
  }
  const hint = element("span", { className: "grow", id: "force-hint" });
  byId("signal-bar").append(hint);
  if (model.session) {
    const end = element("button", { type: "button", id: "unforce" }, "End forcing");
    end.addEventListener("click", () => attempt(() => ask("api/force/end", {})));
    byId("signal-bar").append(end);
  }
  rows = model.catalogue.signals.filter((s) => s.group === group).map((s) => {
    const found = { s, value: cell("", "number"), status: element("span"), age: cell("", "number"), button: null };
    const last = element("td");
    if (s.forceable && model.session?.role === "service") {
      found.button = element("button", { type: "button" }, "Force …");
      found.button.addEventListener("click", () => tell("force", s));
      last.append(found.button);
    }
    found.row = element("tr", {}, cell(s.name), cell(s.description), found.value, cell(s.unit), cell(found.status), found.age, last);
    return found;
  });
  byId("signal-list").tBodies[0].replaceChildren(...rows.map((r) => r.row));
}

function showSignals() {
  if (!model.frame) return;
  const ages = new Map(model.catalogue.messages.map((m, i) => [m.name, model.frame.a[i]]));
  for (const r of rows) {
    const how = status(r.s.name);
    r.value.textContent = text(r.s, value(r.s.name));
    r.status.textContent = model.catalogue.statuses[how] ?? "?";
    r.status.className = how === 8 ? "is-forced" : how > 1 ? "wrong" : "";
    const age = r.s.side === "input" ? ages.get(r.s.message) : undefined;
    r.age.textContent = age === undefined || age < 0 ? "–" : age > 500 ? "> 10 s" : `${Math.round(age * 1000 * model.catalogue.tick_s)} ms`;
    if (r.button) r.button.disabled = mode() !== "standby";
  }
  const by = model.frame.forced_by;
  const hint = byId("force-hint");
  if (hint) hint.textContent = by ? `Forced by ${by}` : model.session?.role === "service" && mode() !== "standby" ? "Sensors are forced in STANDBY only" : "";
}

export function start() {
  on("alarms", showAlarms);
  on("session", () => (buildSignals(), showSignals(), showAlarms()));
  on("work", (work) => !byId("statistics").hidden && showWork(work));
  on("frame", () => !byId("signals").hidden && showSignals());
  on("page", (page) => {
    if (page === "statistics" && model.work) showWork(model.work);
    if (page === "signals") showSignals();
  });
  byId("acknowledge-all").addEventListener("click", () => attempt(() => ask("api/acknowledge", {})));
  for (const id of ["alarm-find", "alarm-state", "alarm-level"]) byId(id).addEventListener("input", showAlarms);
  byId("alarm-save").addEventListener("click", save);
  byId("audit-load").addEventListener("click", showAudit);
  const live = model.catalogue.source === "live";
  byId("audit-bar").hidden = byId("audit-panel").hidden = !live;
  buildSignals();
  showAlarms();
}

export { shown, kept, signal };
