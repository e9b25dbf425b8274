#!/usr/bin/env python3
"""Measures what is left between two registered images, without any code of hgm: OpenCV's phase correlation.

    check_registration.py CASE -o PICTURE.png [--json VERDICT.json]
    check_registration.py PRE.nii.gz POST.nii.gz -o PICTURE.png [--json VERDICT.json]

The images share a grid; CASE is a folder with anat/pre_space-MNI_T1w.nii.gz and anat/post_space-MNI_T1w.nii.gz. Slice
by slice in three orientations the shift between them is measured, in whole slices and in windows of 64 voxels. A rigid
motion is fitted to the windows' shifts with a loss that lets a cavity and a sagging cortex stand aside, and the mean of
that motion over the brain is the residual registration error. The picture shows contours of PRE over POST; of images with a face it shows the face.

Exit codes: 0 pass, 3 input rejected, 4 the error is above --limit-mm or could not be measured.
"""

import argparse
import json
import os
import sys

import cv2
import nibabel as nib
import numpy as np
from scipy import ndimage

AXES = ("sagittal", "coronal", "axial")
WINDOW, STRIDE, STEP = 64, 32, 5  # voxels
#: Windows needed before a fitted motion means anything.
ENOUGH = 40
#: Peak of the correlation below which a window shows noise, not tissue.
RESPONSE = 0.10
#: A larger motion than this is taken out and what is left measured again: phase correlation of a window that turns
#: or leaves its plane sees too little of the motion.
AGAIN_MM, ROUNDS = 0.3, 4


class Rejected(Exception):
    """An input that cannot be used; the message names file and field."""


def load(path):
    try:
        image = nib.as_closest_canonical(nib.load(path))
        volume = np.asarray(image.dataobj, np.float32)
    except Exception as error:
        raise Rejected(f"{path}: not a readable NIfTI image: {error}") from error
    volume = np.squeeze(volume)
    if volume.ndim != 3:
        raise Rejected(f"{path}: dim: {volume.ndim} dimensions, 3 are needed")
    volume = np.nan_to_num(volume)
    if volume.max() <= volume.min():
        raise Rejected(f"{path}: data: constant image")
    return volume, image.affine


