"use strict";
// The robot moving along its plan: kinematics, a small renderer on a 2D canvas, the controls.
// A body is a capsule; its outline is two circles and their tangents, painted from far to near.

const plan = JSON.parse(document.getElementById("plan").textContent);
const canvas = document.getElementById("canvas");
const pen = canvas.getContext("2d");
const byId = (id) => document.getElementById(id);
const rad = (degrees) => degrees * Math.PI / 180;
const deg = (radians) => radians * 180 / Math.PI;

// Poses are 12 numbers, three rows of rotation and place.
const I = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
function times(a, b) {
  const out = new Array(12);
  for (let r = 0; r < 12; r += 4) {
    for (let c = 0; c < 4; c++) {
      out[r + c] = a[r] * b[c] + a[r + 1] * b[4 + c] + a[r + 2] * b[8 + c] + (c === 3 ? a[r + 3] : 0);
    }
  }
  return out;
}
const at = (T, [x, y, z]) => [0, 4, 8].map((r) => T[r] * x + T[r + 1] * y + T[r + 2] * z + T[r + 3]);
const shift = ([x, y, z]) => [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z];
function turn([x, y, z], angle) { // about one of the axes, either sense
  const c = Math.cos(angle), s = Math.sin(angle) * (x + y + z);
  if (x) return [1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0];
  if (y) return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0];
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0];
}
function inverse(T) {
  const R = [T[0], T[4], T[8], 0, T[1], T[5], T[9], 0, T[2], T[6], T[10], 0];
  const p = at(R, [T[3], T[7], T[11]]);
  R[3] = -p[0]; R[7] = -p[1]; R[11] = -p[2];
  return R;
}

// Joints, and the platform as tilt x, tilt y, heave, between the rows of the plan.
function state(t) {
  const last = plan.rows.length - 1;
  const whole = Math.min(Math.max(t / plan.step_s, 0), last);
  const k = Math.min(Math.floor(whole), Math.max(last - 1, 0));
  const share = whole - k, a = plan.rows[k], b = plan.rows[Math.min(k + 1, last)];
  return a.map((value, i) => value + share * (b[i] - value));
}

// As the Python side has it: Rz(s) Ry(t) Rz(-s), shifted by d/2 (1 - cos t) (-cos 2s, sin 2s).
function platform([x, y, heave]) {
  const t = Math.hypot(x, y), s = Math.atan2(y, x);
  const aside = plan.wrist.platform / 2 * (1 - Math.cos(t));
  const Z = [0, 0, 1];
  const turned = times(times(turn(Z, s), turn([0, 1, 0], t)), turn(Z, -s));
  return times(shift([-aside * Math.cos(2 * s), aside * Math.sin(2 * s), heave]), turned);
}

// Frames of base, links 1 to 6, wrist and platform.
function frames(now) {
  const list = [I];
  for (let k = 0; k < 6; k++) {
    const axis = plan.axes[k];
    list.push(times(times(list[k], shift(axis.at)), turn(axis.sense, rad(now[k]))));
  }
  const flange = times(times(list[6], shift(plan.flange.at)), turn([0, 1, 0], plan.flange.pitch));
  list.push(times(times(flange, shift(plan.wrist.at)), turn([0, 0, 1], plan.wrist.yaw)));
  list.push(times(list[7], platform(now.slice(9))));
  return list;
}

function legs(list, now) {
  const { base, crank, coupler, platform: rim, radii } = plan.wrist;
  return [0, 1, 2].flatMap((leg) => {
    const angle = rad(120 * leg), theta = rad(now[6 + leg]);
    const out = [Math.cos(angle), Math.sin(angle)];
    const r = base + crank * Math.sin(theta);
    const joint = at(list[7], [base * out[0], base * out[1], 0]);
    const knee = at(list[7], [r * out[0], r * out[1], crank * Math.cos(theta)]);
    const ball = at(list[8], [rim * out[0], rim * out[1], 0]);
    return [["legs", joint, knee, radii[0]], ["legs", knee, ball, radii[1]]];
  });
}

// --- the view ---------------------------------------------------------------------------------
const eye = { azimuth: rad(-55), elevation: rad(22), distance: 2.6, target: plan.centre.slice() };
let size = [1, 1], axes = [], colours = {}, time = 0, playing = null, asked = false;

function look() {
  const ca = Math.cos(eye.azimuth), sa = Math.sin(eye.azimuth);
  const ce = Math.cos(eye.elevation), se = Math.sin(eye.elevation);
  axes = [[-sa, ca, 0], [-ca * se, -sa * se, ce], [ca * ce, sa * ce, se]];
}
const NEAR = 0.05; // nothing is drawn closer to the eye, m
// A point on the canvas: x, y, pixels per metre there, distance.
function project(p) {
  const d = p.map((value, i) => value - eye.target[i]);
  const [x, y, z] = axes.map((axis) => axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2]);
  const away = Math.max(eye.distance - z, NEAR), scale = 1.9 * Math.min(...size) / away;
  return [size[0] / 2 + x * scale, size[1] / 2 - y * scale, scale, away];
}

