"use strict";
// Drawing never waits for the solver: a frame that comes is kept, the next picture takes the latest.
const $ = (id) => document.getElementById(id);
const canvas = $("gl");
const gl = canvas.getContext("webgl2", { antialias: true });
const say = (text) => { $("said").textContent = text; };

// --- The wire: text to the session, the mesh and frames from it.
const MAGIC = 0x4c4d4748, HEAD = 20;
const socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "socket"));
socket.binaryType = "arraybuffer";
let sent = 0, mesh = null, frame = null, fresh = false, waiting = null, hello = null, first = null;
const latencies = [];
function send(message) {
  if (socket.readyState !== WebSocket.OPEN) return;
  sent += 1;
  if ((message.do === "drag" || message.do === "ball") && !waiting) waiting = { number: sent, at: performance.now() };
  socket.send(JSON.stringify(message));
}
socket.onopen = () => say("");
socket.onclose = () => say("The session has ended, or another page has it.");
socket.onmessage = (event) => {
  if (typeof event.data === "string") return heard(JSON.parse(event.data));
  const words = new Uint32Array(event.data, 0, 6);
  if (words[0] !== MAGIC) return;
  if (words[1] === 1) return takeMesh(event.data, words);
  socket.send('{"do":"ack"}');
  frame = takeFrame(event.data, words);
  fresh = true;
};
function heard(message) {
  if (message.refused) return say(message.refused);
  if (message.file) return save(message.file, new Blob([message.text]));
  hello = message;
  first = first || message;
  build();
}
function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
function takeMesh(bytes, [, , nodes, tets, facets]) {
  let at = 20;
  const take = (Kind, count) => { const part = new Kind(bytes, at, count); at += part.byteLength; return part; };
  mesh = { nodes, rest: take(Float32Array, 3 * nodes), facets: take(Uint32Array, 3 * facets), tets: take(Uint32Array, 4 * tets) };
  const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  mesh.rest.forEach((x, n) => { low[n % 3] = Math.min(low[n % 3], x); high[n % 3] = Math.max(high[n % 3], x); });
  Object.assign(mesh, { low, high });
  camera.centre = low.map((x, i) => (x + high[i]) / 2);
  camera.size = Math.hypot(...low.map((x, i) => high[i] - x)) / 2;
  camera.distance = 2.9 * camera.size;
  prepare();
  ranges();
}
function takeFrame(bytes, words) {
  const number = new Float32Array(bytes, 24, 14), nodes = words[2];
  return {
    step: words[3], taken: words[4], paused: !!(words[5] & 1), still: !!(words[5] & 2),
    time: number[0], hz: number[1], residual: number[2], speed: number[3], maximum: number[4], energy: number[5],
    inverted: number[6], least: number[7], grip: number[8], ball: number[9], stepSeconds: number[10], recovered: number[11],
    at: new Float32Array(bytes, 4 * HEAD, 3 * nodes), scalar: new Float32Array(bytes, 4 * HEAD + 12 * nodes, nodes),
  };
}

