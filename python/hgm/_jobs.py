"""Jobs: files in, a case or an answer out."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _hgm
from ._case import Case
from ._command import Progress, Settings, call, options
from ._errors import InputRefused, QualityRefused
from ._files import Files, files

Folder = Union[str, "os.PathLike[str]"]


def _job(files: Files, words: list[str], output: Folder, progress: Optional[Progress]) -> Case:
    """A command that fills a case."""
    folder = files.path("output", output)
    try:
        call([*words, f"--output={folder}"], progress)
    except QualityRefused as refused:
        if refused.result is not None:
            refused.found = Case(output)
        raise
    return Case(output)


def _given(files: Files, **paths: Any) -> dict[str, Any]:
    return {name: None if value is None else files.path(name, value) for name, value in paths.items()}


def _six(resection: Any) -> list[float]:
    """An ellipsoid's numbers; a list of files and a mask's voxels are none."""
    try:
        six = np.asarray(resection, dtype=np.float64)
    except (TypeError, ValueError):
        six = np.empty(0)
    if six.shape != (6,):
        raise InputRefused(
            "resection: neither an ellipsoid nor a file: give six numbers (x, y, z, rx, ry, rz), or one path or image of "
            "nibabel's"
        )
    return [float(x) for x in six]


def run(
    pre: Any,
    post: Any,
    output: Folder = "case",
    *,
    settings: Settings = None,
    estimate: bool = False,
    tissues: Optional[int] = None,
    head: Optional[str] = None,
    dseg: Any = None,
    labels: Optional[str] = None,
    pose: Any = None,
    pose_start: Any = None,
    brain_mask: Any = None,
    ventricle_mask: Any = None,
    cavity_mask: Any = None,
    resected_mask: Any = None,
    prediction: Any = None,
    force: bool = False,
    progress: Optional[Progress] = None,
) -> Case:
    """A pre- and a post-operative T1 through the whole job: the same files as ``hgm run PRE POST -o OUTPUT``, to the byte.

    Resumes: what is there and unchanged is not made again. Ctrl-C ends it between two files.

    Parameters
    ----------
    pre, post : path or nibabel image
        The two scans.
    output : path
        The case folder.
    settings : dict or path, optional
        As in a settings file: ``{"mesh": {"size": {"cells": 30000}}}``.
    estimate : bool
        The moduli with their intervals instead of the prior's samples.
    tissues : int, optional
        1: the whole brain one material; 2: grey and white matter apart.
    head : str, optional
        How the patient lay for the second scan: ``supine``, ``prone``, ``left``, ``right``, ``sitting``, or the way down as
        ``x,y,z`` of that scanner; upright otherwise.
    dseg : path or nibabel image, optional
        Another tool's labels of the pre-operative scan (FreeSurfer, SynthSeg ...); `labels` says whose numbers they are.
    pose : path, optional
        A rigid transform to the MNI frame.
    pose_start : path, optional
        The same, roughly: the pose is looked for from there.
    brain_mask, ventricle_mask, cavity_mask, resected_mask : path or nibabel image, optional
        Masks of your own: they win over the computed ones.
    prediction : path, optional
        A folder of :func:`predict` of the same scan: its work is taken up, and it is held against the case at the end.
    force : bool
        Makes again what is there.
    progress : callable, optional
        Hears ``(part, done, total, doing)``; ``hgm.bars()`` draws bars of tqdm's. Stages and warnings go to the logger ``hgm``.

    Returns
    -------
    Case

    Raises
    ------
    InputRefused
        A file or setting that cannot be used.
    QualityRefused
        Computed and not to be believed; its ``found`` is what was computed. Also where the scans show no operation, or two people.
    KeyboardInterrupt
        After Ctrl-C, once the file at hand is whole; a second one does not wait.
    """
    with files() as temporary:
        own = _given(
            temporary,
            dseg=dseg,
            pose=pose,
            pose_start=pose_start,
            brain_mask=brain_mask,
            ventricle_mask=ventricle_mask,
            cavity_mask=cavity_mask,
            resected_mask=resected_mask,
            prediction=prediction,
        )
        words = ["run", temporary.path("pre", pre), temporary.path("post", post)]
        words += options(
            temporary, settings, estimate=estimate, tissues=tissues, head=head, labels=labels, force=force, **own
        )
        return _job(temporary, words, output, progress)


def predict(
    pre: Any,
    resection: Any,
    output: Folder = "case",
    *,
    heads: Any = (),
    targets: Any = None,
    drained: Optional[float] = None,
    fluid_below: Optional[float] = None,
    poisson_log_sd: Optional[float] = None,
    threshold_mm: Optional[float] = None,
    draws: Optional[int] = None,
    checks: Optional[int] = None,
    tissues: Optional[int] = None,
    settings: Settings = None,
    dseg: Any = None,
    labels: Optional[str] = None,
    pose: Any = None,
    pose_start: Any = None,
    brain_mask: Any = None,
    ventricle_mask: Any = None,
    force: bool = False,
    progress: Optional[Progress] = None,
) -> Case:
    """Before the operation, from one scan and a plan: the expected brain shift with its spread (``case.prediction``).

    Parameters
    ----------
    pre : path or nibabel image
        The scan.
    resection : path, nibabel image, or six numbers
        A mask of what is to be taken, or an ellipsoid ``(x, y, z, rx, ry, rz)`` in mm of the scanner's frame (RAS+).
    output : path
        The case folder.
    heads : sequence of str
        How the head lies: ``supine``, ``prone``, ``left``, ``right``, ``sitting``, or the way down as ``x,y,z``.
    targets : path, optional
        Points whose place is asked for (.csv, .fcsv, .mrk.json).
    drained : float, optional
        Part of the fluid that will have drained, above 0 to 1.
    fluid_below : float, optional
        How far below the brain's highest point the fluid will stand, mm along gravity of the way the head lies.
    poisson_log_sd : float, optional
        Draws Poisson's ratio as well: standard deviation of ln(lambda / mu).
    threshold_mm : float, optional
        What counts as a shift.
    draws, checks : int, optional
        Draws from the priors, and those that are solved whole.
    tissues, settings, dseg, labels, pose, pose_start, brain_mask, ventricle_mask, force, progress
        As for :func:`run`.

    Returns
    -------
    Case
    """
    with files() as temporary:
        own = _given(
            temporary, targets=targets, dseg=dseg, pose=pose, pose_start=pose_start, brain_mask=brain_mask,
            ventricle_mask=ventricle_mask
        )
        words = ["predict", temporary.path("pre", pre)]
        if isinstance(resection, (list, tuple, np.ndarray)):
            words.append("--resection-ellipsoid=" + ",".join(str(x) for x in _six(resection)))
        else:
            words.append("--resection=" + temporary.path("resection", resection))
        heads = [heads] if isinstance(heads, str) else list(heads)
        words += options(
            temporary,
            settings,
            head=heads,
            drained=drained,
            fluid_below=fluid_below,
            poisson_log_sd=poisson_log_sd,
            threshold_mm=threshold_mm,
            draws=draws,
            checks=checks,
            tissues=tissues,
            labels=labels,
            force=force,
            **own,
        )
        return _job(temporary, words, output, progress)


@dataclass
class Registration:
    """A rigid motion.

    Attributes
    ----------
    matrix : (4, 4) float64
        Maps a point (mm, RAS+) of the moving image to the fixed one.
    quality : dict
        How well the images fit.
    warnings : list of str
    """

    matrix: NDArray[np.float64]
    quality: dict[str, Any]
    warnings: list[str]


def register(
    moving: Any,
    fixed: Any,
    *,
    moving_mask: Any = None,
    fixed_mask: Any = None,
    settings: Settings = None,
    progress: Optional[Progress] = None,
) -> Registration:
    """The rigid motion that takes the moving image onto the fixed one.

    Parameters
    ----------
    moving, fixed : path or nibabel image
        T1 images; ``fixed="MNI"`` is the built-in template.
    moving_mask, fixed_mask : path or nibabel image, optional
        Compare only inside.
    settings : dict or path, optional
        As in a settings file (table ``register``).

    Raises
    ------
    QualityRefused
        The images do not fit; its ``found`` is what was found.
    """
    with files() as temporary:
        output = temporary.folder / "found.txt"
        own = _given(temporary, moving_mask=moving_mask, fixed_mask=fixed_mask)
        words = ["register", temporary.path("moving", moving), temporary.path("fixed", fixed), f"--output={output}"]

        def found(result: dict[str, Any]) -> Registration:
            return Registration(np.loadtxt(output), result["quality"], result["warnings"])

        try:
            return found(call(words + options(temporary, settings, **own), progress))
        except QualityRefused as refused:
            if refused.result is not None:
                refused.found = found(refused.result)
            raise


@dataclass
class Segmentation:
    """Tissue labels of a scan.

    Attributes
    ----------
    labels : (i, j, k) uint8
        0 outside, 1 CSF, 2 grey matter, 3 white matter, 4 ventricle.
    affine : (4, 4) float64
        Voxel indices to mm, RAS+.
    volumes : dict
        Volumes in cc.
    warnings : list of str
    """

    labels: NDArray[np.uint8]
    affine: NDArray[np.float64]
    volumes: dict[str, Any]
    warnings: list[str]

    def to_nibabel(self) -> Any:
        """The labels as nibabel's image (``pip install nibabel``)."""
        import nibabel

        return nibabel.Nifti1Image(self.labels, self.affine)  # type: ignore[no-untyped-call]


