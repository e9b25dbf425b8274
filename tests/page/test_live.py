#!/usr/bin/env python3
"""Drives the page of `hgm live` in headless Chromium: hand, slider, undo, reset, cut, saving, a second page, a phone's width.

    tests/page/test_live.py HGM CASE|MESH.vtu [SCENARIO.toml] [--pictures DIR] [--seconds N]

Exit code 1 when a check fails. Prints what it measured: steps and pictures a second, hand to picture.
"""

import argparse
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import block  # noqa: E402
from browser import Browser  # noqa: E402

CHECKS = []


def check(function):
    CHECKS.append(function)
    return function


def require(truth, message):
    if not truth:
        raise AssertionError(message)


class Live:
    """A server of its own."""

    def __init__(self, options, body=None):
        self.options, self.body = options, body or options.body

    def __enter__(self):
        words = [self.options.hgm, "live", *self.body, "--no-browser"]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().strip()
        require(self.address.startswith("http://127.0.0.1:"), f"no address: {self.address}")
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        require(code == 0, f"exit code {code}")


def enter(browser, live):
    browser.open(live.address)
    browser.wait_for("document.getElementById('gl').dataset.ready === 'yes'", 60)


def text(browser, name):
    return browser.evaluate(f"document.getElementById({json.dumps(name)}).textContent")


def number(browser, name):
    return float(text(browser, name).split()[0])


def settle(browser, seconds=60):
    # Of all that was sent: what is on the page may still be the rest before.
    browser.wait_for(
        "frame && frame.taken >= sent && frame.still && !fresh && document.getElementById('hz').textContent === 'at rest'", seconds)


def mouse(browser, kind, x, y, buttons=1):
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=buttons, clickCount=1)


def place(browser):
    """A point of the canvas where the brain is."""
    x, y, width, height = browser.evaluate(
        "(() => { const r = document.getElementById('gl').getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; })()")
    return x + 0.5 * width, y + 0.42 * height


def set_slider(browser, name, value):
    browser.evaluate(
        f"(() => {{ const s = document.getElementById({json.dumps(name)}); s.value = {value};"
        " s.dispatchEvent(new Event('input')); })()")


@check
def hand_slider_undo_and_reset_move_the_body_and_bring_it_back(options):
    with Live(options) as live, Browser(served=True) as browser:
        enter(browser, live)
        settle(browser)
        rest = number(browser, "maximum")
        x, y = place(browser)
        mouse(browser, "mousePressed", x, y)
        for n in range(1, 16):
            mouse(browser, "mouseMoved", x + 6 * n, y - 5 * n)
            browser.listen(0.03)
        browser.wait_for("parseFloat(document.getElementById('force').textContent) > 0.01", 20)
        pulled = number(browser, "maximum")
        require(abs(pulled - rest) > 1, f"moved by {pulled} mm while pulled, {rest} at rest")
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            browser.picture(options.pictures / "pulled.png")
        mouse(browser, "mouseReleased", x + 90, y - 75, 0)
        settle(browser)
        require(abs(number(browser, "maximum") - rest) < 0.02, f"{number(browser, 'maximum')} after letting go, {rest} before")
        browser.evaluate("document.querySelectorAll('input[name=tool]')[2].click()")
        mouse(browser, "mousePressed", x, y)
        browser.wait_for("parseFloat(document.getElementById('force').textContent.split(',')[1]) > 0.005", 20)
        if options.pictures:
            browser.picture(options.pictures / "ball.png")
        mouse(browser, "mouseReleased", x, y, 0)
        settle(browser)
        set_slider(browser, "modulus-0", browser.evaluate("Number(document.getElementById('modulus-0').value) - 1"))
        browser.wait_for(f"parseFloat(document.getElementById('maximum').textContent) > {rest + 0.2}", 30)
        settle(browser)
        soft = number(browser, "maximum")
        browser.evaluate("document.getElementById('undo').click()")
        browser.wait_for(f"parseFloat(document.getElementById('maximum').textContent) < {soft - 0.1}", 30)
        settle(browser)
        require(abs(number(browser, "maximum") - rest) < 0.02, "undo does not bring it back")
        # From another rest, so that nobody has to catch the body on its way.
        set_slider(browser, "modulus-0", browser.evaluate("Number(document.getElementById('modulus-0').value) - 1"))
        browser.wait_for(f"parseFloat(document.getElementById('maximum').textContent) > {rest + 0.2}", 30)
        settle(browser)
        browser.evaluate("document.getElementById('reset').click()")
        browser.wait_for(f"parseFloat(document.getElementById('maximum').textContent) < {rest + 0.1}", 30)
        settle(browser)
        require(abs(number(browser, "maximum") - rest) < 0.02, "reset does not lead to the same rest")
        require(not browser.complaints(), f"complaints: {browser.complaints()}")
        outside = [url for url in browser.requests() if not url.startswith(live.address)]
        require(not outside, f"requests: {outside}")
        return f"rest {rest} mm, pulled {pulled} mm, softer {soft} mm"


