"""A case folder."""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _hgm
from ._command import call
from ._errors import InputRefused
from ._mesh import Mesh

_NAMES: dict[str, str] = _hgm.names()


@dataclass
class Points:
    """Points carried by a case.

    Attributes
    ----------
    points : (n, 3) float64
        Where they are now, mm.
    displacement_mm : (n, 3) float64
        From where they were.
    sd_mm : (n,) float64
        Standard deviation of the brain shift (root of the trace of its covariance); NaN where it is not known.
    where : list of str
        ``tissue``, ``fluid``, ``removed`` (tissue that was taken: moved rigidly), ``outside`` (beyond the field: the same) or
        ``rigid`` (all points, with ``to="mni"``).
    state : str
        What carried them: ``estimate``, ``fused``, ``observed``, a sample, or ``rigid``.
    warnings : list of str
        Why not to trust them: the case's quality gate, where it is not passed. They go to the logger ``hgm``, too.
    """

    points: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]
    sd_mm: NDArray[np.float64]
    where: list[str]
    state: str
    warnings: list[str] = field(default_factory=list)


class Case:
    """A folder that ``hgm.run``, ``hgm.predict`` or the command has filled.

    Parameters
    ----------
    path : str or pathlib.Path
        The folder. One that no job has filled is refused.
    """

    def __init__(self, path: Union[str, os.PathLike[str]]) -> None:
        _hgm.case_check(os.fspath(path))
        #: The folder.
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"hgm.Case({str(self.path)!r})"

    @property
    def outcome(self) -> dict[str, Any]:
        """The experiment's numbers: verdict, samples, best sample, errors (mm), moduli (Pa), warnings."""
        return dict(json.loads(_hgm.case_outcome(self.path)))

    @property
    def settings(self) -> dict[str, Any]:
        """Every setting it was made with, by room."""
        return dict(json.loads(_hgm.case_settings(self.path)))

    @property
    def prediction(self) -> dict[str, Any]:
        """The numbers of a prediction."""
        return self._json("prediction")

    @property
    def evaluation(self) -> dict[str, Any]:
        """A prediction against what was seen afterwards, as ``hgm evaluate`` has compared them."""
        found = self._json("evaluation")
        made = hashlib.sha256(self._bytes("prediction")).hexdigest()
        if found.get("prediction_sha256") != made:
            raise InputRefused(f"{_NAMES['evaluation']}: of another prediction than the case holds: run `hgm evaluate` again")
        return found

    @property
    def estimate(self) -> dict[str, Any]:
        """The numbers of the estimate, of the present outcome alone.

        Read ``verdict``: it holds what is claimed, moduli (Pa) with their intervals. ``posterior.mode`` is no claim: the raw
        posterior stands there even where nothing is claimed of a tissue.
        """
        return self._json("estimate")

    @property
    def brain_shift(self) -> dict[str, Any]:
        """The brain shift in numbers, mm."""
        return self._json("brain shift")

    @property
    def page(self) -> Path:
        """The HTML page."""
        return self._file(_NAMES["page"])

    @property
    def state(self) -> str:
        """The state that is meant where none is named: the estimate, else the best sample."""
        return _hgm.case_state(self.path, None)

    @property
    def files(self) -> dict[str, dict[str, Any]]:
        """Files that are there, by their path in the folder: what each is, in which frame, who makes it."""
        there: dict[str, dict[str, Any]] = {}
        for entry in call(["layout"])["files"]:
            pattern = entry["path"]
            before, brace, after = pattern.partition("{")
            found = self.path.glob(before + "*" + after.partition("}")[2]) if brace else [self.path / pattern]
            for path in sorted(found):
                name = path.relative_to(self.path).as_posix()
                if path.is_file() and name not in there:
                    there[name] = entry
        return there

    def table(self, name: str = "samples") -> Any:
        """A table: ``samples`` (a line per sample: moduli in Pa, errors in mm).

        Returns a pandas DataFrame where pandas is installed, else a dict of lists. Empty cells are NaN.
        """
        if name not in ("samples",):
            raise InputRefused(f"table: {name!r}: say 'samples'")
        import csv

        rows = list(csv.reader(io.StringIO(self._bytes(name).decode("utf-8"), newline="")))
        columns = {head: [_cell(row[n]) for row in rows[1:]] for n, head in enumerate(rows[0])}
        try:
            import pandas
        except ImportError:
            return columns
        return pandas.DataFrame(columns)

    def image(self, name: str) -> Any:
        """An image of the case by its path in the folder, as nibabel has it (``pip install nibabel``)."""
        path = self._file(name)
        import nibabel

        return nibabel.load(path)

    def mask(self, name: str, *, of: str = "", space: str = "native") -> Any:
        """A mask as an image: ``brain`` (``of="pre"`` or ``"post"``), ``resected``, ``cavity``, ``ventricle``.

        ``space`` is ``native`` (the scan's own grid) or ``mni``. The ventricles after surgery are
        ``mask("ventricle", of="post", space="mni")``; those before surgery, which ``ventricle_mask`` of :func:`hgm.run` gives, have no
        mask of their own: they are label 4 of :meth:`labels`.
        """
        key = " ".join(word for word in ("mask", name, of or ("pre" if name == "brain" else ""), space) if word)
        if key not in _NAMES:
            known = sorted(key.removeprefix("mask ") for key in _NAMES if key.startswith("mask "))
            before = "; the ventricles before surgery are label 4 of case.labels()" if name == "ventricle" else ""
            raise InputRefused(f"mask: {key.removeprefix('mask ')!r}: say one of {', '.join(known)}{before}")
        return self.image(_NAMES[key])

    def labels(self, *, space: str = "native") -> Any:
        """Tissue labels before surgery as an image."""
        key = f"labels {space}"
        if key not in _NAMES:
            raise InputRefused(f"space: {space!r}: say native or mni")
        return self.image(_NAMES[key])

    def field(self, to: str = "deformed", *, state: Optional[str] = None) -> Any:
        """A displacement field as an image of vectors (mm, intent and sign as ITK reads them).

        ``to``: ``deformed`` (brain shift alone), ``post`` (with the rigid part), ``pre`` and ``undeformed`` (their inverses).
        ``state``: ``estimate``, ``fused``, ``observed`` or a sample whose fields are kept.
        """
        if f"field {to}" not in _NAMES:
            raise InputRefused(f"to: {to!r}: say deformed, undeformed, post or pre")
        return self.image(self._of(f"field {to}", state))

    def sd(self, *, state: Optional[str] = None) -> Any:
        """Standard deviation of the brain shift as an image, mm, in the pre-operative scan's frame."""
        return self.image(self._of("sd", state))

    def believed(self, *, state: Optional[str] = None) -> Any:
        """Where the brain shift is believed, as an image."""
        return self.image(self._of("believed", state))

    def mesh(self, state: Optional[str] = None) -> Mesh:
        """The undeformed mesh, or that of a state with its arrays: ``estimate``, ``sample-05`` ...

        ``case.mesh().to_meshio()`` is meshio's.
        """
        return Mesh.read(self._file(_NAMES["mesh"] if state is None else self._of("state", state)))

    def array(self, name: str, state: Optional[str] = None) -> NDArray[np.float64]:
        """An array on the nodes or cells of a state: ``displacement`` (n, 3) mm, ``rmse_mm`` (n,), ``jacobian`` (m,) ...

        Of the best sample where no state is named.
        """
        return _hgm.case_array(self.path, name, state)

    def warp_points(self, points: ArrayLike, to: str = "post", state: Optional[str] = None) -> Points:
        """See :func:`hgm.warp_points`."""
        return warp_points(self, points, to, state)

    def _of(self, key: str, state: Optional[str]) -> str:
        before, _, rest = _NAMES[key].partition("{")
        return before + _hgm.case_state(self.path, state) + rest.partition("}")[2]

    def _there(self, name: str) -> Path:
        path = self.path / name
        if not path.is_file():
            raise InputRefused(f"{self.path}: has no {name}: case.files tells what is there")
        return path

    def _file(self, name: str) -> Path:
        """A file to be looked at: as it was written, and of the outcome where there is one."""
        path = self._there(name)
        # Manifests know files by their path in the folder, with slashes.
        _hgm.case_check_file(self.path, PurePath(name).as_posix())
        return path

    def _bytes(self, key: str) -> bytes:
        """A file of numbers: of the present outcome alone."""
        self._there(_NAMES[key])
        return _hgm.case_file(self.path, _NAMES[key])

    def _json(self, key: str) -> dict[str, Any]:
        return dict(json.loads(self._bytes(key)))