// --- Small vectors and the camera; z is up, as in RAS.
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const mix = (a, s, b) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
const camera = { yaw: 0.7, pitch: 0.35, distance: 300, size: 100, centre: [0, 0, 0] };
const FIELD = 0.6;
function axes() {
  const { yaw, pitch } = camera;
  const back = [Math.sin(yaw) * Math.cos(pitch), Math.cos(yaw) * Math.cos(pitch), Math.sin(pitch)];
  const right = unit(cross([0, 0, 1], back));
  return { back, right, up: cross(back, right), eye: mix(camera.centre, camera.distance, back) };
}
function matrix() {
  const { back, right, up, eye } = axes(), aspect = canvas.width / canvas.height;
  const f = 1 / Math.tan(FIELD / 2), near = camera.distance / 50, far = camera.distance + 4 * camera.size;
  const view = [right, up, back].map((row) => [...row, -dot(row, eye)]);
  const rows = [view[0].map((x) => x * f / Math.max(aspect, 1e-3)), view[1].map((x) => x * f),
    view[2].map((x, i) => x * (far + near) / (near - far) + (i === 3 ? 2 * far * near / (near - far) : 0)),
    view[2].map((x) => -x)];
  return new Float32Array([0, 1, 2, 3].flatMap((c) => rows.map((row) => row[c])));
}
function ray(event) {
  const box = canvas.getBoundingClientRect(), { back, right, up, eye } = axes();
  const x = 2 * (event.clientX - box.left) / box.width - 1, y = 1 - 2 * (event.clientY - box.top) / box.height;
  const t = Math.tan(FIELD / 2);
  return { from: eye, along: unit(mix(mix(back.map((b) => -b), x * t * box.width / box.height, right), y * t, up)) };
}
const hidden = (p) => cut.axis >= 0 && p[cut.axis] > cut.at;
/// The facet under a ray (Moeller and Trumbore, 1997).
function pick({ from, along }) {
  let best = null;
  const at = frame.at, point = (n) => [at[3 * n], at[3 * n + 1], at[3 * n + 2]];
  for (let f = 0; f < mesh.facets.length; f += 3) {
    const corners = [mesh.facets[f], mesh.facets[f + 1], mesh.facets[f + 2]], [a, b, c] = corners.map(point);
    const e = sub(b, a), g = sub(c, a), p = cross(along, g), d = dot(e, p);
    if (d < 1e-9) continue;
    const s = sub(from, a), u = dot(s, p) / d, q = cross(s, e), v = dot(along, q) / d, t = dot(g, q) / d;
    if (u < 0 || v < 0 || u + v > 1 || t < 0 || (best && t > best.t)) continue;
    const hit = mix(from, t, along);
    if (hidden(hit)) continue;
    const weights = [1 - u - v, u, v];
    best = { t, hit, node: corners[weights.indexOf(Math.max(...weights))], normal: unit(cross(e, g)) };
  }
  return best;
}

