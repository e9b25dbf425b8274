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
in vec3 place; in vec3 normal; in float scalar; in vec3 seat; uniform mat4 view; out vec3 p; out vec3 n; out float s; out vec3 q;
void main() { p = place; n = normal; s = scalar; q = seat; gl_Position = view * vec4(place, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler3D;
in vec3 p; in vec3 n; in float s; in vec3 q; uniform sampler3D scan; uniform vec3 scan_low; uniform vec3 scan_size; uniform float scanned; uniform float opacity; uniform vec3 eye; uniform float top; uniform vec4 plane; uniform vec4 flat_colour; out vec4 colour;
// Viridis (van der Walt and Smith, 2015) through five of its colours.
vec3 viridis(float t) {
  vec3 a = vec3(.267, .005, .329), b = vec3(.231, .322, .545), c = vec3(.129, .569, .549), d = vec3(.369, .788, .384), e = vec3(.992, .906, .145);
  t = clamp(t, 0., 1.) * 4.;
  return t < 1. ? mix(a, b, t) : t < 2. ? mix(b, c, t - 1.) : t < 3. ? mix(c, d, t - 2.) : mix(d, e, t - 3.);
}
void main() {
  if (dot(plane.xyz, p) > plane.w) discard;
  float light = length(n) > 0. ? .35 + .65 * abs(dot(normalize(n), normalize(eye - p))) : 1.;
  // Less than nothing: not known there. The scan goes along with the tissue: it is read where the tissue was.
  vec3 own = s < 0. ? vec3(.6) : viridis(s / top);
  if (scanned > 0.) own = vec3(texture(scan, (q - scan_low) / scan_size).r);
  colour = vec4(light * mix(own, flat_colour.rgb, flat_colour.a), opacity);
}`;
let program, surface, cap, sphere, places = {};
const uniform = (name) => (places[name] ??= gl.getUniformLocation(program, name));
const cut = { axis: -1, at: 0 };
function shader(kind, text) {
  const made = gl.createShader(kind);
  gl.shaderSource(made, text);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
}
function drawable(...more) {
  const one = { array: gl.createVertexArray(), buffers: [] };
  gl.bindVertexArray(one.array);
  ["place", "normal", "scalar", ...more].forEach((name, n) => {
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
  places = {};
  [surface, cap, sphere] = [drawable(), drawable("seat"), drawable()];
  gl.enable(gl.DEPTH_TEST);
  mesh.normals = new Float32Array(3 * mesh.nodes);
  scanTexture([1, 1, 1], new Uint8Array(1));
  resect(false);
}
function normalsOf(at, f, out) {
  out.fill(0);
  for (let k = 0; k < f.length; k += 3) {
    const a = 3 * f[k], b = 3 * f[k + 1], c = 3 * f[k + 2];
    const ex = at[b] - at[a], ey = at[b + 1] - at[a + 1], ez = at[b + 2] - at[a + 2];
    const gx = at[c] - at[a], gy = at[c + 1] - at[a + 1], gz = at[c + 2] - at[a + 2];
    const x = ey * gz - ez * gy, y = ez * gx - ex * gz, z = ex * gy - ey * gx;
    out[a] += x; out[a + 1] += y; out[a + 2] += z;
    out[b] += x; out[b + 1] += y; out[b + 2] += z;
    out[c] += x; out[c + 1] += y; out[c + 2] += z;
  }
  return out;
}
/// Triangles where the plane goes through tetrahedra, coloured from the nodes.
function section(at, scalar) {
  const places = [], values = [], seats = [], { axis, at: level } = cut, { rest } = mesh;
  for (let k = 0; k < mesh.tets.length; k += 4) {
    const n = [mesh.tets[k], mesh.tets[k + 1], mesh.tets[k + 2], mesh.tets[k + 3]];
    const h = n.map((m) => at[3 * m + axis] - level), above = n.filter((_, i) => h[i] > 0).length;
    if (above === 0 || above === 4) continue;
    const points = [];
    const high = [0, 1, 2, 3].filter((i) => h[i] > 0), low = [0, 1, 2, 3].filter((i) => h[i] <= 0);
    for (const i of high) for (const j of low) {
      const t = h[i] / (h[i] - h[j]), a = n[i], b = n[j];
      points.push([at[3 * a] + t * (at[3 * b] - at[3 * a]), at[3 * a + 1] + t * (at[3 * b + 1] - at[3 * a + 1]),
        at[3 * a + 2] + t * (at[3 * b + 2] - at[3 * a + 2]), scalar[a] + t * (scalar[b] - scalar[a]),
        rest[3 * a] + t * (rest[3 * b] - rest[3 * a]), rest[3 * a + 1] + t * (rest[3 * b + 1] - rest[3 * a + 1]),
        rest[3 * a + 2] + t * (rest[3 * b + 2] - rest[3 * a + 2])]);
    }
    const order = points.length === 3 ? [0, 1, 2] : [0, 1, 3, 0, 3, 2];
    for (const i of order) { places.push(points[i][0], points[i][1], points[i][2]); values.push(points[i][3]); seats.push(points[i][4], points[i][5], points[i][6]); }
  }
  return [new Float32Array(places), new Float32Array(places.length), new Float32Array(values), new Float32Array(seats)];
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
let scale = 1, scaled = -1, shown = 0, drawn = 0, turned = true, sections = 0;
function uploadFrame() {
  socket.send('{"do":"ack"}');
  fill(surface, [frame.at, normalsOf(frame.at, mesh.facets, mesh.normals), frame.scalar]);
  legend();
  // Of another quantity the old scale means nothing, nor may its number stay beside the new unit.
  if (frame.colour !== scaled) [scaled, scale, toldAt] = [frame.colour, 1e-6, 0];
  let most = 1e-6;
  for (let n = 0; n < frame.scalar.length; n += 1) if (frame.scalar[n] > most) most = frame.scalar[n];
  // The scale follows slowly, so that colours do not flicker.
  scale = most > scale ? most : Math.max(most, 0.98 * scale);
}
function draw(fine = fineness.atRest) {
  const ratio = Math.min((devicePixelRatio || 1) * fine, 2);
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  gl.viewport(0, 0, width, height);
  gl.clearColor(...ground, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const set = uniform, { eye } = axes();
  gl.uniformMatrix4fv(set("view"), false, matrix());
  gl.uniform3fv(set("eye"), eye);
  gl.uniform1f(set("top"), scale);
  const plane = [0, 0, 0, 1];
  if (cut.axis >= 0) { plane[cut.axis] = 1; plane[3] = cut.at; }
  gl.uniform4fv(set("plane"), plane);
  gl.uniform4f(set("flat_colour"), 0, 0, 0, 0);
  gl.uniform1f(set("opacity"), 1);
  gl.uniform1f(set("scanned"), 0);
  gl.uniform3fv(set("scan_low"), scan.low);
  gl.uniform3fv(set("scan_size"), scan.size);
  const walls = $("show").value === "walls";
  // The far side of a closed surface is never seen.
  if (cut.axis < 0 && !walls) gl.enable(gl.CULL_FACE);
  gl.bindVertexArray(surface.array);
  gl.drawElements(gl.TRIANGLES, walls ? mesh.inside : mesh.facets.length, gl.UNSIGNED_INT, 0);
  gl.disable(gl.CULL_FACE);
  sections = 0;
  if (cut.axis >= 0) {
    const arrays = section(frame.at, frame.scalar);
    fill(cap, arrays);
    gl.uniform4f(set("plane"), 0, 0, 0, 1);
    gl.uniform1f(set("scanned"), scan.known && $("scan").checked ? 1 : 0);
    gl.bindVertexArray(cap.array);
    gl.drawArrays(gl.TRIANGLES, 0, arrays[2].length);
    sections = arrays[2].length / 3;
    gl.uniform1f(set("scanned"), 0);
  }
  gl.uniform4f(set("plane"), 0, 0, 0, 1);
  if (hand.ball) {
    const arrays = ballMesh(hand.ball);
    fill(sphere, arrays);
    gl.uniform4f(set("flat_colour"), 0.75, 0.4, 0.2, 1);
    gl.bindVertexArray(sphere.array);
    gl.drawArrays(gl.TRIANGLES, 0, arrays[2].length);
  }
  gl.uniform4fv(set("plane"), plane);
  drawGlass(set, walls);
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
let since = performance.now(), toldAt = 0;
/// The figures are read by eyes: eight times a second is enough, and the last ones stay.
function tell(now) {
  if (now - toldAt < 120 && !frame.still && !frame.paused) return;
  toldAt = now;
  $("hz").textContent = frame.paused ? "paused" : frame.still ? "at rest" : `${frame.hz.toFixed(0)} Hz`;
  $("residual").textContent = figure(frame.residual, 2);
  $("maximum").textContent = `${frame.maximum.toFixed(2)} mm`;
  $("energy").textContent = `${figure(frame.energy)} J`;
  $("inverted").textContent = frame.inverted.toFixed(0);
  $("force").textContent = `${frame.grip.toFixed(3)}, ${frame.ball.toFixed(3)} N`;
  $("high").textContent = figure(scale);
}
function tick(now) {
  requestAnimationFrame(tick);
  if (now - since > 500) {
    $("fps").textContent = `${(1000 * drawn / (now - since)).toFixed(0)} /s`;
    const sorted = latencies.slice(-50).sort((a, b) => a - b);
    if (sorted.length) $("latency").textContent = `${sorted[sorted.length >> 1].toFixed(0)} ms`;
    [since, drawn] = [now, 0];
  }
  if (!frame || !mesh) return;
  if (!(fresh || turned)) {
    // Nothing has moved for a while.
    if (fineness.coarse && now - fineness.last > 250) { draw(); fineness.coarse = false; }
    return;
  }
  if (fresh) { uploadFrame(); drawn += 1; shown += 1; }
  const moves = turned || !frame.still;
  draw(moves ? fineness.moving() : fineness.atRest);
  fineness.coarse = moves && fineness.moving() !== fineness.atRest;
  fineness.drawn(now);
  if (fresh && waiting && frame.taken >= waiting.number) {
    latencies.push(performance.now() - waiting.at);
    waiting = null;
  }
  if (fresh) { tell(now); canvas.dataset.ready = "yes"; }
  fresh = turned = false;
}