// Red, green, blue lighter (towards white) or darker by a share.
function tint(colour, by) {
  const number = parseInt(colour.slice(1), 16);
  const parts = [16, 8, 0].map((bits) => (number >> bits) & 255);
  return `rgb(${parts.map((v) => Math.round(by > 0 ? v + (255 - v) * by : v * (1 + by))).join(" ")})`;
}

function paintCapsule([ax, ay, , ], [bx, by, , ], ra, rb, colour) {
  const dx = bx - ax, dy = by - ay, length = Math.hypot(dx, dy);
  const along = Math.atan2(dy, dx);
  const inside = length <= Math.abs(ra - rb) + 1e-6; // one ball hides the other
  const spread = inside ? 0 : Math.acos((ra - rb) / length);
  const [mx, my, r] = inside && rb > ra ? [bx, by, rb] : inside ? [ax, ay, ra] : [(ax + bx) / 2, (ay + by) / 2, Math.max(ra, rb)];
  // Light from the upper left: across the axis, from the edge towards it to the far edge.
  let nx = -Math.sin(along), ny = Math.cos(along);
  if (nx + ny > 0) { nx = -nx; ny = -ny; }
  if (length < 2) { nx = -Math.SQRT1_2; ny = -Math.SQRT1_2; }
  const shade = pen.createLinearGradient(mx + nx * r, my + ny * r, mx - nx * r, my - ny * r);
  shade.addColorStop(0, tint(colour, -0.12));
  shade.addColorStop(0.3, tint(colour, 0.32));
  shade.addColorStop(0.62, colour);
  shade.addColorStop(1, tint(colour, -0.45));
  pen.fillStyle = shade;
  pen.beginPath();
  if (inside) {
    pen.arc(mx, my, r, 0, 2 * Math.PI);
  } else {
    pen.arc(ax, ay, ra, along + spread, along - spread);
    pen.arc(bx, by, rb, along - spread, along + spread);
  }
  pen.fill();
}

function line(points, colour, width) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.beginPath();
  points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
}

function floor() {
  const half = 0.8;
  for (let k = -8; k <= 8; k++) {
    const v = k / 10;
    line([project([v, -half, 0]), project([v, half, 0])], colours.grid, k ? 1 : 2);
    line([project([-half, v, 0]), project([half, v, 0])], colours.grid, k ? 1 : 2);
  }
}

function triad(T, length) {
  const origin = project([T[3], T[7], T[11]]);
  ["#d0342c", "#2a9d3a", "#2b66c0"].forEach((colour, k) => {
    line([origin, project(at(T, [0, 1, 2].map((i) => (i === k ? length : 0))))], colour, 2);
  });
}

// Boxes by their edges, planes by a grid about the path; each line in short pieces, so that what is
// nearer hides it.
function obstacles(items) {
  const edge = (from, to, width) => {
    const pieces = Math.max(1, Math.ceil(Math.hypot(...to.map((v, i) => v - from[i])) / 0.1));
    const point = (k) => project(from.map((v, i) => v + k / pieces * (to[i] - v)));
    for (let k = 0; k < pieces; k++) {
      const [a, b] = [point(k), point(k + 1)];
      if (Math.min(a[3], b[3]) <= NEAR) continue; // behind the eye
      items.push([(a[3] + b[3]) / 2, () => line([a, b], colours.obstacle, width)]);
    }
  };
  for (const box of plan.boxes) {
    const corner = (k) => at(box.pose, box.half.map((h, i) => ((k >> i) & 1 ? h : -h)));
    for (let k = 0; k < 8; k++) {
      for (const bit of [1, 2, 4]) if (!(k & bit)) edge(corner(k), corner(k | bit), 1.5);
    }
  }
  for (const plane of plan.planes) {
    const [u, v] = plane.across;
    const point = (a, b) => plane.at.map((p, i) => p + a * u[i] + b * v[i]);
    for (let k = -6; k <= 6; k++) {
      const aside = k / 10, half = 0.6, width = Math.abs(k) === 6 ? 1.5 : 0.6;
      edge(point(aside, -half), point(aside, half), width);
      edge(point(-half, aside), point(half, aside), width);
    }
  }
}

function path(items) {
  let before = null;
  plan.path.forEach(([t, x, y, z]) => {
    const here = project([x, y, z]), from = before;
    if (from) {
      const done = t <= time + 1e-9;
      items.push([(from[3] + here[3]) / 2 - 0.01, () => line([from, here], done ? colours.done : colours.path, done ? 3 : 2)]);
    }
    before = here;
  });
}

