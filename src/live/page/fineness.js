// --- How fine a picture is. Where the processor draws, every point of a picture is taken from the solver: what moves is drawn as coarsely
// as it must be to keep pace, what is still once more and finely.
const software = (() => {
  const probe = document.createElement("canvas").getContext("webgl2");
  const told = probe && probe.getExtension("WEBGL_debug_renderer_info");
  const name = told ? probe.getParameter(told.UNMASKED_RENDERER_WEBGL) : "";
  if (probe) probe.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
})();
const fineness = {
  /// Of a screen's points along an axis. Where the processor draws, half of them are enough for what moves: more would be
  /// taken from the solver (docs/evidence/choices.md, "Live view").
  steps: software ? [0.5, 0.35] : [1],
  /// Without several samples a point, more points make up for it at rest.
  atRest: software ? 1.5 : 1,
  at: 0, coarse: false, last: 0, mean: 0, count: 0,
  moving() { return this.steps[this.at]; },
  /// A picture of what moves was drawn: slower than 30 ms coarser pictures come, near the screen's own pace finer ones.
  drawn(now) {
    const gap = now - this.last;
    this.last = now;
    if (!software || gap > 400) { this.count = 0; return; }
    this.mean = this.count ? 0.8 * this.mean + 0.2 * gap : gap;
    this.count += 1;
    if (this.count < 12) return;
    const by = this.mean > 30 ? 1 : this.mean < 18 ? -1 : 0, next = this.at + by;
    if (by && next >= 0 && next < this.steps.length) [this.at, this.count] = [next, 0];
  },
};
const gl = canvas.getContext("webgl2", { antialias: !software, alpha: false });
