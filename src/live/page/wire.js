"use strict";
// Drawing never waits for the solver: a frame that comes is kept until the next picture takes it, and only then the next is asked for.
const $ = (id) => document.getElementById(id);
const canvas = $("gl");
const say = (text) => { $("said").textContent = text; };

// --- The wire: text to the session, the mesh and frames from it.
const MAGIC = 0x4c4d4748, HEAD = 20;
const socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "socket"));
socket.binaryType = "arraybuffer";
let sent = 0, mesh = null, frame = null, fresh = false, waiting = null, hello = null;
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
  if (words[1] === 1) return takeMesh(event.data);
  if (words[1] === 3) return takeTarget(event.data, words);
  if (words[1] === 4) return takeScan(event.data, words);
  frame = takeFrame(event.data, words);
  if (mesh.removed !== frame.removed) resect(frame.removed);
  fresh = true;
};
function heard(message) {
  if (message.refused) {
    // A switch that was set for what did not happen goes back to where the body stands.
    if (message.stands) {
      asked = 0;
      take(message.stands);
    }
    return say(message.refused);
  }
  if (message.file) return save(message.file, new Blob([message.text]));
  take(message);
}
function take(told) {
  hello = told;
  build();
  legend();
}
function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
function takeMesh(bytes) {
  const [, , nodes, tets, facets, without, label] = new Uint32Array(bytes, 0, 7);
  let at = 28;
  const take = (Kind, count) => { const part = new Kind(bytes, at, count); at += part.byteLength; return part; };
  mesh = { nodes, rest: take(Float32Array, 3 * nodes), whole: take(Uint32Array, 3 * facets), without: take(Uint32Array, 3 * without),
    allTets: take(Uint32Array, 4 * tets), labels: take(Uint8Array, tets), resected: label };
  const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  mesh.rest.forEach((x, n) => { low[n % 3] = Math.min(low[n % 3], x); high[n % 3] = Math.max(high[n % 3], x); });
  Object.assign(mesh, { low, high });
  camera.centre = low.map((x, i) => (x + high[i]) / 2);
  camera.size = Math.hypot(...low.map((x, i) => high[i] - x)) / 2;
  camera.distance = 2.9 * camera.size;
  prepare();
  ranges();
}
/// Facets and tetrahedra of what is in place.
function resect(removed) {
  mesh.removed = removed;
  mesh.facets = removed ? mesh.without : mesh.whole;
  mesh.tets = removed ? mesh.allTets.filter((_, n) => mesh.labels[n >> 2] !== mesh.resected) : mesh.allTets;
  facetsChanged();
}
function takeFrame(bytes, words) {
  const number = new Float32Array(bytes, 24, 14), nodes = words[2];
  return {
    step: words[3], taken: words[4], paused: !!(words[5] & 1), still: !!(words[5] & 2), removed: !!(words[5] & 8),
    time: number[0], hz: number[1], residual: number[2], speed: number[3], maximum: number[4], energy: number[5],
    inverted: number[6], least: number[7], grip: number[8], ball: number[9], stepSeconds: number[10], recovered: number[11],
    colour: number[13],
    at: new Float32Array(bytes, 4 * HEAD, 3 * nodes), scalar: new Float32Array(bytes, 4 * HEAD + 12 * nodes, nodes),
  };
}