def brain(volume):
    """Otsu's foreground, its largest part, filled: good enough to say where to look."""
    top = np.percentile(volume[volume > volume.min()], 99)
    grey = np.clip(255 * (volume - volume.min()) / (top - volume.min()), 0, 255).astype(np.uint8)
    level, _ = cv2.threshold(grey[grey > 0].reshape(-1, 1), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    mask = np.zeros(volume.shape, bool)
    for k in range(volume.shape[2]):
        contours, _ = cv2.findContours((grey[:, :, k] > 0.6 * level).astype(np.uint8), cv2.RETR_EXTERNAL,
                                       cv2.CHAIN_APPROX_NONE)
        if contours:
            filled = np.zeros(grey.shape[:2], np.uint8)
            cv2.drawContours(filled, [max(contours, key=cv2.contourArea)], -1, 1, cv2.FILLED)
            mask[:, :, k] = filled > 0
    return mask, grey


def shift(a, b, hanning):
    """How far b is moved against a, (rows, columns) in voxels, and the height of the correlation's peak."""
    (columns, rows), response = cv2.phaseCorrelate(a, b, hanning)
    return np.array([rows, columns]), response


def measure(pre, post, mask):
    """Shifts of whole slices, and of windows as (centre in voxels, in-plane axes, shift in voxels, response)."""
    slices, windows = {name: [] for name in AXES}, []
    small = cv2.createHanningWindow((WINDOW, WINDOW), cv2.CV_32F)
    for axis, name in enumerate(AXES):
        plane = [k for k in range(3) if k != axis]
        height, width = (pre.shape[k] for k in plane)
        whole = cv2.createHanningWindow((width, height), cv2.CV_32F)
        occupied = np.flatnonzero(mask.sum(axis=tuple(plane)) > 0.2 * mask.sum(axis=tuple(plane)).max())
        for k in occupied[:: STEP]:
            a, b, m = (np.ascontiguousarray(np.take(v, k, axis)) for v in (pre, post, mask))
            moved, response = shift(a, b, whole)
            slices[name].append([int(k), round(float(moved[0]), 3), round(float(moved[1]), 3), round(response, 3)])
            for i in range(0, height - WINDOW + 1, STRIDE):
                for j in range(0, width - WINDOW + 1, STRIDE):
                    box = np.s_[i : i + WINDOW, j : j + WINDOW]
                    if m[box].mean() < 0.5 or a[box].std() == 0 or b[box].std() == 0:
                        continue
                    moved, response = shift(np.ascontiguousarray(a[box]), np.ascontiguousarray(b[box]), small)
                    if response >= RESPONSE and np.abs(moved).max() < WINDOW / 4:
                        centre = np.zeros(3)
                        centre[axis], centre[plane] = k, (i + (WINDOW - 1) / 2, j + (WINDOW - 1) / 2)
                        windows.append((centre, plane, moved, response))
    return slices, windows


def fit_motion(windows, affine, middle):
    """Small rigid motion t + w x (x - middle) in mm by iteratively reweighted least squares with Cauchy's loss."""
    matrix = affine[:3, :3]
    centres = np.array([matrix @ w[0] + affine[:3, 3] for w in windows])
    rows, targets, weights = [], [], []
    for (_, plane, moved, response), x in zip(windows, centres - middle):
        full = np.array([[1, 0, 0, 0, x[2], -x[1]], [0, 1, 0, -x[2], 0, x[0]], [0, 0, 1, x[1], -x[0], 0]])
        for k, voxels in zip(plane, moved):
            # A window sees motion along its own two axes only.
            direction = matrix[:, k] / np.linalg.norm(matrix[:, k])
            rows.append(direction @ full)
            targets.append(voxels * np.linalg.norm(matrix[:, k]))
            weights.append(response)
    rows, targets, weights = map(np.array, (rows, targets, weights))
    motion, robust = np.zeros(6), np.ones_like(weights)
    for _ in range(50):
        w = np.sqrt(weights * robust)
        motion = np.linalg.lstsq(rows * w[:, None], targets * w, rcond=None)[0]
        residual = targets - rows @ motion
        scale = max(1.4826 * np.median(np.abs(residual)), 0.02)
        robust = 1 / (1 + (residual / (2.385 * scale)) ** 2)
    return motion, float(scale)


def moved_back(volume, motion, affine, middle):
    """The image a small rigid motion ago: value at x is that of the volume at x + t + w x (x - middle)."""
    t, (a, b, c) = motion[:3], motion[3:]
    turn = np.array([[1, -c, b], [c, 1, -a], [-b, a, 1]])
    mm = np.eye(4)
    mm[:3, :3], mm[:3, 3] = turn, t + middle - turn @ middle
    voxel = np.linalg.inv(affine) @ mm @ affine
    return ndimage.affine_transform(volume, voxel[:3, :3], voxel[:3, 3], order=1)


def mosaic(pre, post, affine, path):
    """Contours of PRE over POST in three planes; left is left."""
    rows = []
    for axis in range(3):
        row = []
        for share in (0.3, 0.4, 0.5, 0.6, 0.7):
            k = int(share * pre.shape[axis])
            a, b = (np.ascontiguousarray(np.flipud(np.take(v, k, axis).T)) for v in (pre, post))
            canvas = cv2.cvtColor(b, cv2.COLOR_GRAY2BGR)
            edges = cv2.Canny(cv2.GaussianBlur(a, (0, 0), 1.5), 30, 80)
            # Orange on grey: told apart by brightness as well.
            canvas[edges > 0] = (0, 165, 255)
            row.append(cv2.resize(canvas, (300, 300), interpolation=cv2.INTER_NEAREST))
        rows.append(np.hstack(row))
    if not cv2.imwrite(path, np.vstack(rows)):
        raise Rejected(f"{path}: cannot be written")


def check(pre_path, post_path, picture, limit_mm):
    (pre, affine), (post, other) = load(pre_path), load(post_path)
    if pre.shape != post.shape or np.abs(affine - other).max() > 1e-3:
        raise Rejected(f"{post_path}: affine: its grid is not that of {pre_path}; give the registered pair")
    mask, pre_grey = brain(pre)
    _, post_grey = brain(post)
    mask &= post_grey > 0  # outside the field of view of POST there is nothing to compare
    smooth = [np.stack([cv2.GaussianBlur(s, (0, 0), 1) for s in v.astype(np.float32)]) for v in (pre_grey, post_grey)]
    mosaic(pre_grey, post_grey, affine, picture)
    where = np.argwhere(mask)[::97] @ affine[:3, :3].T + affine[:3, 3]
    middle = where.mean(axis=0)
    verdict, motion = {"limit_mm": limit_mm}, np.zeros(6)
    for turn in range(ROUNDS):
        slices, windows = measure(smooth[0], moved_back(smooth[1], motion, affine, middle), mask)
        if turn == 0:
            medians = {name: np.median([s[1:3] for s in found], axis=0) for name, found in slices.items() if found}
            verdict["slices"] = slices
            verdict["slice_shift_median_voxels"] = {name: np.round(m, 3).tolist() for name, m in medians.items()}
            verdict["windows"] = len(windows)
        if len(windows) < ENOUGH:
            reason = f"only {len(windows)} windows could be compared, {ENOUGH} are needed"
            verdict.update(verdict="fail", reason=reason)
            return verdict
        more, scale = fit_motion(windows, affine, middle)
        motion += more
        if np.linalg.norm(more[:3] + np.cross(more[3:], where - middle), axis=1).mean() < AGAIN_MM:
            break
    size = np.linalg.norm(motion[:3] + np.cross(motion[3:], where - middle), axis=1)
    verdict.update(
        translation_mm=np.round(motion[:3], 4).tolist(),
        rotation_deg=np.round(np.degrees(motion[3:]), 4).tolist(),
        mean_error_mm=round(float(size.mean()), 4),
        max_error_mm=round(float(size.max()), 4),
        window_scatter_mm=round(scale, 4),
        verdict="pass" if size.mean() <= limit_mm else "fail",
    )
    if verdict["verdict"] == "fail":
        verdict["reason"] = f"POST is {size.mean():.2f} mm away from PRE on average, more than {limit_mm} mm"
    return verdict


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("images", nargs="+", help="CASE, or PRE and POST")
    parser.add_argument("-o", "--output", required=True, help="PNG")
    parser.add_argument("--json", dest="report", help="the verdict; standard output if not given")
    parser.add_argument("--limit-mm", type=float, default=1.0)
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)  # the same sums in the same order
    images = options.images
    if len(images) == 1:
        images = [os.path.join(images[0], "anat", f"{scan}_space-MNI_T1w.nii.gz") for scan in ("pre", "post")]
    try:
        if len(images) != 2:
            raise Rejected("give one case folder, or two images")
        verdict = check(*images, options.output, options.limit_mm)
    except Rejected as message:
        print(f"check_registration: {message}", file=sys.stderr)
        return 3
    text = json.dumps(verdict, indent=1, sort_keys=True) + "\n"
    if options.report:
        with open(options.report, "w", encoding="utf-8") as file:
            file.write(text)
    else:
        sys.stdout.write(text)
    return 0 if verdict["verdict"] == "pass" else 4


if __name__ == "__main__":
    sys.exit(main())