// --- Pictures by WebGL 2.
const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in float scalar; uniform mat4 view; out vec3 p; out vec3 n; out float s;
void main() { p = place; n = normal; s = scalar; gl_Position = view * vec4(place, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 p; in vec3 n; in float s; uniform vec3 eye; uniform float top; uniform vec4 plane; uniform vec4 flat_colour; out vec4 colour;
// Viridis (van der Walt and Smith, 2015) through five of its colours.
vec3 viridis(float t) {
  vec3 a = vec3(.267, .005, .329), b = vec3(.231, .322, .545), c = vec3(.129, .569, .549), d = vec3(.369, .788, .384), e = vec3(.992, .906, .145);
  t = clamp(t, 0., 1.) * 4.;
  return t < 1. ? mix(a, b, t) : t < 2. ? mix(b, c, t - 1.) : t < 3. ? mix(c, d, t - 2.) : mix(d, e, t - 3.);
}
void main() {
  if (dot(plane.xyz, p) > plane.w) discard;
  float light = length(n) > 0. ? .35 + .65 * abs(dot(normalize(n), normalize(eye - p))) : 1.;
  colour = vec4(light * mix(viridis(s / top), flat_colour.rgb, flat_colour.a), 1.);
}`;
let program, surface, cap, sphere;
const cut = { axis: -1, at: 0 };
function shader(kind, text) {
  const made = gl.createShader(kind);
  gl.shaderSource(made, text);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
}
function drawable() {
  const one = { array: gl.createVertexArray(), buffers: [] };
  gl.bindVertexArray(one.array);
  ["place", "normal", "scalar"].forEach((name, n) => {
    const buffer = gl.createBuffer(), where = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(where);
    gl.vertexAttribPointer(where, name === "scalar" ? 1 : 3, gl.FLOAT, false, 0, 0);
    one.buffers[n] = buffer;
  });
  return one;
}
function fill(one, arrays) {
  arrays.forEach((values, n) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, one.buffers[n]);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
  });
}
function prepare() {
  program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, FRAGMENT));
  gl.linkProgram(program);
  gl.useProgram(program);
  [surface, cap, sphere] = [drawable(), drawable(), drawable()];
  gl.bindVertexArray(surface.array);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.facets, gl.STATIC_DRAW);
  gl.enable(gl.DEPTH_TEST);
  mesh.normals = new Float32Array(3 * mesh.nodes);
}
function normals(at) {
  const out = mesh.normals.fill(0), f = mesh.facets;
  for (let k = 0; k < f.length; k += 3) {
    const a = 3 * f[k], b = 3 * f[k + 1], c = 3 * f[k + 2];
    const ex = at[b] - at[a], ey = at[b + 1] - at[a + 1], ez = at[b + 2] - at[a + 2];
    const gx = at[c] - at[a], gy = at[c + 1] - at[a + 1], gz = at[c + 2] - at[a + 2];
    const x = ey * gz - ez * gy, y = ez * gx - ex * gz, z = ex * gy - ey * gx;
    for (const n of [a, b, c]) { out[n] += x; out[n + 1] += y; out[n + 2] += z; }
  }
  return out;
}
/// Triangles where the plane goes through tetrahedra, coloured from the nodes.
function section(at, scalar) {
  const places = [], values = [], { axis, at: level } = cut;
  for (let k = 0; k < mesh.tets.length; k += 4) {
    const n = [mesh.tets[k], mesh.tets[k + 1], mesh.tets[k + 2], mesh.tets[k + 3]];
    const h = n.map((m) => at[3 * m + axis] - level), above = n.filter((_, i) => h[i] > 0).length;
    if (above === 0 || above === 4) continue;
    const points = [];
    const high = [0, 1, 2, 3].filter((i) => h[i] > 0), low = [0, 1, 2, 3].filter((i) => h[i] <= 0);
    for (const i of high) for (const j of low) {
      const t = h[i] / (h[i] - h[j]), a = n[i], b = n[j];
      points.push([at[3 * a] + t * (at[3 * b] - at[3 * a]), at[3 * a + 1] + t * (at[3 * b + 1] - at[3 * a + 1]),
        at[3 * a + 2] + t * (at[3 * b + 2] - at[3 * a + 2]), scalar[a] + t * (scalar[b] - scalar[a])]);
    }
    const order = points.length === 3 ? [0, 1, 2] : [0, 1, 3, 0, 3, 2];
    for (const i of order) { places.push(points[i][0], points[i][1], points[i][2]); values.push(points[i][3]); }
  }
  return [new Float32Array(places), new Float32Array(places.length), new Float32Array(values)];
}
function ballMesh({ centre, radius }) {
  const places = [], out = [], N = 14;
  const point = (i, j) => { const a = Math.PI * i / N, b = 2 * Math.PI * j / N; return [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)]; };
  for (let i = 0; i < N; i += 1) for (let j = 0; j < N; j += 1) for (const [k, l] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) {
    const p = point(i + k, j + l);
    out.push(...p);
    places.push(...mix(centre, radius, p));
  }
  return [new Float32Array(places), new Float32Array(out), new Float32Array(places.length / 3)];
}
let scale = 1, shown = 0, drawn = 0, turned = true, sections = 0;
function uploadFrame() {
  fill(surface, [frame.at, normals(frame.at), frame.scalar]);
  let most = 1e-6;
  for (const s of frame.scalar) most = Math.max(most, s);
  // The scale follows slowly, so that colours do not flicker.
  scale = most > scale ? most : Math.max(most, 0.98 * scale);
}
function draw() {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  gl.viewport(0, 0, width, height);
  gl.clearColor(...ground, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const set = (name) => gl.getUniformLocation(program, name), { eye } = axes();
  gl.uniformMatrix4fv(set("view"), false, matrix());
  gl.uniform3fv(set("eye"), eye);
  gl.uniform1f(set("top"), scale);
  const plane = [0, 0, 0, 1];
  if (cut.axis >= 0) { plane[cut.axis] = 1; plane[3] = cut.at; }
  gl.uniform4fv(set("plane"), plane);
  gl.uniform4f(set("flat_colour"), 0, 0, 0, 0);
  gl.bindVertexArray(surface.array);
  gl.drawElements(gl.TRIANGLES, mesh.facets.length, gl.UNSIGNED_INT, 0);
  gl.uniform4f(set("plane"), 0, 0, 0, 1);
  sections = 0;
  if (cut.axis >= 0) {
    const arrays = section(frame.at, frame.scalar);
    fill(cap, arrays);
    gl.bindVertexArray(cap.array);
    gl.drawArrays(gl.TRIANGLES, 0, arrays[2].length);
    sections = arrays[2].length / 3;
  }
  if (hand.ball) {
    const arrays = ballMesh(hand.ball);
    fill(sphere, arrays);
    gl.uniform4f(set("flat_colour"), 0.75, 0.4, 0.2, 1);
    gl.bindVertexArray(sphere.array);
    gl.drawArrays(gl.TRIANGLES, 0, arrays[2].length);
  }
}
let ground = [1, 1, 1];
function readGround() {
  const found = getComputedStyle(document.body).backgroundColor.match(/[\d.]+/g) || [255, 255, 255];
  ground = found.slice(0, 3).map((x) => x / 255);
  turned = true;
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readGround);
addEventListener("resize", () => { turned = true; });
const figure = (x, digits = 3) => (x === 0 ? "0" : Math.abs(x) < 1e-2 || Math.abs(x) >= 1e5 ? x.toExponential(1) : x.toPrecision(digits));
let since = performance.now();
function tick(now) {
  requestAnimationFrame(tick);
  if (now - since > 500) {
    $("fps").textContent = `${(1000 * drawn / (now - since)).toFixed(0)} /s`;
    const sorted = latencies.slice(-50).sort((a, b) => a - b);
    if (sorted.length) $("latency").textContent = `${sorted[sorted.length >> 1].toFixed(0)} ms`;
    [since, drawn] = [now, 0];
  }
  if (!frame || !mesh || !(fresh || turned)) return;
  if (fresh) { uploadFrame(); drawn += 1; shown += 1; }
  draw();
  if (fresh && waiting && frame.taken >= waiting.number) {
    latencies.push(performance.now() - waiting.at);
    waiting = null;
  }
  if (fresh) {
    $("hz").textContent = frame.paused ? "paused" : frame.still ? "at rest" : `${frame.hz.toFixed(0)} Hz`;
    $("residual").textContent = figure(frame.residual, 2);
    $("maximum").textContent = `${frame.maximum.toFixed(2)} mm`;
    $("energy").textContent = `${figure(frame.energy)} J`;
    $("inverted").textContent = frame.inverted.toFixed(0);
    $("force").textContent = `${frame.grip.toFixed(3)}, ${frame.ball.toFixed(3)} N`;
    $("high").textContent = figure(scale);
    canvas.dataset.ready = "yes";
  }
  fresh = turned = false;
}

// --- Hands.
const hand = { ball: null };
let grip = null, pending = null;
const tool = () => document.querySelector("input[name=tool]:checked").value;
function ballAt(found, along) {
  const radius = Number($("radius").value), depth = Number($("depth").value);
  hand.ball = { centre: mix(found.hit, -(radius - depth), along), radius };
  pending = { do: "ball", centre_mm: hand.ball.centre, radius_mm: radius };
}
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  canvas.focus({ preventScroll: true });
  const line = ray(event), found = frame && event.button === 0 && tool() !== "turn" ? pick(line) : null;
  if (!found) grip = { kind: "turn", x: event.clientX, y: event.clientY };
  else if (tool() === "pull") grip = { kind: "pull", node: found.node, from: found.hit, along: line.along, t: found.t,
    start: [0, 1, 2].map((i) => frame.at[3 * found.node + i]) };
  else { grip = { kind: "ball" }; ballAt(found, line.along); }
});
canvas.addEventListener("pointermove", (event) => {
  if (!grip) return;
  if (grip.kind === "turn") {
    camera.yaw += 0.008 * (event.clientX - grip.x);
    camera.pitch = Math.max(-1.5, Math.min(1.5, camera.pitch + 0.008 * (event.clientY - grip.y)));
    [grip.x, grip.y, turned] = [event.clientX, event.clientY, true];
    return;
  }
  const { from, along } = ray(event);
  if (grip.kind === "pull") {
    // In the plane through what was gripped, across the line of sight of the grip.
    const s = grip.t / Math.max(dot(along, grip.along), 0.1), to = mix(from, s, along);
    pending = { do: "drag", node: grip.node, to_mm: mix(grip.start, 1, sub(to, grip.from)) };
  } else {
    const found = pick({ from, along });
    if (found) ballAt(found, along);
  }
  turned = true;
});
function letGo() {
  if (!grip) return;
  flush();
  if (grip.kind === "pull") send({ do: "release" });
  if (grip.kind === "ball") { hand.ball = null; send({ do: "lift" }); }
  grip = null;
  turned = true;
}
["pointerup", "pointercancel"].forEach((name) => canvas.addEventListener(name, letGo));
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(0.001 * event.deltaY));
}, { passive: false });
function zoom(by) { camera.distance = Math.max(0.5 * camera.size, Math.min(10 * camera.size, by * camera.distance)); turned = true; }
// Of what moves only the latest counts: one message a picture.
function flush() { if (pending) { send(pending); pending = null; } }
setInterval(flush, 12);

// --- The panel.
function slider(id, unitOf, then) {
  const input = $(id), told = () => { const said = $(`${id}-said`); if (said) said.textContent = unitOf(Number(input.value)); };
  input.addEventListener("input", () => { told(); then(Number(input.value)); });
  input.told = told;
  told();
}
function line(parent, text, id) {
  const label = document.createElement("label");
  label.className = "line";
  label.htmlFor = id;
  label.append(text, Object.assign(document.createElement("output"), { id: `${id}-said` }));
  const input = Object.assign(document.createElement("input"), { type: "range", id });
  label.append(input);
  parent.append(label);
  return input;
}
const SVG = "http://www.w3.org/2000/svg";
const LOW = Math.log(50), HIGH = Math.log(20000);
function curve(spread, name) {
  if (!spread) return null;
  const path = document.createElementNS(SVG, "path");
  let d = "M0 30";
  for (let k = 0; k <= 100; k += 1) {
    const z = (LOW + (HIGH - LOW) * k / 100 - spread.log_mean) / spread.log_sd;
    d += ` L${k} ${(30 - 28 * Math.exp(-0.5 * z * z)).toFixed(2)}`;
  }
  path.setAttribute("d", `${d} L100 30`);
  path.setAttribute("class", name);
  path.setAttribute("vector-effect", "non-scaling-stroke");
  return path;
}
function tissueBox(tissue, n) {
  const box = document.createElement("fieldset"), legend = document.createElement("legend");
  legend.textContent = tissue.name.replaceAll("_", " ");
  box.append(legend);
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("viewBox", "0 0 100 30");
  picture.setAttribute("preserveAspectRatio", "none");
  picture.setAttribute("class", "curves");
  picture.setAttribute("role", "img");
  const told = (spread) => `${Math.exp(spread.log_mean - 1.96 * spread.log_sd).toFixed(0)} to ${Math.exp(spread.log_mean + 1.96 * spread.log_sd).toFixed(0)} Pa`;
  const known = [["literature", tissue.prior], ["this case", tissue.posterior]].filter(([, spread]) => spread);
  const words = known.map(([name, spread]) => `${name}: ${told(spread)} (95 %)`).join("; ");
  picture.setAttribute("aria-label", words || "nothing is known beforehand");
  [curve(tissue.prior, "prior"), curve(tissue.posterior, "posterior")].forEach((path) => path && picture.append(path));
  box.append(picture);
  const input = line(box, "shear modulus ", `modulus-${n}`);
  Object.assign(input, { min: LOW, max: HIGH, step: 0.01, value: Math.log(tissue.shear_modulus_pa) });
  box.append(Object.assign(document.createElement("p"), { className: "small", textContent: words }));
  const label = Object.assign(document.createElement("label"), { className: "line", textContent: "law " });
  const select = Object.assign(document.createElement("select"), { id: `law-${n}` });
  hello.laws.forEach((law) => select.append(new Option(law, law)));
  select.value = tissue.law;
  label.append(select);
  box.append(label);
  const ratio = line(box, "Poisson's ratio ", `ratio-${n}`);
  Object.assign(ratio, { min: 0, max: 0.495, step: 0.005, value: tissue.poisson_ratio });
  $("tissues").append(box);
  slider(`modulus-${n}`, (x) => `${Math.exp(x).toFixed(0)} Pa`, (x) => send({ do: "modulus", tissue: tissue.name, pa: Math.exp(x) }));
  slider(`ratio-${n}`, (x) => x.toFixed(3), (x) => send({ do: "poisson_ratio", tissue: tissue.name, ratio: x }));
  select.addEventListener("change", () => send({ do: "law", tissue: tissue.name, law: select.value }));
}
function build() {
  $("name").textContent = document.title = `hgm live: ${hello.name}`;
  ["tissues", "pressures", "supports", "notes"].forEach((id) => $(id).replaceChildren());
  hello.tissues.forEach(tissueBox);
  hello.sets.forEach((set) => {
    const label = document.createElement("label"), input = Object.assign(document.createElement("input"), { type: "checkbox" });
    input.checked = hello.held.includes(set);
    input.dataset.set = set;
    input.addEventListener("change", () => send({ do: "support", set, held: input.checked }));
    label.append(input, ` ${set}`);
    $("supports").append(label);
  });
  hello.pressed.filter((set) => set.includes("ventricle")).forEach((set) => {
    const input = line($("pressures"), `pressure, ${set} `, `pressure-${set}`);
    const own = hello.pressure.find((load) => load.set === set);
    Object.assign(input, { min: -2000, max: 2000, step: 10, value: own ? own.pressure_pa : 0 });
    slider(input.id, (x) => `${x.toFixed(0)} Pa`, (x) => send({ do: "pressure", set, pa: x }));
  });
  $("density").value = hello.density_kg_per_m3;
  $("density").told?.();
  $("csf").checked = hello.csf_level_mm !== null;
  $("quasi").checked = hello.quasi_static;
  ranges();
  hello.notes.forEach((note) => $("notes").append(Object.assign(document.createElement("li"), { textContent: note })));
}
function ranges() {
  if (!mesh || !hello) return;
  const low = Math.min(...mesh.low), high = Math.max(...mesh.high);
  Object.assign($("level"), { min: low - 10, max: high + 10, value: hello.csf_level_mm ?? high });
  $("level").told();
  cutRange();
}
function cutRange() {
  const axis = $("cut").value === "" ? -1 : Number($("cut").value);
  if (axis >= 0 && axis !== cut.axis) Object.assign($("at"), { min: mesh.low[axis], max: mesh.high[axis], value: (mesh.low[axis] + mesh.high[axis]) / 2 });
  Object.assign(cut, { axis, at: Number($("at").value) });
  $("at").told();
  turned = true;
}
slider("radius", (x) => `${x} mm`, () => {});
slider("depth", (x) => `${x} mm`, () => {});
slider("density", (x) => `${x} kg/m3`, (x) => send({ do: "density", kg_per_m3: x }));
slider("level", (x) => `${x.toFixed(0)} mm`, (x) => { if ($("csf").checked) send({ do: "csf", level_mm: x }); });
slider("at", (x) => `${x.toFixed(1)} mm`, (x) => { cut.at = x; turned = true; });
$("csf").addEventListener("change", () => send({ do: "csf", level_mm: $("csf").checked ? Number($("level").value) : null }));
$("gravity").addEventListener("change", () => {
  const own = $("gravity").value === "own";
  send({ do: "gravity", m_per_s2: own ? first.gravity_m_per_s2 : $("gravity").value.split(",").map(Number) });
});
$("quasi").addEventListener("change", () => send({ do: "manner", quasi_static: $("quasi").checked }));
$("colour").addEventListener("change", () => {
  scale = 1e-6;
  $("unit").textContent = $("colour").value === "energy" ? "Pa" : "mm";
  send({ do: "colour", by: $("colour").value });
});
$("cut").addEventListener("change", cutRange);
function pause() {
  const on = $("pause").getAttribute("aria-pressed") !== "true";
  $("pause").setAttribute("aria-pressed", on);
  send({ do: "pause", paused: on });
}
function reset() {
  send({ do: "reset" });
  $("gravity").value = "own";
}
$("pause").onclick = pause;
$("step").onclick = () => send({ do: "step" });
$("undo").onclick = () => send({ do: "undo" });
$("reset").onclick = reset;
$("picture").onclick = () => { if (frame) { draw(); canvas.toBlob((blob) => save("hgm-live.png", blob)); } };
$("vtu").onclick = () => send({ do: "export_vtu" });
$("scenario").onclick = () => send({ do: "export_scenario" });
const KEYS = { " ": pause, ".": () => send({ do: "step" }), u: () => send({ do: "undo" }), r: reset,
  "+": () => zoom(0.9), "-": () => zoom(1.1), 1: () => choose(0), 2: () => choose(1), 3: () => choose(2) };
const TURNS = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
function choose(n) { document.querySelectorAll("input[name=tool]")[n].checked = true; }
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const inside = event.target.closest?.("input, select, button");
  if (TURNS[event.key] && !inside) {
    camera.yaw += TURNS[event.key][0];
    camera.pitch = Math.max(-1.5, Math.min(1.5, camera.pitch + TURNS[event.key][1]));
    turned = true;
    event.preventDefault();
  } else if (KEYS[event.key] && !(inside && event.key === " ") && !(inside && inside.tagName === "SELECT")) {
    KEYS[event.key]();
    event.preventDefault();
  }
});
readGround();
requestAnimationFrame(tick);
