// What stands around the machine: drawn from above and in the plane of the arm, with the planned way and the clearance.
import { model, on, value, byId, element, signal } from "./model.js";
import { make, pose, views } from "./machine.js";

const GUARDED = 8192; // in a frame's flags: the guard limits the controller
const SIDE_M = 1.0; // of the arm's plane: what stands so near to it is in its way
const BESIDE_M = 4.0; // and so near: it is seen behind it, fainter
const FRAME = [[-5, -2.2], [20, -2.2], [20, 16.2], [-5, 16.2]]; // of the side view: radius and height
const HELD_S = 1; // that the guard's last word stays to be read
const solids = [];
const ways = [];
let guard = { t: -Infinity, part: "" };

// What of a convex polygon lies where a x + b y ≥ c.
export function clip(polygon, a, b, c) {
  const found = [];
  polygon.forEach((p, i) => {
    const q = polygon[(i + 1) % polygon.length];
    const [s, t] = [a * p[0] + b * p[1] - c, a * q[0] + b * q[1] - c];
    if (s >= 0) found.push(p);
    if (s * t < 0) found.push([0, 1].map((k) => p[k] + (s / (s - t)) * (q[k] - p[k])));
  });
  return found;
}

const points = (polygon) => polygon.map(([x, y]) => `${x.toFixed(3)},${(-y).toFixed(3)}`).join(" ");

// How far from its place a solid is at a time of the run.
function away(path, t) {
  if (!path.length) return [0, 0, 0];
  const i = path.findIndex((row) => row[0] > t);
  if (i <= 0) return path.at(i).slice(1);
  const [a, b] = [path[i - 1], path[i]];
  return [1, 2, 3].map((k) => a[k] + ((t - a[0]) / (b[0] - a[0])) * (b[k] - a[k]));
}

// A solid in the plane of the arm: radius and height of its corners.
function section(solid, slew, by, side) {
  const [c, s] = [Math.cos(slew), Math.sin(slew)];
  if (solid.plane) {
    const [x, y, z, offset] = solid.plane;
    return clip(FRAME, -(x * c + y * s), -z, -(offset + x * by[0] + y * by[1] + z * by[2]));
  }
  const turned = solid.outline.map(([x, y]) => [(x + by[0]) * c + (y + by[1]) * s, (y + by[1]) * c - (x + by[0]) * s]);
  const strip = clip(clip(turned, 0, 1, -side), 0, -1, -side);
  if (!strip.length) return [];
  const [near, far] = [Math.min(...strip.map((p) => p[0])), Math.max(...strip.map((p) => p[0]))];
  const [low, high] = solid.z.map((z) => z + by[2]);
  return [[near, low], [far, low], [far, high], [near, high]];
}

function build(around) {
  const layers = Object.values(views).map((view) => {
    const group = make(view.svg, "g", {});
    view.svg.insertBefore(group, view.trail);
    return group;
  });
  for (const solid of around.solids) {
    const shapes = layers.map((layer) => {
      const shape = make(layer, "polygon", { class: `around ${solid.kind}` });
      make(shape, "title", {}).textContent = solid.name;
      return shape;
    });
    shapes[0].setAttribute("points", points(solid.outline));
    solids.push({ ...solid, shapes });
  }
  for (const way of around.ways) {
    const shapes = layers.map((layer) => make(layer, "polyline", { class: "way" }));
    shapes[0].setAttribute("points", points(way));
    shapes[1].setAttribute("points", points(way.map(([x, y, z]) => [Math.hypot(x, y), z])));
    ways.push(shapes);
  }
  for (const [x, y, z] of around.targets) {
    const at = [[x, y], [Math.hypot(x, y), z]];
    layers.forEach((layer, i) => make(layer, "circle", { cx: at[i][0], cy: -at[i][1], r: around.tolerance, class: "goal" }));
  }
}

function show(frame) {
  const p = pose(frame);
  const t = frame.t - (model.catalogue.begin ?? 0);
  const nearest = read(frame);
  for (const solid of solids) {
    const by = away(solid.path, t);
    if (solid.path.length) solid.shapes[0].setAttribute("transform", `translate(${by[0].toFixed(3)} ${(-by[1]).toFixed(3)})`);
    if (p.known) showSide(solid, p.slew, by);
    for (const shape of solid.shapes) shape.classList.toggle("nearest", solid.name === nearest);
  }
}

function showSide(solid, slew, by) {
  const there = section(solid, slew, by, SIDE_M);
  const shape = solid.shapes[1];
  shape.classList.toggle("beside", !there.length);
  shape.setAttribute("points", points(there.length ? there : section(solid, slew, by, BESIDE_M)));
}

// The clearance in words, and when the guard steps in, for which part of the machine; the name of what is nearest to it.
function read(frame) {
  const part = value("guard_part", frame);
  const on_ = part > 0 || (frame.flags & GUARDED) !== 0;
  if (on_) guard = { t: frame.t, part: part > 0 ? signal("guard_part").values[part] : guard.part };
  const held = frame.t >= guard.t && frame.t - guard.t < HELD_S;
  const near = frame.near ?? [];
  const of = (held && near.find((n) => n[0] === guard.part)) || near[0];
  const at = byId("clearance");
  at.hidden = !held && !model.catalogue.around;
  at.classList.toggle("warning", held);
  const far = of ? element("b", {}, `${of[1].toFixed(2).replace("-", "−")} m`) : "";
  if (held) at.replaceChildren(element("span", { className: "mark" }, "!"), `Guard steps in: ${guard.part} `, far, of ? ` to ${of[2]}` : "");
  else at.replaceChildren(of ? "Clearance " : "Clearance not known", far, of ? `, ${of[0]} to ${of[2]}` : "");
  return of?.[2];
}

export function start() {
  const around = model.catalogue.around;
  if (around) {
    build(around);
    byId("clearance").title = `to the nearest of ${around.whose} scene ${around.name}, the ground left out; not what the guard needs for braking`;
    byId("clearance").hidden = false;
  }
  on("frame", show);
}