@check
def what_is_saved_is_a_picture_a_vtu_and_a_scenario(options):
    with Live(options) as live, Browser(served=True) as browser:
        enter(browser, live)
        settle(browser)
        browser.evaluate("""
          window.saved = [];
          URL.createObjectURL = (blob) => { blob.slice(0, 200).text().then((t) => saved.push([blob.size, t])); return 'data:,'; };
          HTMLAnchorElement.prototype.click = () => {};
          ['picture', 'vtu', 'scenario'].forEach((id) => document.getElementById(id).click());""")
        browser.wait_for("saved.length === 3", 30)
        heads = browser.evaluate("saved")
        for start in ["PNG", "VTKFile", "hgm simulate"]:
            require(any(start in head for _, head in heads), f"nothing begins with {start}: {heads}")
        return ", ".join(f"{size} bytes" for size, _ in heads)


def choose(browser, name, value):
    browser.evaluate(
        f"(() => {{ const s = document.getElementById({json.dumps(name)}); s.value = {json.dumps(value)};"
        " s.dispatchEvent(new Event('change')); })()")


@check
def resected_tissue_is_taken_out_put_back_and_the_margin_stands_alone(options):
    with tempfile.TemporaryDirectory() as folder:
        body = block.write(pathlib.Path(folder))
        with Live(options, body) as live, Browser(served=True) as browser:
            enter(browser, live)
            settle(browser)
            rest, whole = number(browser, "maximum"), browser.evaluate("[mesh.facets.length, mesh.tets.length]")
            require(browser.evaluate("!document.getElementById('resection-row').hidden"), "no box to take the tissue out")
            browser.evaluate("document.getElementById('resection').click()")
            browser.wait_for("mesh.removed", 20)
            settle(browser)
            left = browser.evaluate("[mesh.facets.length, mesh.tets.length]")
            require(left[1] == whole[1] - 4 * 8 * 6, f"{whole} before, {left} after")
            require(browser.evaluate("mesh.inside") == 3 * 16, f"{browser.evaluate('mesh.inside')} indices of the margin")
            choose(browser, "show", "walls")
            if options.pictures:
                browser.picture(options.pictures / "margin.png")
            require(abs(number(browser, "maximum") - rest) > 0.005, f"{rest} mm whole, {number(browser, 'maximum')} mm without")
            browser.evaluate("document.getElementById('undo').click()")
            browser.wait_for("!mesh.removed && !document.getElementById('resection').checked", 20)
            settle(browser)
            require(browser.evaluate("[mesh.facets.length, mesh.tets.length]") == whole, "what is put back is not what was there")
            require(abs(number(browser, "maximum") - rest) < 0.011, f"{rest} mm before, {number(browser, 'maximum')} mm after")
            require(not browser.complaints(), f"complaints: {browser.complaints()}")
            return f"{whole[1] // 4} cells whole, {left[1] // 4} without"


