// The states of a sweep as one surface: between two simulated samples its nodes are interpolated.
(() => {
  "use strict";
  function begin() {
    const data = JSON.parse(document.getElementById("states-data").textContent);
    const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const rest = new Float32Array(bytes(data.positions).buffer);
    const states = data.states.map((s) => new Int16Array(bytes(s).buffer));
    const palette = bytes(data.colours);
    const inputs = data.stops.map((_, axis) => document.getElementById("states-" + axis));
    const said = document.getElementById("states-said");
    const positions = new Float32Array(rest), colours = new Uint8Array(rest.length / 3 * 4).fill(255);
    const [low, high] = data.range_mm;

    // Three digits, thousands apart, as everywhere on the page.
    const three = (value) => {
      const step = 10 ** Math.max(0, Math.floor(Math.log10(value)) - 2);
      return value < 100 ? value.toPrecision(3) : String(Math.round(value / step) * step).replace(/\B(?=(\d{3})+$)/g, ",");
    };

    // Where the sliders stand: for every axis the stop below and the way to the next one.
    const stand = () => inputs.map((input, axis) => {
      const at = Math.min(Number(input.value), data.stops[axis] - 1), below = Math.min(Math.floor(at), data.stops[axis] - 2);
      return { below, way: at - below };
    });

    function tell(where) {
      const moduli = data.tissues.map((tissue) => {
        const { below, way } = where[tissue.axis], [a, b] = [tissue.moduli_pa[below], tissue.moduli_pa[below + 1]];
        return `${tissue.name} ${three(a * (b / a) ** way)} Pa`;
      });
      const exact = where.every(({ way }) => way === 0 || way === 1);
      const name = (more) => data.samples[where.reduce((n, { below, way }, axis) =>
        n + (below + more(way)) * (axis ? data.stops[0] : 1), 0)];
      const who = exact ? `${name((way) => way)}: ${moduli.join(", ")}, simulated`
        : `${moduli.join(", ")}, interpolated between ${name(Math.floor)} and ${name(Math.ceil)}`;
      said.textContent = who;
      inputs.forEach((input) => input.setAttribute("aria-valuetext", who));
    }

    function show() {
      const where = stand();
      // The corners of the cell with their shares: two for one slider, four for two.
      let corners = [[0, 1]];
      where.forEach(({ below, way }, axis) => {
        const stride = axis ? data.stops[0] : 1;
        corners = corners.flatMap(([n, share]) => [[n + below * stride, share * (1 - way)], [n + (below + 1) * stride, share * way]]);
      });
      corners = corners.filter(([, share]) => share > 0);
      for (let n = 0; n < rest.length; n += 3) {
        const u = [0, 0, 0];
        for (const [state, share] of corners) for (let a = 0; a < 3; a += 1) u[a] += share * data.step_mm * states[state][n + a];
        for (let a = 0; a < 3; a += 1) positions[n + a] = rest[n + a] + u[a];
        const t = high > low ? (Math.hypot(...u) - low) / (high - low) : 0;
        const c = 3 * Math.round(255 * Math.min(1, Math.max(0, t)));
        for (let a = 0; a < 3; a += 1) colours[n / 3 * 4 + a] = palette[c + a];
      }
      tell(where);
    }

    window.hgmStates = { positions, colours, triangles: new Uint32Array(bytes(data.triangles).buffer), name: "any sample" };
    show();
    inputs.forEach((input) => input.addEventListener("input", () => {
      show();
      document.dispatchEvent(new CustomEvent("hgm-states"));
    }));
  }

  // After the first paint, so that the summary is never kept waiting; the scripts begin in the order they stand in.
  const idle = window.requestIdleCallback || ((f) => setTimeout(f, 200));
  requestAnimationFrame(() => idle(begin, { timeout: 500 }));
})();
