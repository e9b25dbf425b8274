"""What the site needs besides Markdown: equations as MathML, notebooks as pages. Both happen while the site is built; the
reader's browser loads no script and no font for them.

An equation stands between $` and `$, or in a block fenced as `math`: a forge shows both the same way.
"""

import json
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.structure.files import File

FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"\$`([^`]+)`\$")


def on_page_markdown(markdown, page, config, files):
    """Takes the equations out before Markdown sees them; `on_page_content` puts them back as MathML."""
    page.meta["equations"] = equations = []

    def kept(latex, display):
        equations.append(convert(latex.strip(), display=display))
        return f"EQUATION{len(equations) - 1}END"

    def outside_code(text):
        return INLINE.sub(lambda found: kept(found[1], "inline"), text)

    parts, at = [], 0
    for fence in FENCE.finditer(markdown):
        parts.append(outside_code(markdown[at : fence.start()]))
        parts.append(kept(fence[2], "block") if fence[1] == "math" else fence[0])
        at = fence.end()
    return "".join([*parts, outside_code(markdown[at:])])


def on_page_content(html, page, config, files):
    def mathml(found):
        return page.meta["equations"][int(found[1])]

    return re.sub(r"EQUATION(\d+)END", mathml, html)


def on_files(files, config):
    """Every notebook of docs/notebooks becomes a page of the same name."""
    for notebook in sorted(Path(config["docs_dir"], "notebooks").glob("*.ipynb")):
        name = f"notebooks/{notebook.stem}.md"
        files.append(File.generated(config, name, content=page_of(notebook)))
    return files


def page_of(notebook):
    """A notebook as Markdown: its text, its code, and what the code printed and drew."""
    text = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            text.append(source)
            continue
        text.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            if output["output_type"] == "stream":
                text.append("```text\n" + "".join(output["text"]).rstrip() + "\n```")
            elif png := output.get("data", {}).get("image/png"):
                alt = output["metadata"].get("alt", "figure")
                text.append(f'<img alt="{alt}" src="data:image/png;base64,{"".join(png).strip()}">')
    text.append(f"*The notebook itself: `docs/notebooks/{notebook.name}`; the tests run it and compare what it prints.*")
    return "\n\n".join(text) + "\n"


def on_post_build(config):
    """The page for addresses that lead nowhere knows a server's root; the site is read from disk as well."""
    Path(config["site_dir"], "404.html").unlink(missing_ok=True)