@check
def what_a_case_knows_is_seen_and_nothing_else_is_offered(options):
    with Live(options) as live, Browser(served=True) as browser:
        enter(browser, live)
        settle(browser)
        known = browser.evaluate("hello.colours")
        offered = browser.evaluate("[...document.getElementById('colour').options].filter((o) => !o.disabled).map((o) => o.value)")
        require(known == offered and "prior_sd" in known, f"known {known}, offered {offered}")
        ranges = []
        for colour in known:
            shown = browser.evaluate("shown")
            choose(browser, "colour", colour)
            browser.wait_for(f"shown > {shown}", 120)
            browser.listen(0.3)
            low, high = browser.evaluate("[frame.scalar.reduce((a, b) => Math.min(a, b)), frame.scalar.reduce((a, b) => Math.max(a, b))]")
            require(high > 0 and low >= -1, f"{colour}: {low} to {high}")
            ranges.append(f"{colour} to {high:.3g}")
            if options.pictures:
                browser.picture(options.pictures / f"colour-{colour}.png")
        boxes = browser.evaluate("document.querySelectorAll('#ghosts input').length")
        require(boxes == browser.evaluate("ghosts.length"), f"{boxes} boxes")
        browser.evaluate("document.querySelectorAll('#ghosts input').forEach((box) => box.click())")
        require(browser.evaluate("ghosts.every((ghost) => ghost.shown && ghost.count > 0)"), "a ghost is not shown")
        choose(browser, "cut", "2")
        if browser.evaluate("scan.known"):
            # The scan is grey, whatever the colours of the numbers: every point of the cut that is not ground.
            browser.evaluate("document.getElementById('scan').click()")
            browser.evaluate("Object.assign(camera, { pitch: 1.5 })")
            browser.wait_for("!turned && sections > 10", 20)
            middle = browser.evaluate("""(() => { draw(); const w = gl.drawingBufferWidth >> 1, h = gl.drawingBufferHeight >> 1, out = new Uint8Array(4 * 1600);
              gl.readPixels(w - 20, h - 20, 40, 40, gl.RGBA, gl.UNSIGNED_BYTE, out);
              let grey = 0, values = new Set();
              for (let k = 0; k < 1600; k += 1) { const [r, g, b] = out.slice(4 * k, 4 * k + 3); grey += r === g && g === b; values.add(r); }
              return [grey, values.size]; })()""")
            require(middle[1] > 10, f"the scan is one grey: {middle}")
            require(boxes or middle[0] > 1500, f"of 1600 points {middle[0]} are grey")
        if options.pictures:
            browser.picture(options.pictures / "ghosts-and-scan.png")
        require(not browser.complaints(), f"complaints: {browser.complaints()}")
        return f"{', '.join(ranges)}; {boxes} targets; scan {browser.evaluate('scan.known')}"


def shown_names(browser):
    """What is shown by the legend, the select and the frame itself."""
    return browser.evaluate("""(() => { const select = document.getElementById('colour');
      return [document.getElementById('quantity').textContent, select.selectedOptions[0].textContent, select.value,
        hello.colours[frame.colour], document.getElementById('unit').textContent]; })()""")


@check
def a_page_that_is_loaded_again_names_what_is_shown_and_what_the_body_has(options):
    with Live(options) as live, Browser(served=True) as browser:
        enter(browser, live)
        choose(browser, "colour", "energy")
        # A way to lie that no scenario here has: its own, chosen by another name, is named as the scenario's.
        choose(browser, "gravity", "0,9.81,0")
        settle(browser)
        before = shown_names(browser)
        # The first page has to be gone before another may come.
        browser.open("about:blank")
        browser.listen(1)
        enter(browser, live)
        settle(browser)
        after = shown_names(browser)
        require(before == after and after[2:] == ["energy", "energy", "Pa"] and after[0] == after[1], f"{before}, then {after}")
        gravity = browser.evaluate("document.getElementById('gravity').value")
        require(gravity == "0,9.81,0", f"gravity {gravity!r}")
        choose(browser, "gravity", "own")
        settle(browser)
        # What is refused goes back to what there is: a label says the body's number, not the slider's.
        browser.evaluate("send({ do: 'modulus', tissue: hello.tissues[0].name, pa: 30000 })")
        browser.evaluate("send({ do: 'colour', by: 'no such thing' })")
        browser.wait_for("document.getElementById('modulus-0-said').textContent === '30000 Pa'", 20)
        require(shown_names(browser) == before, f"after a refusal {shown_names(browser)}")
        return ", ".join(after)


