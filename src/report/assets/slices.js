// Three slices of a scan through one cursor, with the lines in which they cut the surfaces.
(() => {
  "use strict";
  function begin() {
    const data = JSON.parse(document.getElementById("slices-data").textContent);
    const surfaces = JSON.parse(document.getElementById("view-data").textContent).surfaces;
    const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const { size, corner_mm: corner, step_mm: step } = data;
    // Of every plane: its axis, and what runs from the right edge to the left and from the bottom to the top.
    const planes = { axial: [2, 0, 1], coronal: [1, 0, 2], sagittal: [0, 1, 2] };
    const canvases = [...document.querySelectorAll("canvas.slice")];
    const buttons = [...document.querySelectorAll("[data-scan]")];
    const said = document.getElementById("cursor");
    const cursor = [...data.focus_mm];
    window.hgmCursor = cursor;
    const scans = [];
    let scan = 0, shown = null;

    const meshes = surfaces.map((s) => ({
      positions: new Float32Array(bytes(s.positions).buffer), triangles: new Uint32Array(bytes(s.triangles).buffer),
    }));

    async function unpack(n) {
      if (scans[n]) return;
      const packed = new Blob([bytes(data.scans[n].gzip)]);
      scans[n] = new Uint8Array(await new Response(packed.stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer());
    }

    const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
    const end = (axis) => corner[axis] + step * (size[axis] - 1);

    // The voxels of a plane, between the two layers next to the cursor.
    function picture([axis, across, up]) {
      const [w, h] = [size[across], size[up]], image = new ImageData(w, h), stride = [1, size[0], size[0] * size[1]];
      const at = clamp((cursor[axis] - corner[axis]) / step, 0, size[axis] - 1), layer = Math.min(Math.floor(at), size[axis] - 2), way = at - layer;
      const values = scans[scan];
      for (let y = 0; y < h; y += 1) {
        for (let x = 0; x < w; x += 1) {
          const n = layer * stride[axis] + (w - 1 - x) * stride[across] + (h - 1 - y) * stride[up];
          const grey = (values[n] * (1 - way) + values[n + stride[axis]] * way) * 255 / data.greys, p = 4 * (x + y * w);
          image.data[p] = image.data[p + 1] = image.data[p + 2] = grey;
          image.data[p + 3] = 255;
        }
      }
      const canvas = new OffscreenCanvas(w, h);
      canvas.getContext("2d").putImageData(image, 0, 0);
      return canvas;
    }

    // The lines in which a plane cuts a surface: one for every triangle that has nodes on both sides.
    function cut(context, { positions, triangles }, [axis, across, up], place) {
      const level = cursor[axis] + 1e-4;
      context.beginPath();
      for (let t = 0; t < triangles.length; t += 3) {
        const ends = [];
        for (let k = 0; k < 3; k += 1) {
          const a = 3 * triangles[t + k], b = 3 * triangles[t + (k + 1) % 3];
          const da = positions[a + axis] - level, db = positions[b + axis] - level;
          if (da < 0 === db < 0) continue;
          const w = da / (da - db);
          ends.push(place(positions[a + across] * (1 - w) + positions[b + across] * w, positions[a + up] * (1 - w) + positions[b + up] * w));
        }
        if (ends.length === 2) {
          context.moveTo(...ends[0]);
          context.lineTo(...ends[1]);
        }
      }
      context.stroke();
    }

    function draw(canvas) {
      const plane = planes[canvas.dataset.plane], [, across, up] = plane, context = canvas.getContext("2d");
      const [w, h] = [canvas.width, canvas.height], sx = w / size[across], sy = h / size[up];
      // Pixel centres of the scan are its voxels' centres.
      const place = (mmAcross, mmUp) =>
        [w - ((mmAcross - corner[across]) / step + 0.5) * sx, h - ((mmUp - corner[up]) / step + 0.5) * sy];
      context.imageSmoothingQuality = "high";
      context.drawImage(picture(plane), 0, 0, w, h);
      const thin = w / size[across] / 2;
      context.lineWidth = 0.9 * thin;
      context.strokeStyle = "#56b4e9";
      context.setLineDash([]);
      cut(context, meshes[0], plane, place);
      if (shown) {
        context.strokeStyle = "#ffb000";
        context.lineWidth = 1.4 * thin;
        cut(context, shown, plane, place);
      }
      const [x, y] = place(cursor[across], cursor[up]), gap = 5 * thin;
      context.strokeStyle = "#ffffff";
      context.lineWidth = 0.6 * thin;
      context.beginPath();
      for (const [a, b] of [[[0, y], [x - gap, y]], [[x + gap, y], [w, y]], [[x, 0], [x, y - gap]], [[x, y + gap], [x, h]]]) {
        context.moveTo(...a);
        context.lineTo(...b);
      }
      context.stroke();
    }

    const tenth = (mm) => ((Math.round(10 * mm) || 0) / 10).toFixed(1).replace("-", "\u2212");
    const told = (mm) => mm.map(tenth).join(", ");

    function tell() {
      const frames = data.frames.map(({ name, from_mni: rows }) =>
        `${name} ${told(rows.map((r) => r[0] * cursor[0] + r[1] * cursor[1] + r[2] * cursor[2] + r[3]))}`);
      said.textContent = [`MNI ${told(cursor)}`, ...frames].join(" \u00b7 ") + " mm (RAS+)";
    }

    function refresh() {
      if (scans[scan]) canvases.forEach(draw);
      tell();
    }

    // The view has followed a pick of its own already.
    function move(mm, from) {
      for (let a = 0; a < 3; a += 1) cursor[a] = clamp(mm[a], corner[a], end(a));
      refresh();
      if (from !== "view") document.dispatchEvent(new CustomEvent("hgm-cursor", { detail: [...cursor] }));
    }

    function point(canvas, event) {
      const [, across, up] = planes[canvas.dataset.plane], box = canvas.getBoundingClientRect(), mm = [...cursor];
      mm[across] = corner[across] + step * ((1 - (event.clientX - box.left) / box.width) * size[across] - 0.5);
      mm[up] = corner[up] + step * ((1 - (event.clientY - box.top) / box.height) * size[up] - 0.5);
      move(mm);
    }

    canvases.forEach((canvas) => {
      const [axis, across, up] = planes[canvas.dataset.plane];
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        point(canvas, event);
      });
      canvas.addEventListener("pointermove", (event) => { if (event.buttons & 1) point(canvas, event); });
      canvas.addEventListener("keydown", (event) => {
        const by = { ArrowLeft: [across, 1], ArrowRight: [across, -1], ArrowUp: [up, 1], ArrowDown: [up, -1], PageUp: [axis, 1], PageDown: [axis, -1] }[event.key];
        if (!by) return;
        event.preventDefault();
        const mm = [...cursor];
        mm[by[0]] += by[1] * (event.shiftKey ? 10 : 1);
        move(mm);
      });
    });

    buttons.forEach((button) => button.addEventListener("click", async () => {
      await unpack(Number(button.dataset.scan));
      scan = Number(button.dataset.scan);
      buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === button)));
      refresh();
    }));
    document.addEventListener("hgm-picked", (event) => move(event.detail, "view"));

    // The surface that is chosen: the pressed button's, or the sweep's.
    const choose = (n) => { shown = n === 0 ? null : meshes[n] || window.hgmStates; };
    document.querySelectorAll("[data-surface]").forEach((button) => button.addEventListener("click", () => {
      choose(Number(button.dataset.surface));
      refresh();
    }));
    document.addEventListener("hgm-states", () => {
      shown = window.hgmStates;
      refresh();
    });

    choose(Number(document.querySelector("[data-surface][aria-pressed=true]").dataset.surface));
    tell();
    unpack(0).then(() => {
      refresh();
      canvases.forEach((canvas) => { canvas.dataset.ready = "yes"; });
    });
  }

  // After the first paint, so that the summary is never kept waiting; the scripts begin in the order they stand in.
  const idle = window.requestIdleCallback || ((f) => setTimeout(f, 200));
  requestAnimationFrame(() => idle(begin, { timeout: 500 }));
})();
