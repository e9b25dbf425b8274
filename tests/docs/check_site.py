"""Every link of the built site, and that nothing in it asks anything of another place: check_site.py FOLDER

A link within the site has to lead to a file, and its fragment to a place in that file. Addresses elsewhere may stand in a link that a
reader clicks, never in what a browser loads by itself. Ends with 1 and a line for each fault.
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# What a browser fetches without being asked, by the attribute that names it.
LOADED = {"src", "srcset", "poster", "data"}
STYLE_ADDRESS = re.compile(r"""(?:url\(\s*|@import\s+)["']?([^"')\s;]+)""")


class Page(HTMLParser):
    """Places and links of one page."""

    def __init__(self, text):
        super().__init__()
        self.places, self.links, self.loaded, self.equations, self.raw = set(), [], [], 0, []
        self.code = 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.code += tag in ("pre", "code", "script", "style")
        self.equations += tag == "math"
        for name, value in attributes:
            if name in ("id", "name") and value:
                self.places.add(value)
            elif name == "href" and value:
                (self.links if tag == "a" else self.loaded).append(value)
            elif name in LOADED and value:
                self.loaded.append(value)

    def handle_endtag(self, tag):
        self.code -= tag in ("pre", "code", "script", "style")

    def handle_data(self, text):
        # An equation that was not converted, or whose place was lost.
        left = r"\\(frac|mathbf|sum)\b" if self.code else r"\$`|`\$|EQUATION\d+END|\*\*|^#+ "
        if re.search(left, text):
            self.raw.append(text.strip()[:60])


def outside(address):
    parts = urlsplit(address)
    return bool(parts.netloc) or parts.scheme in ("http", "https", "ftp", "ws", "wss")


def faults(folder):
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.html"))}
    if not pages:
        yield f"{folder} has no pages"
    for path, page in pages.items():
        named = path.relative_to(folder)
        for address in page.loaded:
            if outside(address):
                yield f"{named}: the browser would load {address}"
        for text in page.raw:
            yield f"{named}: markup left in the text: {text}"
        for address in page.links + page.loaded:
            parts = urlsplit(address)
            if outside(address) or parts.scheme in ("data", "mailto", "javascript"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target /= "index.html"
            if not target.is_file():
                yield f"{named}: {address} leads nowhere"
            elif parts.fragment and target in pages and parts.fragment != "__skip":
                if unquote(parts.fragment) not in pages[target].places:
                    yield f"{named}: {address} leads to no place in {target.name}"
    for style in sorted(folder.rglob("*.css")):
        for address in STYLE_ADDRESS.findall(style.read_text(encoding="utf-8")):
            if outside(address):
                yield f"{style.relative_to(folder)}: the browser would load {address}"
    theory = pages.get(folder / "theory.html")
    if theory and theory.equations < 40:
        yield f"theory.html: {theory.equations} equations, where there should be many"


def main():
    found = list(faults(Path(sys.argv[1]).resolve()))
    print("\n".join(found) or "every link of the site leads somewhere, and nothing is loaded from elsewhere")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