def _cell(text: str) -> Any:
    """A cell of a table of hgm's: a number, a truth value or a word."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return float(text) if text else float("nan")
    except ValueError:
        return text


def warp_points(
    case: Union[Case, str, os.PathLike[str]], points: ArrayLike, to: str = "post", state: Optional[str] = None
) -> Points:
    """Carries points by a case.

    Parameters
    ----------
    case : Case or path
    points : (n, 3) float64
        Scanner coordinates, mm, RAS+.
    to : str
        ``post``: from the pre-operative scan to the post-operative one; ``deformed``: brain shift alone; ``pre``: from the
        post-operative scan back; ``mni``: rigidly to MNI space.
    state : str, optional
        ``estimate``, ``fused``, ``observed`` or a sample such as ``sample-05``; the estimate, else the best sample, where none is
        named.

    Returns
    -------
    Points
    """
    folder = case.path if isinstance(case, Case) else os.fspath(case)
    given = _arrays.points("points", points)
    moved, sd, where, carried_by = _hgm.case_points(folder, given, to, state)
    doubts = _hgm.case_doubts(folder)
    for doubt in doubts:
        logging.getLogger("hgm").warning("%s", doubt)
    return Points(moved, moved - given, np.asarray(sd, dtype=np.float64), where, carried_by, doubts)
