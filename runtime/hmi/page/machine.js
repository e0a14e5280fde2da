// The machine from above and from the side, drawn from the geometry of the specs and the sensors.
import { model, on, tell, value, byId } from "./model.js";

const NS = "http://www.w3.org/2000/svg";
const TRAIL_S = 20;
const SPAN = 19.5; // m to each side, above
export const views = {};
let trail = [];

export function make(parent, name, attributes) {
  const made = document.createElementNS(NS, name);
  for (const [key, x] of Object.entries(attributes)) made.setAttribute(key, x);
  parent.append(made);
  return made;
}

function put(node, attributes) {
  for (const [key, x] of Object.entries(attributes)) node.setAttribute(key, Number.isFinite(x) ? x.toFixed(3) : x);
}

// Where everything is, in m: x forward at slew angle 0, y left, z up (kinematics of fmus/equations).
export function pose(frame) {
  const g = model.catalogue.shape;
  const [slew, boom, stick] = ["q_slew", "q_boom", "q_stick"].map((n) => value(n, frame));
  const sway = ["imu_tool_roll", "imu_tool_pitch"].map((n) => value(n, frame)).map((x) => (Number.isFinite(x) ? x : 0));
  const elbow = [g.boom_foot_x + g.boom_length * Math.cos(boom), g.boom_foot_z + g.boom_length * Math.sin(boom)];
  const tip = [elbow[0] + g.stick_length * Math.cos(boom + stick), elbow[1] + g.stick_length * Math.sin(boom + stick)];
  const out = -g.tool_length * Math.sin(sway[1]); // pitch: towards the slew axis
  const left = g.tool_length * Math.sin(sway[0]); // roll: to the left
  const down = g.tool_length * Math.cos(sway[0]) * Math.cos(sway[1]);
  const radius = tip[0] + out;
  const grab = [radius * Math.cos(slew) - left * Math.sin(slew), radius * Math.sin(slew) + left * Math.cos(slew), tip[1] - down];
  return { slew, boom, stick, sway, elbow, tip, grab, radius, left, known: Number.isFinite(slew + boom + stick) };
}

function crosshair(parent, kind) {
  const group = make(parent, "g", { class: kind, visibility: "hidden" });
  make(group, "circle", { r: 0.55 });
  make(group, "path", { d: "M-1 0h0.7M1 0h-0.7M0 -1v0.7M0 1v-0.7" });
  return group;
}

function drawAbove(svg) {
  const g = model.catalogue.shape;
  svg.setAttribute("viewBox", `${-SPAN} ${-SPAN} ${2 * SPAN} ${2 * SPAN}`);
  const still = make(svg, "g", { "stroke-width": 0.08 });
  for (const r of [5, 10, 15]) {
    make(still, "circle", { r, class: "ring" });
    make(still, "text", { x: 0.2, y: -r - 0.2, "font-size": 1.2 }).textContent = `${r} m`;
  }
  make(still, "circle", { r: g.keepout_radius, class: "keepout" });
  make(still, "rect", { x: -2.6, y: -1.5, width: 5.2, height: 3, rx: 0.3, class: "under" });
  for (const x of [-2.2, 1.2]) for (const y of [-1.9, 1.3]) make(still, "rect", { x, y, width: 1.1, height: 0.6, class: "wheel" });
  const found = (views.above = { svg });
  found.trail = make(svg, "polyline", { class: "trail", "stroke-width": 0.12 });
  found.turn = make(svg, "g", { "stroke-width": 0.12 });
  const box = (x, y, l, w, h) => make(found.turn, "rect", { x: x - l / 2, y: -y - w / 2, width: l, height: w, rx: 0.2, class: h });
  box(g.carriage_x, 0, g.carriage_length, g.carriage_width, "body");
  box(g.cabin_x, g.cabin_y, g.cabin_length, g.cabin_width, "body");
  found.boom = make(found.turn, "line", { x1: g.boom_foot_x, y1: 0, y2: 0, class: "arm", "stroke-width": 0.7 });
  found.stick = make(found.turn, "line", { y1: 0, y2: 0, class: "arm", "stroke-width": 0.42 });
  found.rope = make(found.turn, "line", { y1: 0, class: "rope", "stroke-width": 0.1 });
  found.grab = make(found.turn, "circle", { r: 0.62, class: "grab" });
  found.target = crosshair(svg, "target");
  found.draft = crosshair(svg, "draft");
}