@check
def a_second_page_is_told_and_the_first_goes_on(options):
    with Live(options) as live, Browser(served=True) as first, Browser(served=True) as second:
        enter(first, live)
        second.open(live.address)
        second.wait_for("document.getElementById('said').textContent.includes('another page')", 30)
        first.evaluate("document.getElementById('reset').click()")
        first.wait_for("document.getElementById('hz').textContent !== 'at rest'", 30)


@check
def keys_turn_and_pause_a_cut_opens_and_a_phone_needs_no_sideways_scrolling(options):
    with Live(options) as live, Browser(width=400, height=800, dark=True, served=True) as browser:
        enter(browser, live)
        wide = browser.evaluate("document.documentElement.scrollWidth")
        require(wide <= 400, f"{wide} px wide")
        yaw = browser.evaluate("document.getElementById('gl').focus() || camera.yaw")
        browser.key("ArrowRight", 39)
        require(browser.evaluate("camera.yaw") > yaw, "the arrow key turns nothing")
        browser.evaluate("(() => { const c = document.getElementById('cut'); c.value = '0'; c.dispatchEvent(new Event('change')); })()")
        browser.wait_for("sections > 10", 20)
        browser.evaluate("document.activeElement.blur()")
        browser.key(".", 190)
        browser.evaluate("document.getElementById('pause').click()")
        browser.wait_for("document.getElementById('hz').textContent === 'paused'", 20)
        unlabelled = browser.evaluate(
            "[...document.querySelectorAll('input, select')].filter((e) => !e.labels.length && !e.ariaLabel).map((e) => e.id)")
        require(not unlabelled, f"without a label: {unlabelled}")
        if options.pictures:
            browser.picture(options.pictures / "phone-dark-cut.png")
        require(not browser.complaints(), f"complaints: {browser.complaints()}")


@check
def rates_are_measured(options):
    with Live(options) as live, Browser(served=True) as browser:
        enter(browser, live)
        x, y = place(browser)
        mouse(browser, "mousePressed", x, y)
        begin, n = time.monotonic(), 0
        rates, pictures = [], []
        # A busy machine takes longer to read three times.
        while time.monotonic() < begin + (60 if len(rates) < 3 else options.seconds):
            n += 1
            mouse(browser, "mouseMoved", x + 40 * (n % 40) / 40, y - 60 * (n % 25) / 25)
            browser.listen(0.015)
            if n % 20 == 0:
                said = text(browser, "hz")
                rates += [float(said.split()[0])] if said.endswith("Hz") else []
                pictures.append(number(browser, "fps"))
        mouse(browser, "mouseReleased", x, y, 0)
        browser.listen(0.6)
        require(rates and pictures, "nothing was measured")
        middle = sorted(rates)[len(rates) // 2], sorted(pictures)[len(pictures) // 2]
        require(middle[0] > 0 and middle[1] > 0, f"stands still: {middle}")
        return f"{middle[0]:.0f} steps/s, {middle[1]:.0f} pictures/s, hand to picture {text(browser, 'latency')} (medians)"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("hgm")
    parser.add_argument("body", nargs="+")
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for pictures")
    parser.add_argument("--seconds", type=float, default=4, help="how long rates are measured")
    parser.add_argument("--only", help="run the checks whose name contains this")
    options = parser.parse_args()
    if options.pictures:
        options.pictures.mkdir(parents=True, exist_ok=True)
    failed = 0
    for function in CHECKS:
        if options.only and options.only not in function.__name__:
            continue
        try:
            said = function(options)
            print(f"  ok     {function.__name__}" + (f": {said}" if said else ""), flush=True)
        except (AssertionError, RuntimeError, TimeoutError, OSError) as error:
            failed += 1
            print(f"  FAILED {function.__name__}: {error}", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