function bodies(items, list, now) {
  const real = byId("bodies").checked;
  const all = plan.bodies.map(([link, group, begin, end, r]) => [group, at(list[link], begin), at(list[link], end), r]);
  for (const [group, begin, end, r] of all.concat(legs(list, now))) {
    const radius = r * (real ? 1 : plan.slim[group] || 1);
    const pieces = Math.max(1, Math.ceil(Math.hypot(...end.map((v, i) => v - begin[i])) / (2.5 * radius)));
    for (let k = 0; k < pieces; k++) {
      const [a, b] = [k, k + 1].map((n) => project(begin.map((v, i) => v + n / pieces * (end[i] - v))));
      items.push([(a[3] + b[3]) / 2, () => paintCapsule(a, b, radius * a[2], radius * b[2], colours[plan.colour[group]])]);
    }
  }
}

function label(name, x, y, colour) {
  pen.strokeStyle = colours.card;
  pen.strokeText(name, x, y);
  pen.fillStyle = colour;
  pen.fillText(name, x, y);
}
function labels() {
  pen.font = "600 13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.lineWidth = 4;
  for (const box of plan.boxes) {
    const [x, y, , away] = project(at(box.pose, [0, 0, box.half[2]]));
    if (away > NEAR) label(box.name, x, y, colours.obstacle);
  }
  for (const plane of plan.planes) {
    const [x, y, , away] = project(plane.at.map((p, i) => p + 0.6 * plane.across[1][i]));
    if (away > NEAR) label(plane.name, x, y, colours.obstacle);
  }
  for (const point of plan.points) {
    const [x, y] = project(point.at);
    label(point.name, x, y - 9, colours.ink);
    pen.beginPath();
    pen.arc(x, y, 3, 0, 2 * Math.PI);
    pen.fill();
  }
}

function draw() {
  asked = false;
  const now = state(time), list = frames(now), items = [];
  pen.setTransform(canvas.width / size[0], 0, 0, canvas.height / size[1], 0, 0);
  pen.clearRect(0, 0, ...size);
  pen.lineCap = pen.lineJoin = "round";
  look();
  floor();
  triad(plan.base, 0.12);
  path(items);
  obstacles(items);
  bodies(items, list, now);
  items.sort((a, b) => b[0] - a[0]).forEach(([, paint]) => paint());
  const tool = times(list[8], plan.tool);
  triad(tool, 0.06);
  labels();
  tell(now, tool);
}
function ask() {
  if (!asked) { asked = true; requestAnimationFrame(draw); }
}

// --- what is told in words ----------------------------------------------------------------------
const POSE = [["x", "mm"], ["y", "mm"], ["z", "mm"], ["A", "°"], ["B", "°"], ["C", "°"]];
function cells(table, name, more) {
  const row = table.insertRow(), head = document.createElement("th");
  head.scope = "row";
  head.textContent = name;
  row.append(head);
  const value = row.insertCell();
  if (more) more(row);
  return value;
}
const jointCells = plan.joints.map((name, k) => {
  let knob = null;
  const value = cells(byId("joints"), name, (row) => {
    const cell = row.insertCell(), track = document.createElement("span");
    cell.className = "range";
    cell.title = `${plan.ranges[k][0]} to ${plan.ranges[k][1]} degrees`;
    track.className = "track";
    knob = document.createElement("i");
    track.append(knob);
    cell.append(track);
  });
  return [value, knob];
});
const poseCells = POSE.map(([name, unit]) => cells(byId("pose"), name, (row) => {
  const cell = row.insertCell();
  cell.className = "unit";
  cell.textContent = unit;
}));

const said = (value, digits) => {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
};
function tell(now, tool) {
  jointCells.forEach(([value, knob], k) => {
    const [low, high] = plan.ranges[k];
    value.textContent = said(now[k], 2);
    knob.style.left = `${Math.min(Math.max((now[k] - low) / (high - low), 0), 1) * 100}%`;
  });
  const T = times(inverse(plan.base), tool);
  const cosine = Math.hypot(T[0], T[4]);
  const a = cosine < 1e-9 ? Math.atan2(-T[1], T[5]) : Math.atan2(T[4], T[0]);
  const c = cosine < 1e-9 ? 0 : Math.atan2(T[9], T[10]);
  const pose = [T[3] * 1000, T[7] * 1000, T[11] * 1000, deg(a), deg(Math.atan2(-T[8], cosine)), deg(c)];
  pose.forEach((value, k) => {
    const half = k > 2 && 180 - Math.abs(value) < 0.005; // either sign is half a turn
    poseCells[k].textContent = said(half ? 180 : value, 2);
  });
  byId("clock").textContent = `${time.toFixed(2)} / ${plan.duration_s.toFixed(2)} s`;
  byId("time").setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
  if (plan.binding.length) {
    const run = plan.binding.find(([end]) => time <= end) || plan.binding[plan.binding.length - 1];
    byId("binds").hidden = false;
    byId("binds").querySelector("b").textContent = run[1];
  }
}