function drawSide(svg) {
  const g = model.catalogue.shape;
  svg.setAttribute("viewBox", "-5 -16.2 25 18.4");
  const still = make(svg, "g", { "stroke-width": 0.08 });
  make(still, "rect", { x: -5, y: 0, width: 25, height: 2.2, class: "ground" });
  make(still, "rect", { x: -5, y: -g.keepout_height, width: 25, height: g.keepout_height, class: "keepout" });
  for (const h of [5, 10, 15]) {
    make(still, "line", { x1: -5, x2: 20, y1: -h, y2: -h, class: "ring" });
    make(still, "text", { x: 18.1, y: -h - 0.15, "font-size": 0.75 }).textContent = `${h} m`;
  }
  make(still, "text", { x: 15.1, y: -g.keepout_height + 0.8, "font-size": 0.75 }).textContent = "keep-out";
  make(still, "rect", { x: -2.6, y: -1.2, width: 5.2, height: 0.7, class: "under" });
  for (const x of [-1.6, 1.6]) make(still, "circle", { cx: x, cy: -0.6, r: 0.6, class: "wheel" });
  const deck = 1.3;
  make(still, "rect", { x: g.carriage_x - g.carriage_length / 2, y: -deck - g.carriage_height, width: g.carriage_length, height: g.carriage_height, rx: 0.2, class: "body" });
  make(still, "rect", { x: g.cabin_x - g.cabin_length / 2, y: -deck - g.cabin_height, width: g.cabin_length, height: g.cabin_height, rx: 0.2, class: "body" });
  const found = (views.side = { svg });
  found.trail = make(svg, "polyline", { class: "trail", "stroke-width": 0.1 });
  const moving = make(svg, "g", {});
  found.boom = make(moving, "line", { x1: g.boom_foot_x, y1: -g.boom_foot_z, class: "arm", "stroke-width": 0.62 });
  found.stick = make(moving, "line", { class: "arm", "stroke-width": 0.38 });
  found.rope = make(moving, "line", { class: "rope", "stroke-width": 0.12 });
  make(moving, "circle", { cx: g.boom_foot_x, cy: -g.boom_foot_z, r: 0.3, class: "joint", "stroke-width": 0.12 });
  found.elbow = make(moving, "circle", { r: 0.3, class: "joint", "stroke-width": 0.12 });
  found.grab = make(moving, "path", { class: "grab", d: "M-0.3 -0.25h0.6l0.35 0.6l-0.4 0.6l-0.25 -0.35l-0.25 0.35l-0.4 -0.6z" });
  found.target = crosshair(svg, "target");
  found.draft = crosshair(svg, "draft");
}

function show(frame) {
  const p = pose(frame);
  if (!p.known) return;
  const { above, side } = views;
  put(above.turn, { transform: `rotate(${((-p.slew * 180) / Math.PI).toFixed(3)})` });
  put(above.boom, { x2: p.elbow[0] });
  put(above.stick, { x1: p.elbow[0], x2: p.tip[0] });
  put(above.rope, { x1: p.tip[0], x2: p.radius, y2: -p.left });
  put(above.grab, { cx: p.radius, cy: -p.left });
  put(side.boom, { x2: p.elbow[0], y2: -p.elbow[1] });
  put(side.stick, { x1: p.elbow[0], y1: -p.elbow[1], x2: p.tip[0], y2: -p.tip[1] });
  put(side.elbow, { cx: p.elbow[0], cy: -p.elbow[1] });
  put(side.rope, { x1: p.tip[0], y1: -p.tip[1], x2: p.radius, y2: -p.grab[2] });
  put(side.grab, { transform: `translate(${p.radius.toFixed(3)} ${(-p.grab[2]).toFixed(3)}) rotate(${((p.sway[1] * 180) / Math.PI).toFixed(2)})` });
  follow(frame, p);
  const wanted = ["target_x", "target_y", "target_z"].map((n) => value(n, frame));
  mark("target", value("target_valid", frame) > 0.5 ? wanted : null);
}

function follow(frame, p) {
  const last = trail.at(-1);
  if (last && (frame.t < last.t || frame.t - last.t > 2)) trail = [];
  trail.push({ t: frame.t, x: p.grab[0], y: -p.grab[1], r: p.radius, z: -p.grab[2] });
  while (frame.t - trail[0].t > TRAIL_S) trail.shift();
  views.above.trail.setAttribute("points", trail.map((q) => `${q.x.toFixed(2)},${q.y.toFixed(2)}`).join(" "));
  views.side.trail.setAttribute("points", trail.map((q) => `${q.r.toFixed(2)},${q.z.toFixed(2)}`).join(" "));
}

// Put a cross-hair at (x, y, z) m into both views; null takes it away.
export function mark(kind, at) {
  for (const view of Object.values(views)) view[kind].setAttribute("visibility", at && at.every(Number.isFinite) ? "visible" : "hidden");
  if (!at || !at.every(Number.isFinite)) return;
  put(views.above[kind], { transform: `translate(${at[0]} ${-at[1]})` });
  put(views.side[kind], { transform: `translate(${Math.hypot(at[0], at[1])} ${-at[2]})` });
}

function touched(view, event) {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(view.svg.getScreenCTM().inverse());
  return view === views.above ? { x: point.x, y: -point.y } : { radius: Math.max(0, point.x), z: -point.y };
}

export function start() {
  drawAbove(byId("above"));
  drawSide(byId("side"));
  on("frame", show);
  for (const view of Object.values(views)) view.svg.addEventListener("click", (event) => tell("touched", touched(view, event)));
}