def segment(
    t1: Any,
    *,
    brain_mask: Any = None,
    mni: bool = False,
    settings: Settings = None,
    progress: Optional[Progress] = None,
) -> Segmentation:
    """A T1 to tissue labels in its own grid.

    Parameters
    ----------
    t1 : path or nibabel image
    brain_mask : path or nibabel image, optional
        A mask of your own in the scan's grid.
    mni : bool
        On the 1 mm MNI grid instead: what :func:`hgm.mesh` needs for boundary sets.
    settings : dict or path, optional
        As in a settings file (tables ``segment``, ``deformable``).

    Raises
    ------
    QualityRefused
        The labels are not to be believed; its ``found`` is what was found.
    """
    with files() as temporary:
        output = temporary.folder / "labels.nii.gz"
        own = _given(temporary, brain_mask=brain_mask)
        words = ["segment", temporary.path("t1", t1), f"--output={output}"]

        def found(told: dict[str, Any]) -> Segmentation:
            labels, affine = _hgm.read_label_map(str(output))
            return Segmentation(labels, np.asarray(affine), told["volumes"], told["warnings"])

        try:
            return found(call(words + options(temporary, settings, mni=mni, **own), progress))
        except QualityRefused as refused:
            # The file goes with its folder: the labels are kept here.
            if refused.result is not None:
                refused.found = found(refused.result)
            raise