// --- controls -----------------------------------------------------------------------------------
function go(t) {
  time = Math.min(Math.max(t, 0), plan.duration_s);
  byId("time").value = time;
  ask();
}
function play(on) {
  playing = on ? performance.now() : null;
  byId("play").textContent = on ? "Pause" : "Play";
  byId("play").setAttribute("aria-pressed", String(on));
  if (!on) return;
  if (time >= plan.duration_s) go(0);
  requestAnimationFrame(advance);
}
// With reduced motion the robot is shown twice a second instead of at every frame.
const calm = matchMedia("(prefers-reduced-motion: reduce)");
function advance(now) {
  if (playing === null) return;
  const passed_s = Math.max(now - playing, 0) / 1000;
  if (!calm.matches || passed_s >= 0.5) {
    playing = now;
    go(time + passed_s * Number(byId("rate").value));
    if (time >= plan.duration_s) { play(false); return; }
  }
  requestAnimationFrame(advance);
}
function orbit(turned, raised) {
  eye.azimuth += turned;
  eye.elevation = Math.min(Math.max(eye.elevation + raised, rad(-5)), rad(89.9));
  ask();
}
function zoom(by) {
  eye.distance = Math.min(Math.max(eye.distance * by, 0.25), 8);
  ask();
}
function pan(dx, dy) {
  const metres = eye.distance / (1.9 * Math.min(...size));
  eye.target = eye.target.map((v, i) => v + metres * (dy * axes[1][i] - dx * axes[0][i]));
  ask();
}

byId("play").addEventListener("click", () => play(playing === null));
byId("time").max = plan.duration_s;
byId("time").addEventListener("input", (event) => { play(false); go(Number(event.target.value)); });
byId("bodies").addEventListener("change", ask);
for (const button of document.querySelectorAll(".views button")) {
  button.addEventListener("click", () => {
    eye.azimuth = rad(Number(button.dataset.azimuth));
    eye.elevation = rad(Number(button.dataset.elevation));
    eye.target = plan.centre.slice();
    ask();
  });
}
for (const point of plan.points) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = point.name;
  button.addEventListener("click", () => { play(false); go(point.t); });
  byId("points").append(button);
}

const fingers = new Map();
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const here = [event.clientX, event.clientY], dx = here[0] - before[0], dy = here[1] - before[1];
  const other = [...fingers].find(([id]) => id !== event.pointerId);
  if (other) {
    const apart = (p) => Math.max(Math.hypot(p[0] - other[1][0], p[1] - other[1][1]), 1);
    zoom(apart(before) / apart(here));
    pan(dx / 2, dy / 2);
  } else if (event.shiftKey || event.buttons & 6) {
    pan(dx, dy);
  } else {
    orbit(-dx * 0.008, dy * 0.008);
  }
  fingers.set(event.pointerId, here);
});
for (const name of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
}
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.002));
}, { passive: false });
const KEYS = {
  ArrowLeft: () => orbit(0.1, 0), ArrowRight: () => orbit(-0.1, 0),
  ArrowUp: () => orbit(0, 0.1), ArrowDown: () => orbit(0, -0.1),
  "+": () => zoom(0.9), "=": () => zoom(0.9), "-": () => zoom(1 / 0.9),
};
canvas.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key]();
});
document.addEventListener("keydown", (event) => {
  if (event.target !== document.body && event.target !== canvas) return;
  const keys = { " ": () => play(playing === null), Home: () => go(0), End: () => go(plan.duration_s) };
  if (!keys[event.key]) return;
  event.preventDefault();
  keys[event.key]();
});

function paint() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["card", "ink", "grid", "path", "done", "obstacle", ...Object.values(plan.colour)]) {
    colours[name] = style.getPropertyValue(`--${name}`).trim();
  }
  ask();
}
function fit() {
  const box = canvas.getBoundingClientRect(), sharp = Math.min(devicePixelRatio || 1, 2);
  size = [Math.max(box.width, 1), Math.max(box.height, 1)];
  canvas.width = Math.round(size[0] * sharp);
  canvas.height = Math.round(size[1] * sharp);
  draw(); // at once: a new size has wiped the canvas
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
new ResizeObserver(fit).observe(canvas);
// plan.html#t=2.5 opens at that time.
const opened = /[#&]t=([\d.]+)/.exec(location.hash);
paint();
go(opened ? Number(opened[1]) : 0);
fit();
