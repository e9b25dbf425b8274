(() => {
  "use strict";
  const message = document.getElementById("stage-message");
  const canvas = document.getElementById("gl");
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

  async function start() {
    say("Loading the 3-D view …");
    const data = JSON.parse(document.getElementById("view-data").textContent);
    const { Niivue, NVMesh, SLICE_TYPE } = await library();
    const dark = [0.07, 0.09, 0.1, 1];
    const nv = new Niivue({ backColor: dark, show3Dcrosshair: false, isOrientCube: true, isColorbar: false,
      logLevel: "error", dragAndDropEnabled: false, crosshairWidth: 0, textHeight: 0.03 });
    await nv.attachToCanvas(canvas);
    const meshes = data.surfaces.map((s, n) => new NVMesh(
      new Float32Array(bytes(s.positions).buffer), new Uint32Array(bytes(s.triangles).buffer), s.name,
      bytes(s.colours), 1.0, n === data.first, nv.gl));
    meshes.forEach((mesh) => nv.addMesh(mesh));
    nv.setSliceType(SLICE_TYPE.RENDER);
    nv.setRenderAzimuthElevation(120, 15);
    nv.setScale(1.3);
    nv.drawScene();
    say("");
    canvas.dataset.seconds = (performance.now() / 1000).toFixed(2);
    canvas.dataset.ready = "yes";

    const pressed = (buttons, chosen) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === chosen)));
    const choices = [...document.querySelectorAll("[data-surface]")];
    choices.forEach((button) => button.addEventListener("click", () => {
      meshes.forEach((mesh, n) => { mesh.visible = n === Number(button.dataset.surface); });
      pressed(choices, button);
      nv.drawScene();
    }));
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
  }

  const begin = () => start().catch((error) => say("The 3-D view could not start (" + error.message + "). The pictures above show the same data."));
  // After the first paint, so that the summary is never kept waiting.
  const idle = window.requestIdleCallback || ((f) => setTimeout(f, 200));
  requestAnimationFrame(() => idle(begin, { timeout: 500 }));
})();
