"""Runs the notebooks of the documentation: run_notebooks.py HGM FOLDER [--write] [NAME ...]

Every code cell runs in one namespace, in an empty folder that has the project's sample scans beside it and `hgm` on its PATH. What a cell
prints has to be what the notebook shows; figures have to be drawn where it shows one. `--write` puts what was printed and drawn into
the notebooks instead. No Jupyter is needed for it, and the notebooks use nothing that only Jupyter has.
"""

import base64
import contextlib
import io
import json
import os
import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import nbformat  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent.parent


def outputs(source, namespace):
    """What a cell prints and draws, as a notebook keeps it."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(source, "cell", "exec"), namespace)
    kept = []
    if printed.getvalue():
        kept.append({"output_type": "stream", "name": "stdout", "text": printed.getvalue()})
    for number in plt.get_fignums():
        picture = io.BytesIO()
        plt.figure(number).savefig(picture, format="png", dpi=80, metadata={"Software": None})
        data = {"image/png": base64.b64encode(picture.getvalue()).decode()}
        kept.append({"output_type": "display_data", "metadata": {}, "data": data})
    plt.close("all")
    return kept


def shown(kept):
    """What has to agree: all text, and that there is a picture; its pixels depend on fonts."""
    return ["".join(one["text"]) if "text" in one else "picture" for one in kept]


def faults(notebook, path, write):
    namespace = {"__name__": "__main__"}
    for number, cell in enumerate(cell for cell in notebook.cells if cell.cell_type == "code"):
        kept = outputs(cell.source, namespace)
        if write:
            cell.outputs = [nbformat.from_dict(one) for one in kept]
            cell.execution_count = number + 1
        elif shown(kept) != shown(cell.outputs):
            yield f"{path.name}, code cell {number}: printed\n{shown(kept)}\nwhere the notebook shows\n{shown(cell.outputs)}"


def main():
    program, folder, *rest = sys.argv[1:]
    write = "--write" in rest
    names = [word for word in rest if word != "--write"]
    wrong = False
    paths = [path for path in sorted(Path(folder).resolve().glob("*.ipynb")) if not names or path.stem in names]
    program = Path(program).resolve()
    for path in paths:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        with tempfile.TemporaryDirectory() as empty:
            (Path(empty) / "bin").mkdir()
            (Path(empty) / "bin" / "hgm").symlink_to(program)
            os.environ["PATH"] = f"{empty}/bin{os.pathsep}{os.environ['PATH']}"
            (Path(empty) / "work").mkdir()
            (Path(empty) / "work" / "sample-data").symlink_to(ROOT / "sample-data")
            os.chdir(Path(empty) / "work")
            found = list(faults(notebook, path, write))
            os.chdir(ROOT)
        if write:
            nbformat.write(notebook, path)
        wrong |= bool(found)
        print("\n".join(found) or f"{path.name}: as shown")
    sys.exit(wrong or not paths)


if __name__ == "__main__":
    main()
