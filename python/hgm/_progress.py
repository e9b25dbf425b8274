"""Progress as bars."""

from __future__ import annotations

import importlib
from typing import Any


def bars(tqdm: Any = None) -> Any:
    """A function for ``progress=`` that draws a bar of tqdm's for each part of a job.

    Parameters
    ----------
    tqdm : class, optional
        ``tqdm.tqdm``, ``tqdm.notebook.tqdm`` or alike; ``tqdm.auto.tqdm`` where none is given (``pip install tqdm``).

    Examples
    --------
    >>> case = hgm.run("pre.nii.gz", "post.nii.gz", "case", progress=hgm.bars())  # doctest: +SKIP
    """
    kind = importlib.import_module("tqdm.auto").tqdm if tqdm is None else tqdm

    state: dict[str, Any] = {"part": None, "bar": None}

    def progress(part: str, done: int, total: int, doing: str) -> None:
        bar = state["bar"]
        if bar is None or state["part"] != part or done < bar.n or bar.total != total:
            if bar is not None:
                bar.close()
            bar = kind(total=total, desc=part)
            state.update(part=part, bar=bar)
        if doing:
            bar.set_postfix_str(doing, refresh=False)
        bar.update(done - bar.n)
        if done >= total:
            bar.close()
            state.update(part=None, bar=None)

    return progress
