#!/usr/bin/env python3
"""Looks at reports in headless Chromium: no outside request, no complaint, a 3-D view that shows something, colour bars that
mean what they say, a page that can be read without JavaScript, by keyboard and by colour-blind readers.

    tests/page/test_page.py REPORT.html ... --pictures DIR

Exit code 1 when a check fails. DIR gets a picture of every section.
"""

import argparse
import base64
import importlib.util
import json
import pathlib
import re
import sys
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from browser import Browser  # noqa: E402

CHECKS = []
# What a page may take on two idle cores; a loaded machine gets more through --slack.
FIRST_PAINT_S, VIEW_S, SIZE_BYTES, PAGES = 1.0, 3.0, 10_000_000, 8


def check(function):
    CHECKS.append(function)
    return function


def require(truth, message):
    if not truth:
        raise AssertionError(message)


def pixels(png):
    """Rows of a non-interlaced 8-bit RGB(A) PNG, as lists of tuples (PNG specification, section 9: filters)."""
    at, data, width, height, channels = 8, b"", 0, 0, 3
    while at < len(png):
        size, kind = int.from_bytes(png[at:at + 4], "big"), png[at + 4:at + 8]
        body = png[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height = int.from_bytes(body[:4], "big"), int.from_bytes(body[4:8], "big")
            channels = {2: 3, 6: 4}[body[9]]
        elif kind == b"IDAT":
            data += body
        at += 12 + size
    raw, stride, rows, above = zlib.decompress(data), width * channels, [], bytearray(width * channels)
    for y in range(height):
        kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for x in range(stride):
            left = row[x - channels] if x >= channels else 0
            up, corner = above[x], above[x - channels] if x >= channels else 0
            if kind == 1:
                row[x] = row[x] + left & 255
            elif kind == 2:
                row[x] = row[x] + up & 255
            elif kind == 3:
                row[x] = row[x] + (left + up) // 2 & 255
            elif kind == 4:
                guess = left + up - corner
                row[x] = row[x] + min((left, up, corner), key=lambda v: abs(guess - v)) & 255
        rows.append([tuple(row[x:x + 3]) for x in range(0, stride, channels)])
        above = row
    return rows


def rectangle(browser, selector):
    return browser.evaluate(
        f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
        " return [r.x + scrollX, r.y + scrollY, r.width, r.height]; })()")


def has(browser, selector):
    return browser.evaluate(f"document.querySelector({json.dumps(selector)}) !== null")


def view_ready(browser, timeout=60):
    browser.wait_for("document.getElementById('gl').dataset.ready === 'yes'", timeout)
    browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    browser.evaluate("document.getElementById('stage').scrollIntoView({block: 'center'})")
    browser.listen(0.5)


def inked(browser):
    """Share of the 3-D canvas that is not background, the number of its colours, and its pixels."""
    rows = pixels(browser.picture(clip=rectangle(browser, "#stage"), scale=0.5))
    ground = rows[5][len(rows[0]) // 2]
    flat = [p for row in rows for p in row]
    far = sum(1 for p in flat if max(abs(a - b) for a, b in zip(p, ground)) > 24)
    return far / len(flat), len(set(flat)), rows


@check
def opens_from_disk_quickly_and_small(page, options):
    size = page.stat().st_size
    require(size < SIZE_BYTES, f"{size} bytes")
    with Browser() as browser:
        browser.open(page.as_uri())
        browser.wait_for("performance.getEntriesByName('first-contentful-paint').length > 0")
        paint = browser.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime") / 1000
        require(paint <= FIRST_PAINT_S * options.slack, f"first paint after {paint:.2f} s")
        text = f"{size / 1e6:.2f} MB, first paint {paint:.2f} s"
        if has(browser, "#gl"):
            browser.wait_for("document.getElementById('gl').dataset.ready === 'yes'", 60)
            ready = browser.evaluate("Number(document.getElementById('gl').dataset.seconds)")
            require(ready <= VIEW_S * options.slack, f"3-D view after {ready:.2f} s")
            text += f", 3-D view {ready:.2f} s"
        return text


@check
def asks_nothing_of_other_places_and_has_no_complaints(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if has(browser, "#gl"):
            view_ready(browser)
        for button in ["[data-surface]", "[data-azimuth]", "input[type=radio]", "details > summary"]:
            browser.evaluate(f"document.querySelectorAll({json.dumps(button)}).forEach((b) => b.click())")
        browser.listen(1)
        require(not browser.requests(), f"requests: {browser.requests()}")
        require(not browser.complaints(), f"complaints: {browser.complaints()}")
        return "0 requests, 0 complaints"


@check
def a_request_and_a_complaint_would_be_seen(page, _):
    with Browser() as browser:
        browser.open("data:text/html,<img src='http://example.org/x.png'><script>console.error('no')</script>")
        browser.listen(1)
        require("http://example.org/x.png" in browser.requests(), f"seen: {browser.requests()}")
        require("no" in browser.complaints(), f"seen: {browser.complaints()}")


@check
def the_view_shows_every_surface_and_turns_by_keyboard(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "#gl"):
            return "no 3-D view on this page"
        view_ready(browser)
        shares = []
        for n in range(browser.evaluate("document.querySelectorAll('[data-surface]').length")):
            browser.evaluate(f"document.querySelectorAll('[data-surface]')[{n}].click()")
            browser.listen(0.4)
            share, colours, _ = inked(browser)
            shares.append(round(share, 3))
            require(share > 0.02 and colours > 50, f"surface {n}: {share:.3f} of the canvas, {colours} colours")
        browser.evaluate("document.getElementById('gl').focus()")
        _, _, before = inked(browser)
        for _ in range(6):
            browser.key("ArrowRight", 39)
        browser.listen(0.5)
        _, _, after = inked(browser)
        require(before != after, "the arrow keys turn nothing")
        return f"{len(shares)} surfaces, share of the canvas {shares}"


@check
def the_slider_goes_through_the_samples_by_keyboard(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "#states-0"):
            return "no slider on this page"
        view_ready(browser)
        sliders = browser.evaluate("document.querySelectorAll('input.states').length")
        positions = "[...window.hgmStates.positions].filter((_, n) => n % 11 === 0)"
        said = "document.getElementById('states-said').textContent"
        for n in range(sliders):
            slider = f"document.getElementById('states-{n}')"
            put = "(v) => { const s = %s; s.value = v; s.dispatchEvent(new Event('input')); }" % slider
            states = [browser.evaluate(f"(({put})({value}), {positions})") for value in (1, 2, 1.5)]
            require(states[0] != states[1], "two samples have one shape")
            worst = max(abs(m - (a + b) / 2) for a, b, m in zip(*states))
            require(worst < 1e-3, f"half way is {worst} mm off the middle of both")
            require("interpolated between" in browser.evaluate(said), browser.evaluate(said))
            browser.evaluate(f"({put})(2)")
            require(browser.evaluate(said).endswith("simulated") and "interpolated" not in browser.evaluate(said), browser.evaluate(said))
            before = browser.evaluate(said)
            browser.evaluate(f"{slider}.focus()")
            browser.key("ArrowLeft", 37)
            browser.listen(0.3)
            require(browser.evaluate(said) != before, "the arrow keys move no slider")
            require(browser.evaluate(f"{slider}.getAttribute('aria-valuetext') === {said}"), "a screen reader is told something else")
            # Back on a sample: what the next slider says is about itself alone.
            browser.evaluate(f"({put})(2)")
        pushed = browser.evaluate("document.querySelector('[data-surface][aria-pressed=true]').textContent")
        require(pushed == "any sample", f"the slider moves what is not shown: {pushed}")
        require(not browser.evaluate("document.getElementById('states-bar').hidden"), "no bar says what the colours mean")
        share, colours, _ = inked(browser)
        require(share > 0.02 and colours > 50, f"{share:.3f} of the canvas, {colours} colours")
        return f"{sliders} slider(s): {browser.evaluate(said)}"


def numbers(text):
    return [float(n) for n in re.findall(r"-?\d+\.\d+", text.replace("\u2212", "-"))]


def press(browser, selector, fractions):
    x, y, width, height = browser.evaluate(
        f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
        " return [r.x, r.y, r.width, r.height]; })()")
    for kind in ["mousePressed", "mouseReleased"]:
        browser.call("Input.dispatchMouseEvent", type=kind, x=x + fractions[0] * width, y=y + fractions[1] * height,
                     button="left", buttons=1, clickCount=1)
    browser.listen(0.4)


@check
def a_click_moves_the_cursor_in_every_slice(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "canvas.slice"):
            return "no slices on this page"
        browser.wait_for("document.querySelector('canvas.slice').dataset.ready === 'yes'", 60)
        browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        browser.evaluate("document.querySelector('canvas.slice').scrollIntoView({block: 'center'})")
        data = browser.evaluate("(({size, corner_mm, step_mm}) => ({size, corner_mm, step_mm}))"
                                "(JSON.parse(document.getElementById('slices-data').textContent))")
        said = "document.getElementById('cursor').textContent"
        seen = "[...document.querySelectorAll('canvas.slice')].map((c) => c.toDataURL())"
        before = browser.evaluate(seen)
        z = numbers(browser.evaluate(said))[2]
        press(browser, "canvas[data-plane=axial]", (0.25, 0.4))
        after, places = browser.evaluate(seen), numbers(browser.evaluate(said))
        require(all(a != b for a, b in zip(before, after)), "a slice has not followed")
        expected = [data["corner_mm"][a] + data["step_mm"] * ((1 - f) * data["size"][a] - 0.5) for a, f in ((0, 0.25), (1, 0.4))]
        require(all(abs(a - b) < 1 for a, b in zip(places, expected)) and places[2] == z, f"{places} instead of {expected}, {z}")
        # The scanner's coordinates, through the file that other programs read.
        motion = page.parent / "xfm" / "from-pre_to-MNI.txt"
        if motion.exists() and len(places) >= 6:
            rows = [list(map(float, line.split())) for line in motion.read_text().splitlines()[:3]]
            there = [sum(m * p for m, p in zip(row, places[3:6])) + row[3] for row in rows]
            require(all(abs(a - b) < 0.2 for a, b in zip(there, places[:3])), f"{there} instead of {places[:3]}")
        browser.evaluate("document.querySelector('canvas[data-plane=axial]').focus()")
        browser.key("PageUp", 33)
        browser.listen(0.3)
        require(abs(numbers(browser.evaluate(said))[2] - z - 1) < 0.11, "Page Up moves by 1 mm across the slice")
        browser.key("ArrowLeft", 37)
        browser.listen(0.3)
        require(abs(numbers(browser.evaluate(said))[0] - places[0] - 1) < 0.11, "left on an axial slice is the patient's right")
        return browser.evaluate(said)


@check
def a_click_on_the_surface_finds_the_side_that_is_seen(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "#gl"):
            return "no 3-D view on this page"
        view_ready(browser)
        browser.evaluate("document.querySelector('[data-surface]').click()")
        middle = browser.evaluate(
            "(() => { const p = window.hgmView.positions; const r = [0, 1, 2].map((a) => { let l = 1e9, h = -1e9;"
            " for (let n = a; n < p.length; n += 3) { l = Math.min(l, p[n]); h = Math.max(h, p[n]); } return (l + h) / 2; }); return r; })()")
        where = "#cursor" if has(browser, "#cursor") else "#picked"
        found = []
        for side, axis, sign in [("left", 0, -1), ("right", 0, 1), ("anterior", 1, 1), ("superior", 2, 1)]:
            browser.evaluate(f"[...document.querySelectorAll('[data-azimuth]')].find((b) => b.textContent === '{side}').click()")
            browser.listen(0.3)
            press(browser, "#gl", (0.5, 0.5))
            place = numbers(browser.evaluate(f"document.querySelector('{where}').textContent"))
            require(len(place) >= 3, f"nothing found from the {side}")
            require(sign * (place[axis] - middle[axis]) > 0, f"from the {side}: {place}")
            found.append(f"{side} {place[:3]}")
        before = inked(browser)[2]
        browser.evaluate("(() => { const c = document.getElementById('cut'); c.value = '+2'; c.dispatchEvent(new Event('input')); })()")
        browser.listen(0.4)
        require(inked(browser)[2] != before, "nothing is cut away")
        return "; ".join(found)


@check
def colour_bars_span_the_data(page, _):
    html = page.read_text(encoding="utf-8")
    bar = re.search(r'id="view-bar" data-low="([^"]+)" data-high="([^"]+)"', html)
    data = re.search(r'<script type="application/json" id="view-data">(.*?)</script>', html)
    if not bar or not data:
        return "no coloured view on this page"
    low, high = map(float, bar.groups())
    ranges = [s["range"] for s in json.loads(data.group(1))["surfaces"] if s["range"]]
    require(ranges, "no surface carries values")
    shown = re.findall(r'aria-label="Colour bar: error per node[^"]* from ([^ ]+) \(dark\) to ([^ ]+) \(bright\)( and above)?"', html)
    require(shown, "no colour bar names the error")
    # From nothing to the 95th percentile; what lies above takes the brightest colour, and the bar says so.
    require(low == 0 and min(r[0] for r in ranges) >= 0, f"{ranges} outside {low}..{high}")
    require(max(r[1] for r in ranges) <= high or all(end[2] for end in shown), f"{ranges} above {high}, and no bar says so")
    for ends in (end[:2] for end in shown):
        values = [float(t.replace("\u2212", "-").replace("\u2009", "")) for t in ends]
        require(all(abs(a - b) <= 0.006 * max(abs(b), 0.01) for a, b in zip(values, (low, high))), f"{values}, {low}..{high}")
    return f"{low:.4g} to {high:.4g} mm on {len(shown)} bars"


@check
def everything_but_the_view_works_without_javascript(page, _):
    with Browser(javascript=False) as browser:
        browser.open(page.as_uri())
        browser.listen(0.5)
        require(len({p for row in pixels(browser.picture()) for p in row}) > 20, "the page is blank")
        root = browser.call("DOM.getDocument")["root"]["nodeId"]

        def node(selector):
            return browser.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]

        require(not node("#view") or node("#stage-message"), "no word about the 3-D view")
        if not node("#f-fixed"):
            return "readable"
        # The switch works by CSS alone: the tiles differ between before and after.
        shots = []
        for choice in ["#f-fixed", "#f-moving"]:
            browser.call("DOM.scrollIntoViewIfNeeded", nodeId=node(choice))
            browser.listen(0.8)
            quad = browser.call("DOM.getContentQuads", nodeId=node(choice))["quads"][0]
            x, y = (quad[0] + quad[4]) / 2, (quad[1] + quad[5]) / 2
            for kind in ["mousePressed", "mouseReleased"]:
                browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
            browser.listen(0.4)
            shots.append(pixels(browser.picture()))
        differ = sum(p != q for a, b in zip(*shots) for p, q in zip(a, b))
        require(differ > 2000, f"the switch before/after changes {differ} pixels")
        return f"readable; the switch changes {differ} pixels"


ACCESSIBILITY = r"""
(() => {
  const faults = [];
  const luminance = (c) => {
    const [r, g, b] = c.map((v) => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const parse = (text) => { const n = text.match(/[\d.]+/g).map(Number); return n.length > 3 ? n : [...n, 1]; };
  const ground = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const c = parse(getComputedStyle(e).backgroundColor);
      if (c[3] === 1) return c.slice(0, 3);
    }
    return [255, 255, 255];
  };
  let texts = 0, worst = 99;
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || ["SCRIPT", "STYLE"].includes(e.tagName) || e.tagName === "title" || !e.getClientRects().length) continue;
    const svg = e.closest("svg");
    const style = getComputedStyle(e);
    let behind = ground(e);
    if (svg && e.previousElementSibling && e.previousElementSibling.tagName === "rect" && (e.getAttribute("fill") || "").startsWith("#")) {
      behind = parse(getComputedStyle(e.previousElementSibling).fill).slice(0, 3); // The cell of a heat map.
    }
    const [a, b] = [luminance(parse(svg ? style.fill : style.color).slice(0, 3)), luminance(behind)];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    texts += 1;
    worst = Math.min(worst, ratio);
    if (ratio < 4.5) faults.push(`contrast ${ratio.toFixed(2)}: ${e.tagName} "${e.textContent.trim().slice(0, 40)}"`);
  }
  for (const img of document.querySelectorAll("img")) if (!img.alt) faults.push("img without alt");
  for (const svg of document.querySelectorAll("svg")) {
    if (svg.getAttribute("aria-hidden") !== "true" && !svg.getAttribute("aria-label")) faults.push("svg without a name");
  }
  for (const input of document.querySelectorAll("input, textarea")) {
    if (!input.labels.length) faults.push(`no label: ${input.id}`);
  }
  for (const e of document.querySelectorAll("[aria-labelledby]")) {
    if (!document.getElementById(e.getAttribute("aria-labelledby"))) faults.push("label that is not there");
  }
  const levels = [...document.querySelectorAll("h1, h2, h3, h4")].map((h) => Number(h.tagName[1]));
  levels.forEach((l, n) => { if (n && l > levels[n - 1] + 1) faults.push(`heading ${l} after ${levels[n - 1]}`); });
  if (levels.filter((l) => l === 1).length !== 1) faults.push("not one h1");
  if (document.documentElement.lang !== "en") faults.push("no language");
  if (document.documentElement.scrollWidth > innerWidth + 1) faults.push(`wider than the window: ${document.documentElement.scrollWidth}`);
  const ids = [...document.querySelectorAll("[id]")].map((e) => e.id);
  if (new Set(ids).size !== ids.length) faults.push("an id twice");
  return { faults, texts, worst };
})()
"""


@check
def can_be_read_in_light_dark_and_narrow(page, _):
    said = []
    for options in [{}, {"dark": True}, {"width": 390}]:
        with Browser(**options) as browser:
            browser.open(page.as_uri())
            browser.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
            result = browser.evaluate(ACCESSIBILITY)
            require(not result["faults"], f"{options}: {result['faults'][:8]}")
            said.append(f"{result['worst']:.1f}")
    return f"{result['texts']} texts, smallest contrast {' / '.join(said)} (light / dark / narrow)"


NUMBERS = r"""
(() => {
  const found = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    // Settings and works by other people are shown as they are, and a case is called as its folder is.
    if (node.parentElement.closest("script, style, pre, .references, h1")) continue;
    for (const [number] of node.data.replace(/[\u2009,](?=\d)/g, "").matchAll(/\d+(?:\.\d+)?/g)) {
      const digits = number.includes(".") ? number.replace(/^[0.]+/, "").replace(".", "") : number.replace(/^0+|0+$/g, "");
      if (digits.length > 5) found.push(`${number} in "${node.data.trim().slice(0, 60)}"`);
    }
  }
  return found;
})()
"""


@check
def no_text_has_more_than_five_significant_digits(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        found = browser.evaluate(NUMBERS)
        require(not found, f"{found[:6]}")
        browser.evaluate("document.body.append('1.234567')")
        require(browser.evaluate(NUMBERS), "the check is asleep")


@check
def the_first_screen_is_the_verdict(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "#verdict"):
            return "no verdict on this page"
        subject = browser.evaluate("document.querySelector('h1').textContent.split(' · ')[0]")
        require(subject and browser.evaluate("document.title").startswith(subject), "title and heading name the subject")
        bottoms = browser.evaluate(
            "['#verdict', '#glance .tiles', '#glance .figures'].map((s) => document.querySelector(s))"
            ".filter((e) => e).map((e) => e.getBoundingClientRect().bottom)")
        require(bottoms and max(bottoms) <= 900, f"the first screen ends at {max(bottoms):.0f} px of 900")
        numbers = browser.evaluate("document.querySelectorAll('#glance dt').length")
        require(numbers <= 4, f"{numbers} numbers")
        return f"{subject}: ends at {max(bottoms):.0f} px, {numbers} numbers"


@check
def every_picture_tells_its_sides(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        silent = browser.evaluate(
            "[...document.querySelectorAll('.pictures figure')].filter((f) => f.querySelectorAll('.side').length !== 2"
            " && !f.closest('#seen')).length + [...document.querySelectorAll('.tile svg')]"
            ".filter((s) => s.querySelectorAll('text').length !== 2).length")
        require(silent == 0, f"{silent} pictures without letters")
        return f"{browser.evaluate('document.querySelectorAll(`.pictures figure, .tile svg`).length')} pictures"


@check
def prints_on_at_most_eight_pages(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if has(browser, "table.sortable"):
            return "as long as its cohort"
        data = browser.call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69, preferCSSPageSize=True)["data"]
        pages = len(re.findall(rb"/Type\s*/Page\b(?!s)", base64.b64decode(data)))
        require(0 < pages <= PAGES, f"{pages} pages")
        return f"{pages} pages"


@check
def no_heading_hides_behind_the_bar_on_a_narrow_screen(page, _):
    with Browser(width=400, height=800) as browser:
        browser.open(page.as_uri())
        browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        hidden = browser.evaluate("""
          [...document.querySelectorAll("nav a")].filter((link) => {
            link.click();
            const bar = document.querySelector("nav").getBoundingClientRect().bottom;
            const heading = document.querySelector(link.hash + " h2").getBoundingClientRect();
            return heading.top < bar - 1;
          }).map((link) => link.textContent)""")
        require(not hidden, f"hidden: {hidden}")


def axe_core(options):
    """The script of axe-core (MPL-2.0), from the Python package that carries it; the package itself is not run."""
    if options.axe:
        return options.axe.read_text(encoding="utf-8")
    found = importlib.util.find_spec("axe_playwright_python")
    require(found, "axe-core is missing: pip install -r pipelines/requirements-test.txt, or give --axe axe.min.js")
    return (pathlib.Path(found.origin).parent / "axe.min.js").read_text(encoding="utf-8")


AXE = """
axe.run(document, {resultTypes: ['violations']}).then((r) => r.violations.map((v) =>
  ({id: v.id, impact: v.impact, nodes: v.nodes.length, first: v.nodes[0].html.slice(0, 160)})))
"""


def grave(faults):
    return [fault for fault in faults if fault["impact"] in ("serious", "critical")]


@check
def axe_finds_no_serious_fault_in_light_or_dark(page, options):
    script, said = axe_core(options), []
    for dark in (False, True):
        with Browser(dark=dark) as browser:
            browser.open(page.as_uri())
            browser.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
            browser.evaluate(script + "; 0")
            found = browser.evaluate(AXE)
            require(not grave(found), f"{'dark' if dark else 'light'}: {grave(found)[:4]}")
            said.append(f"{len(found)} lesser")
            browser.evaluate("document.querySelector('main').append(document.createElement('img'))")
            require(grave(browser.evaluate(AXE)), "the check is asleep")
    return f"axe-core {re.search(r'axe v([0-9.]+)', script).group(1)}: 0 serious (light {said[0]}, dark {said[1]})"


@check
def subjects_are_sorted_and_filtered(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "table.sortable"):
            return "no table of subjects on this page"
        column = "[...document.querySelectorAll('#subjects tbody tr')].filter((r) => !r.hidden).map((r) => r.dataset.subject)"
        everyone = browser.evaluate(column)
        browser.evaluate("document.querySelector('#subjects thead button').click()")
        require(browser.evaluate(column) == sorted(everyone), "sorted by subject")
        browser.evaluate("document.querySelector('#subjects thead button').click()")
        require(browser.evaluate(column) == sorted(everyone, reverse=True), "and the other way")
        browser.evaluate(
            f"(() => {{ const i = document.getElementById('filter-text'); i.value = {json.dumps(everyone[0])};"
            " i.dispatchEvent(new Event('input')); })()")
        require(browser.evaluate(column) == [everyone[0]], "filtered by name")
        said = browser.evaluate("document.getElementById('filter-said').textContent")
        require(said == f"1 of {len(everyone)} subjects", said)
        strips = browser.evaluate("document.querySelectorAll('.strips svg').length")
        require(strips > 0, "no distribution of any figure")
        drawn = "[...document.querySelectorAll('.strips .subject')].filter((p) => p.getClientRects().length).map((p) => p.dataset.of)"

        def search(words):
            browser.evaluate(
                f"(() => {{ const i = document.getElementById('filter-text'); i.value = {json.dumps(words)};"
                " i.dispatchEvent(new Event('input')); })()")
            return set(browser.evaluate(drawn))

        # Who did not end well has no figures.
        pictured = search("")
        require(len(pictured) > 1 and pictured <= set(everyone), "subjects of the distributions")
        one = min(pictured)
        require(search(one) == {one}, "the filter holds for the distributions")
        require(search("") == pictured, "and lets everyone back")
        marked = "[...document.querySelectorAll('.pointed')].map((p) => p.dataset.of || p.dataset.subject)"
        pointed = browser.evaluate(
            f"(() => {{ const p = document.querySelector('.strips .subject'); p.dispatchEvent(new Event('mouseenter'));"
            f" const all = {marked}; p.dispatchEvent(new Event('mouseleave')); return [p.dataset.of, all, {marked}]; }})()")
        require(set(pointed[1]) == {pointed[0]} and len(pointed[1]) > strips, "a subject is found in every figure and table")
        require(pointed[2] == [], "and let go again")
        return f"{len(everyone)} subjects, {strips} distributions"


@check
def every_control_is_reached_by_tab(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if has(browser, "#gl"):
            view_ready(browser)
        browser.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
        # A group of radio buttons is one stop.
        names = browser.evaluate(
            "[...document.querySelectorAll('button, summary, textarea, input, canvas, nav a')]"
            ".filter((e) => e.getClientRects().length)"
            ".map((e, n) => { e.dataset.n = n; return e.type === 'radio' ? e.name : '#' + n; })")
        reached = set()
        for _ in range(len(names) + 80):
            browser.key("Tab", 9)
            reached.add(browser.evaluate(
                "(() => { const e = document.activeElement; return e.type === 'radio' ? e.name : '#' + e.dataset.n; })()"))
        missing = set(names) - reached
        require(not missing, f"not reached: {sorted(missing)}")
        return f"{len(set(names))} controls"


@check
def still_pictures_for_who_asks_for_less_motion(page, _):
    with Browser(reduced_motion=True) as browser:
        browser.open(page.as_uri())
        running = browser.evaluate("document.getAnimations().length")
        require(running == 0, f"{running} animations run")
    with Browser() as browser:
        browser.open(page.as_uri())
        browser.listen(0.3)
        running = browser.evaluate("document.getAnimations().length")
        require(running > 0 or not has(browser, "#f-after"), "the pictures do not alternate")
        return f"{running} alternating tiles, none with reduced motion"


@check
def a_rating_is_saved_as_json(page, _):
    with Browser() as browser:
        browser.open(page.as_uri())
        if not has(browser, "#rating-form"):
            return "no rating on this page"
        saved = browser.evaluate("""
          new Promise((done) => {
            const make = URL.createObjectURL;
            URL.createObjectURL = (blob) => { blob.text().then(done); return make(blob); };
            HTMLAnchorElement.prototype.click = () => {};
            document.getElementById("r-mesh-good").checked = true;
            document.getElementById("r-cavity-bad").checked = true;
            document.getElementById("rating-note").value = "the \\"edge\\"";
            document.getElementById("rating-form").requestSubmit();
          })""")
        record = json.loads(saved)
        require(record["ratings"] == {"mesh": "good", "cavity": "bad"} and record["note"] == 'the "edge"', saved)
        said = browser.evaluate("document.getElementById('rating-said').textContent")
        require("2 of 6" in said, said)


def take_pictures(page, folder, dark, width):
    folder.mkdir(parents=True, exist_ok=True)
    with Browser(dark=dark, width=width) as browser:
        browser.open(page.as_uri())
        if has(browser, "#gl"):
            view_ready(browser)
        browser.evaluate("document.querySelector('nav').style.position = 'static'")
        if has(browser, "canvas.slice"):
            browser.wait_for("document.querySelector('canvas.slice').dataset.ready === 'yes'", 60)
        for name in browser.evaluate("[...document.querySelectorAll('#glance, #warnings, main > section')].map((e) => e.id)"):
            browser.picture(folder / f"{name}.png", rectangle(browser, f"#{name}"))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="+", type=pathlib.Path, metavar="REPORT.html")
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for a picture of every section")
    parser.add_argument("--slack", type=float, default=1.0, help="factor on the time bars for a loaded machine")
    parser.add_argument("--axe", type=pathlib.Path, help="another axe.min.js (npm package axe-core, MPL-2.0) than the installed one")
    parser.add_argument("--only", help="run the checks whose name contains this")
    options = parser.parse_args()
    failed = 0
    for number, page in enumerate(p.resolve() for p in options.pages):
        print(f"page {number + 1}: {page.parent.name}/{page.name}", flush=True)
        for function in CHECKS:
            if options.only and options.only not in function.__name__:
                continue
            try:
                said = function(page, options)
                print(f"  ok     {function.__name__}" + (f": {said}" if said else ""), flush=True)
            except (AssertionError, RuntimeError, TimeoutError, OSError) as error:
                failed += 1
                print(f"  FAILED {function.__name__}: {error}", flush=True)
        if options.pictures:
            for look, dark, width in [("light", False, 1400), ("dark", True, 1400), ("medium", False, 900), ("narrow", False, 400)]:
                take_pictures(page, options.pictures / f"page-{number + 1}-{page.parent.name}" / look, dark, width)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
