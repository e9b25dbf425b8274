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
    // The ball is where the hand is; what is pulled is drawn where the solver has it.
    turned = true;
  }
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
/// A slider has ends and steps, the body's own number need not lie on them: until a hand moves it, the label says that number.
function slider(id, unitOf, then) {
  const input = $(id);
  input.told = (value) => { const said = $(`${id}-said`); if (said) said.textContent = unitOf(value); };
  input.put = (value) => { input.value = value; input.told(value); };
  input.addEventListener("input", () => { input.told(Number(input.value)); then(Number(input.value)); });
  input.told(Number(input.value));
}
const rounded = (x, decimals) => String(Number(x.toFixed(decimals)));
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
  Object.assign(input, { min: LOW, max: HIGH, step: 0.01 });
  box.append(Object.assign(document.createElement("p"), { className: "small", textContent: words }));
  const label = Object.assign(document.createElement("label"), { className: "line", textContent: "law " });
  const select = Object.assign(document.createElement("select"), { id: `law-${n}` });
  hello.laws.forEach((law) => select.append(new Option(law, law)));
  select.value = tissue.law;
  label.append(select);
  box.append(label);
  const ratio = line(box, "Poisson's ratio ", `ratio-${n}`);
  Object.assign(ratio, { min: 0, max: 0.495, step: 0.005 });
  $("tissues").append(box);
  slider(`modulus-${n}`, (x) => `${Math.exp(x).toFixed(0)} Pa`, (x) => send({ do: "modulus", tissue: tissue.name, pa: Math.exp(x) }));
  slider(`ratio-${n}`, (x) => rounded(x, 5), (x) => send({ do: "poisson_ratio", tissue: tissue.name, ratio: x }));
  input.put(Math.log(tissue.shear_modulus_pa));
  ratio.put(tissue.poisson_ratio);
  select.addEventListener("change", () => send({ do: "law", tissue: tissue.name, law: select.value }));
}
function build() {
  // What is made anew loses the keyboard.
  const focused = document.activeElement && document.activeElement.id;
  $("name").textContent = document.title = `hgm live: ${hello.name}`;
  ["tissues", "pressures", "supports", "notes"].forEach((id) => $(id).replaceChildren());
  hello.tissues.forEach(tissueBox);
  hello.sets.forEach((set) => {
    const label = document.createElement("label"), input = Object.assign(document.createElement("input"), { type: "checkbox", id: `held-${set}` });
    input.checked = hello.held.includes(set);
    input.dataset.set = set;
    input.addEventListener("change", () => send({ do: "support", set, held: input.checked }));
    label.append(input, ` ${set}`);
    $("supports").append(label);
  });
  hello.pressed.filter((set) => set.includes("ventricle")).forEach((set) => {
    const input = line($("pressures"), `pressure, ${set} `, `pressure-${set}`);
    const own = hello.pressure.find((load) => load.set === set);
    Object.assign(input, { min: -2000, max: 2000, step: 10 });
    slider(input.id, (x) => `${rounded(x, 1)} Pa`, (x) => send({ do: "pressure", set, pa: x }));
    input.put(own ? own.pressure_pa : 0);
  });
  $("gravity").value = gravityOption();
  $("density").put(hello.density_kg_per_m3);
  $("csf").checked = hello.csf_level_mm !== null;
  $("quasi").checked = hello.quasi_static;
  $("resection-row").hidden = hello.resection === null;
  $("resection").checked = hello.resection === true;
  [...$("colour").options].forEach((option) => { option.hidden = option.disabled = !hello.colours.includes(option.value); });
  $("show-row").hidden = !Object.keys(hello.walls).length;
  if (mesh) facetsChanged();
  ranges();
  hello.notes.forEach((note) => $("notes").append(Object.assign(document.createElement("li"), { textContent: note })));
  if (focused && document.activeElement.id !== focused) $(focused)?.focus();
}
/// The way to lie that the body's gravity is; none of them leaves the choice empty.
function gravityOption() {
  const now = hello.gravity_m_per_s2.map(Number).join();
  if (now === hello.scenario_gravity_m_per_s2.map(Number).join()) return "own";
  return [...$("gravity").options].map((option) => option.value).find((value) => value.split(",").map(Number).join() === now) ?? "";
}
/// What is shown has the name and the unit of the frame's own numbers: what was asked for may be refused, or still be made.
let asked = 0;
function legend() {
  if (!frame || !hello) return;
  const option = [...$("colour").options].find((one) => one.value === hello.colours[frame.colour]);
  if (!option) return;
  $("quantity").textContent = option.textContent;
  $("unit").textContent = option.value === "energy" ? "Pa" : "mm";
  if (frame.taken >= asked && $("colour").value !== option.value) $("colour").value = option.value;
}
function ranges() {
  if (!mesh || !hello) return;
  const low = Math.min(...mesh.low), high = Math.max(...mesh.high);
  Object.assign($("level"), { min: low - 10, max: high + 10 });
  // Without fluid there is no number but the slider's.
  $("level").put(hello.csf_level_mm ?? high);
  if (hello.csf_level_mm === null) $("level").told(Number($("level").value));
  cutRange();
}
function cutRange() {
  const axis = $("cut").value === "" ? -1 : Number($("cut").value);
  if (axis >= 0 && axis !== cut.axis) Object.assign($("at"), { min: mesh.low[axis], max: mesh.high[axis], value: (mesh.low[axis] + mesh.high[axis]) / 2 });
  Object.assign(cut, { axis, at: Number($("at").value) });
  $("at").told(cut.at);
  turned = true;
}
slider("radius", (x) => `${x} mm`, () => {});
slider("depth", (x) => `${x} mm`, () => {});
slider("density", (x) => `${rounded(x, 1)} kg/m3`, (x) => send({ do: "density", kg_per_m3: x }));
slider("level", (x) => `${rounded(x, 1)} mm`, (x) => { if ($("csf").checked) send({ do: "csf", level_mm: x }); });
slider("at", (x) => `${x.toFixed(1)} mm`, (x) => { cut.at = x; turned = true; });
$("csf").addEventListener("change", () => {
  // From here on it is the slider's number that the body has.
  $("level").told(Number($("level").value));
  send({ do: "csf", level_mm: $("csf").checked ? Number($("level").value) : null });
});
$("gravity").addEventListener("change", () => {
  const own = $("gravity").value === "own";
  send({ do: "gravity", m_per_s2: own ? hello.scenario_gravity_m_per_s2 : $("gravity").value.split(",").map(Number) });
});
$("resection").addEventListener("change", () => send({ do: "resection", removed: $("resection").checked }));
$("quasi").addEventListener("change", () => send({ do: "manner", quasi_static: $("quasi").checked }));
$("colour").addEventListener("change", () => {
  send({ do: "colour", by: $("colour").value });
  asked = sent;
});
$("cut").addEventListener("change", cutRange);
["show", "scan"].forEach((id) => $(id).addEventListener("change", () => { turned = true; }));
function pause() {
  const on = $("pause").getAttribute("aria-pressed") !== "true";
  $("pause").setAttribute("aria-pressed", on);
  send({ do: "pause", paused: on });
}
const reset = () => send({ do: "reset" });
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
