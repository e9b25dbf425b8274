// The 3-D view: surfaces drawn by niivue, the state of a sweep, a cursor, a cut.
(() => {
  "use strict";
  const message = document.getElementById("stage-message");
  const canvas = document.getElementById("gl");
  const picked = document.getElementById("picked");
  const say = (text) => { message.textContent = text; message.hidden = !text; };
  const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));

  // The library lies in the page compressed; it is unpacked once the page has been painted.
  async function library() {
    const packed = new Blob([bytes(document.getElementById("niivue").textContent)]);
    const text = await new Response(packed.stream().pipeThrough(new DecompressionStream("gzip"))).text();
    const script = document.createElement("script");
    script.textContent = text;
    document.head.append(script);
    return window.niivue;
  }

  // Three thin beams through the cursor, long enough to be seen outside the brain.
  function beams(cursor, [low, high]) {
    const positions = [], triangles = [], half = 0.45;
    for (let axis = 0; axis < 3; axis += 1) {
      const first = positions.length / 3;
      for (let corner = 0; corner < 8; corner += 1) {
        for (let a = 0; a < 3; a += 1) {
          const far = corner >> a & 1;
          positions.push(a === axis ? (far ? high[a] + 14 : low[a] - 14) : cursor[a] + (far ? half : -half));
        }
      }
      for (const quad of [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]) {
        const [a, b, c, d] = quad.map((n) => first + n);
        triangles.push(a, b, c, a, c, d);
      }
    }
    return { positions: new Float32Array(positions), triangles: new Uint32Array(triangles) };
  }

  async function start() {
    say("Loading the 3-D view …");
    const data = JSON.parse(document.getElementById("view-data").textContent);
    const { Niivue, NVMesh, SLICE_TYPE } = await library();
    const dark = [0.07, 0.09, 0.1, 1];
    const nv = new Niivue({ backColor: dark, show3Dcrosshair: false, isOrientCube: true, isColorbar: false,
      logLevel: "error", dragAndDropEnabled: false, crosshairWidth: 0, textHeight: 0.03 });
    await nv.attachToCanvas(canvas);
    const surfaces = data.surfaces.map((s) => ({ name: s.name, positions: new Float32Array(bytes(s.positions).buffer),
      triangles: new Uint32Array(bytes(s.triangles).buffer), colours: bytes(s.colours), ranged: Boolean(s.range) }));
    if (window.hgmStates) surfaces.push(window.hgmStates);
    window.hgmView = surfaces[0];
    let chosen = data.first;
    const meshes = surfaces.map((s, n) => new NVMesh(s.positions, s.triangles, s.name, s.colours, 1.0, n === chosen, nv.gl));
    meshes.forEach((mesh) => nv.addMesh(mesh));

    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    surfaces[0].positions.forEach((x, n) => { low[n % 3] = Math.min(low[n % 3], x); high[n % 3] = Math.max(high[n % 3], x); });
    let cursor = (window.hgmCursor && [...window.hgmCursor]) || low.map((x, a) => (x + high[a]) / 2);
    const lines = beams(cursor, [low, high]);
    const yellow = new Uint8Array(lines.positions.length / 3 * 4).map((_, n) => [240, 228, 66, 255][n % 4]);
    const crosshair = new NVMesh(lines.positions, lines.triangles, "cursor", yellow, 1.0, Boolean(window.hgmCursor), nv.gl);
    nv.addMesh(crosshair);

    nv.setSliceType(SLICE_TYPE.RENDER);
    nv.setRenderAzimuthElevation(120, 15);
    nv.setScale(1.3);
    nv.drawScene();
    say("");
    canvas.dataset.seconds = (performance.now() / 1000).toFixed(2);
    canvas.dataset.ready = "yes";

    const pressed = (buttons, pushed) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === pushed)));
    const choices = [...document.querySelectorAll("[data-surface]")];
    const cutting = document.getElementById("cut"), opacity = document.getElementById("opacity");
    const bars = { values: document.getElementById("view-bar"), states: document.getElementById("states-bar") };

    // What lies on the side that is cut away is left out, triangle by triangle.
    function cut() {
      const side = cutting.value, { positions, triangles } = surfaces[chosen], mesh = meshes[chosen];
      mesh.pts = positions;
      mesh.rgba255 = surfaces[chosen].colours;
      mesh.tris = triangles;
      if (side) {
        const axis = Number(side[1]), sign = side[0] === "+" ? 1 : -1, kept = [];
        for (let t = 0; t < triangles.length; t += 3) {
          if ([0, 1, 2].every((k) => sign * (positions[3 * triangles[t + k] + axis] - cursor[axis]) <= 0)) {
            kept.push(triangles[t], triangles[t + 1], triangles[t + 2]);
          }
        }
        // The inner side has nodes of its own, so that it is lit as what it is.
        const nodes = positions.length / 3, { colours } = surfaces[chosen];
        const inner = kept.map((_, t) => nodes + kept[t - t % 3 + [0, 2, 1][t % 3]]);
        mesh.pts = Float32Array.from([...positions, ...positions]);
        mesh.rgba255 = Uint8Array.from([...colours, ...colours]);
        mesh.tris = new Uint32Array(kept.length ? [...kept, ...inner] : triangles.slice(0, 3));
      }
      mesh.updateMesh(nv.gl);
    }

    function choose(n) {
      chosen = n;
      meshes.forEach((mesh, m) => { mesh.visible = m === n; mesh.opacity = Number(opacity.value); });
      pressed(choices, choices[n]);
      if (bars.values) bars.values.hidden = !surfaces[n].ranged;
      if (bars.states) bars.states.hidden = surfaces[n] !== window.hgmStates;
      cut();
      nv.drawScene();
    }

    function follow(mm) {
      cursor = mm;
      crosshair.visible = true;
      crosshair.pts = beams(cursor, [low, high]).positions;
      crosshair.updateMesh(nv.gl);
      if (cutting.value) cut();
      nv.drawScene();
    }

    choices.forEach((button) => button.addEventListener("click", () => choose(Number(button.dataset.surface))));
    [cutting, opacity].forEach((input) => input.addEventListener("input", () => choose(chosen)));
    document.addEventListener("hgm-states", () => choose(meshes.length - 1));
    document.addEventListener("hgm-cursor", (event) => follow(event.detail));
    document.querySelectorAll("[data-azimuth]").forEach((button) => button.addEventListener("click", () => {
      nv.setRenderAzimuthElevation(Number(button.dataset.azimuth), Number(button.dataset.elevation));
    }));
    canvas.addEventListener("keydown", (event) => {
      const turn = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
      if (!turn) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      nv.setRenderAzimuthElevation(nv.scene.renderAzimuth + turn[0], nv.scene.renderElevation + turn[1]);
    }, { capture: true });

    // Where the line of sight through a click first meets the visible surface.
    function at(clientX, clientY) {
      const box = canvas.getBoundingClientRect(), { pts: positions, tris } = meshes[chosen];
      const [m] = nv.calculateMvpMatrix(null, [0, 0, canvas.width, canvas.height], nv.scene.renderAzimuth, nv.scene.renderElevation);
      const x = 2 * (clientX - box.left) / box.width - 1, y = 1 - 2 * (clientY - box.top) / box.height;
      const seen = new Float32Array(positions.length);
      for (let n = 0; n < positions.length; n += 3) {
        const row = (r) => m[r] * positions[n] + m[4 + r] * positions[n + 1] + m[8 + r] * positions[n + 2] + m[12 + r];
        const w = row(3);
        seen[n] = row(0) / w - x;
        seen[n + 1] = row(1) / w - y;
        seen[n + 2] = row(2) / w;
      }
      let found = null, nearest = Infinity;
      for (let t = 0; t < tris.length; t += 3) {
        const [a, b, c] = [3 * tris[t], 3 * tris[t + 1], 3 * tris[t + 2]];
        const cross = (p, q) => seen[p] * seen[q + 1] - seen[q] * seen[p + 1];
        const parts = [cross(b, c), cross(c, a), cross(a, b)], area = parts[0] + parts[1] + parts[2];
        if (!area || parts.some((part) => part / area < 0)) continue;
        const mean = (values, k) => (parts[0] * values[a + k] + parts[1] * values[b + k] + parts[2] * values[c + k]) / area;
        const depth = mean(seen, 2);
        if (depth < nearest) {
          nearest = depth;
          found = [0, 1, 2].map((k) => mean(positions, k));
        }
      }
      return found;
    }

    // A click is no drag: it ends where it began.
    let down = null;
    canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return;
      const mm = at(event.clientX, event.clientY);
      if (!mm) return;
      follow(mm);
      if (picked) picked.textContent = "Cursor: MNI " + mm.map((x) => ((Math.round(10 * x) || 0) / 10).toFixed(1).replace("-", "\u2212")).join(", ") + " mm (RAS+)";
      document.dispatchEvent(new CustomEvent("hgm-picked", { detail: mm }));
    });
    choose(chosen);
  }

  const begin = () => start().catch((error) => say("The 3-D view could not start (" + error.message + "). The pictures above show the same data."));
  // After the first paint, so that the summary is never kept waiting.
  const idle = window.requestIdleCallback || ((f) => setTimeout(f, 200));
  requestAnimationFrame(() => idle(begin, { timeout: 500 }));
})();
