
// --- What is seen beside the body: target surfaces as ghosts, the scan on the cut, the inner walls alone.
const ghosts = [];
const scan = { low: [0, 0, 0], size: [1, 1, 1], known: false, texture: null };
function takeTarget(bytes, [, , nodes, triangles, length]) {
  const at = new Float32Array(bytes, 20, 3 * nodes), facets = new Uint32Array(bytes, 20 + 12 * nodes, 3 * triangles);
  const name = new TextDecoder().decode(new Uint8Array(bytes, 20 + 12 * nodes + 12 * triangles, length));
  const ghost = { ...drawable(), name, count: facets.length, shown: false };
  fill(ghost, [at, normalsOf(at, facets, new Float32Array(3 * nodes)), new Float32Array(nodes)]);
  indices(ghost, facets);
  ghosts.push(ghost);
  const label = document.createElement("label"), input = Object.assign(document.createElement("input"), { type: "checkbox", id: `ghost-${ghosts.length - 1}` });
  input.addEventListener("change", () => { ghost.shown = input.checked; turned = true; });
  label.append(input, ` target: ${name.replaceAll("_", " ")}`);
  $("ghosts").append(label);
}
function takeScan(bytes, [, , x, y, z]) {
  const [ox, oy, oz, voxel] = new Float32Array(bytes, 20, 4), dims = [x, y, z];
  scan.low = [ox, oy, oz].map((o) => o - voxel / 2);
  scan.size = dims.map((n) => n * voxel);
  scanTexture(dims, new Uint8Array(bytes, 36, x * y * z));
  scan.known = true;
  $("scan-row").hidden = false;
}
function scanTexture(dims, values) {
  scan.texture = scan.texture || gl.createTexture();
  gl.bindTexture(gl.TEXTURE_3D, scan.texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage3D(gl.TEXTURE_3D, 0, gl.R8, ...dims, 0, gl.RED, gl.UNSIGNED_BYTE, values);
  for (const [name, value] of [["MIN_FILTER", "LINEAR"], ["MAG_FILTER", "LINEAR"], ["WRAP_S", "CLAMP_TO_EDGE"], ["WRAP_T", "CLAMP_TO_EDGE"], ["WRAP_R", "CLAMP_TO_EDGE"]]) {
    gl.texParameteri(gl.TEXTURE_3D, gl[`TEXTURE_${name}`], gl[value]);
  }
}
/// Facets of the walls first, then the others, so that one list of indices serves both pictures.
function facetsChanged() {
  const inside = [], outside = [], sets = Object.values(hello ? hello.walls : {}).map((nodes) => new Set(nodes)), f = mesh.facets;
  for (let k = 0; k < f.length; k += 3) {
    const wall = sets.some((set) => set.has(f[k]) && set.has(f[k + 1]) && set.has(f[k + 2]));
    (wall ? inside : outside).push(f[k], f[k + 1], f[k + 2]);
  }
  mesh.inside = inside.length;
  indices(surface, new Uint32Array(inside.concat(outside)));
  turned = true;
}
function indices(one, facets) {
  one.index = one.index || gl.createBuffer();
  gl.bindVertexArray(one.array);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, one.index);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, facets, gl.STATIC_DRAW);
}
/// What light goes through is drawn last and hides nothing.
function drawGlass(set, body) {
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthMask(false);
  const draw = (array, count, from, colour, opacity) => {
    gl.uniform4f(set("flat_colour"), ...colour, 1);
    gl.uniform1f(set("opacity"), opacity);
    gl.bindVertexArray(array);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * from);
  };
  if (body) draw(surface.array, mesh.facets.length - mesh.inside, mesh.inside, [0.6, 0.62, 0.66], 0.16);
  ghosts.filter((ghost) => ghost.shown).forEach((ghost) => draw(ghost.array, ghost.count, 0, [0.9, 0.45, 0.1], 0.4));
  gl.depthMask(true);
  gl.disable(gl.BLEND);
  gl.uniform1f(set("opacity"), 1);
}
