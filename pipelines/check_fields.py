#!/usr/bin/env python3
"""Carries points by a case's displacement fields with other people's programs and says how far each is from hgm.

    check_fields.py CASE [--state STATE] [--hgm PROGRAM] [--points N] [--limit-mm MM]

CASE is a finished case (`hgm run`). N random points of its tissue go from the pre-operative scan to the deformed state, to the
post-operative scan and back, and by the composite of brain shift and rigid motion, with every tool that is installed:

  SimpleITK     DisplacementFieldTransform, CompositeTransform
  antspyx       apply_transforms_to_points
  dipy          deform_streamlines
  nibabel       the numbers of the file, linear between voxels (scipy)
  nitransforms  DenseFieldTransform; at the centres of voxels alone: between them it draws a cubic spline of its own, where hgm and
                ITK are linear

Exit codes: 0 all within --limit-mm, 3 input rejected, 4 a tool is further off.
"""

import argparse
import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import nibabel as nib
import numpy as np
from scipy.ndimage import map_coordinates

#: Tools with the module that each is imported by; nibabel is needed whatever is compared.
MODULES = {"SimpleITK": "SimpleITK", "antspyx": "ants", "dipy": "dipy", "nitransforms": "nitransforms"}
#: RAS to LPS and back.
LPS = np.array([-1.0, -1.0, 1.0])


def field_of(case, path, state):
    return case / f"xfm/{path}_desc-{state}_displacement.nii.gz"


def affine_points(affine, points):
    return points @ affine[:3, :3].T + affine[:3, 3]


def by_hgm(program, points, words, folder):
    table, out = folder / "points.csv", folder / "carried.csv"
    np.savetxt(table, points, delimiter=",", header="x,y,z", comments="", fmt="%.6f")
    subprocess.run([program, "warp", *words, str(table), "-o", str(out), "-q"], check=True, stdout=subprocess.DEVNULL)
    return np.genfromtxt(out, delimiter=",", skip_header=1, usecols=(0, 1, 2))


def by_nibabel(points, file):
    image = nib.load(file)
    d = np.asanyarray(image.dataobj)[:, :, :, 0].astype(float) * LPS
    v = affine_points(np.linalg.inv(image.affine), points).T
    return points + np.stack([map_coordinates(d[..., a], v, order=1) for a in range(3)], 1)


def by_itk(points, files):
    import SimpleITK as sitk

    def read(file):
        if str(file).endswith(".tfm"):
            return sitk.ReadTransform(str(file))
        return sitk.DisplacementFieldTransform(sitk.ReadImage(str(file), sitk.sitkVectorFloat64))

    # A composite applies its last transform first.
    whole = sitk.CompositeTransform([read(file) for file in reversed(files)])
    return np.array([whole.TransformPoint(tuple(p)) for p in points * LPS]) * LPS


def by_ants(points, files):
    import ants
    import pandas

    frame = pandas.DataFrame(points * LPS, columns=list("xyz"))
    frame["t"] = 0.0
    # Of points the first of the list is applied first, of images the last.
    moved = ants.apply_transforms_to_points(3, frame, [str(file) for file in files])
    return moved[["x", "y", "z"]].values * LPS


def by_dipy(points, file):
    from dipy.tracking.streamline import deform_streamlines

    image = nib.load(file)
    d = (np.asanyarray(image.dataobj)[:, :, :, 0] * LPS).astype(np.float32)
    lines = [points[n : n + 50].astype(np.float32) for n in range(0, len(points), 50)]
    unit = np.eye(4)
    moved = deform_streamlines(lines, d, np.linalg.inv(image.affine), image.affine, unit, unit)
    return np.concatenate(list(moved))


def by_nitransforms(points, files):
    from nitransforms.io.itk import ITKDisplacementsField, ITKLinearTransform
    from nitransforms.linear import Affine
    from nitransforms.nonlinear import DenseFieldTransform

    for file in files:
        if str(file).endswith(".tfm"):
            points = Affine(ITKLinearTransform.from_filename(str(file)).to_ras()).map(points)
        else:
            points = DenseFieldTransform(ITKDisplacementsField.from_image(nib.load(file))).map(points)
    return points


def is_installed(tool):
    return importlib.util.find_spec(MODULES[tool]) is not None


def rows(case, state, program, count, seed=1):
    """Name of the way, name of the tool, distances from hgm in mm."""
    shift, back = field_of(case, "from-pre_to-deformed", state), field_of(case, "from-deformed_to-pre", state)
    there, home = field_of(case, "from-pre_to-post", state), field_of(case, "from-post_to-pre", state)
    mask = nib.load(case / f"xfm/from-pre_to-deformed_desc-{state}_mask.nii.gz")
    rng = np.random.default_rng(seed)
    voxels = np.argwhere(np.asanyarray(mask.dataobj) > 0)
    voxels = voxels[rng.choice(len(voxels), count, replace=len(voxels) < count)].astype(float)
    centres = affine_points(mask.affine, voxels)
    between = affine_points(mask.affine, voxels + rng.uniform(-0.5, 0.5, voxels.shape))
    # ITK's transforms map points of the image that stays to the one that is moved: this one takes a point of pre to post.
    rigid = case / "xfm/from-post_to-pre.tfm"
    with tempfile.TemporaryDirectory() as folder:
        ours = lambda points, *words: by_hgm(program, points, words, Path(folder))
        deformed, in_post = ours(between, "--field", str(shift)), ours(between, "--field", str(there))
        ways = [
            ("pre to deformed", between, [shift], deformed),
            ("deformed to pre", deformed, [back], ours(deformed, "--field", str(back))),
            ("pre to post", between, [there], in_post),
            ("post to pre", in_post, [home], ours(in_post, "--field", str(home))),
            ("brain shift, then the rigid motion", between, [shift, rigid], in_post),
        ]
        off = lambda a, b: np.linalg.norm(a - b, axis=1)
        for name, points, files, expected in ways:
            if is_installed("SimpleITK"):
                yield name, "SimpleITK", off(by_itk(points, files), expected)
            if is_installed("antspyx"):
                yield name, "antspyx", off(by_ants(points, files), expected)
            if len(files) == 1 and is_installed("dipy"):
                yield name, "dipy", off(by_dipy(points, files[0]), expected)
            if len(files) == 1:
                yield name, "nibabel", off(by_nibabel(points, files[0]), expected)
        at_centres = [("pre to deformed", [shift], shift), ("pre to post", [there], there), (ways[4][0], ways[4][2], there)]
        for name, files, ours_is in at_centres if is_installed("nitransforms") else []:
            expected = ours(centres, "--field", str(ours_is))
            yield name, "nitransforms, at centres", off(by_nitransforms(centres, files), expected)
        # The case's own way of carrying points: the field inside the tissue.
        yield "pre to post", "hgm warp CASE", off(ours(between, str(case), "--state", state, "--to", "post"), in_post)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("case", type=Path)
    parser.add_argument("--state", default="estimate")
    parser.add_argument("--hgm", default="hgm")
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--limit-mm", type=float, default=0.01)
    args = parser.parse_args()
    if not field_of(args.case, "from-pre_to-deformed", args.state).exists():
        print(f"check_fields: {args.case}: no field of the state {args.state}; name a finished case", file=sys.stderr)
        return 3
    worst = 0.0
    for name, tool, off in rows(args.case, args.state, args.hgm, args.points):
        print(f"{name:<36} {tool:<26} largest {off.max():.5f} mm, median {np.median(off):.5f} mm")
        worst = max(worst, off.max())
    left_out = [tool for tool in MODULES if not is_installed(tool)]
    if left_out:
        print(f"not installed, left out: {', '.join(left_out)}", file=sys.stderr)
    return 0 if worst <= args.limit_mm else 4


if __name__ == "__main__":
    sys.exit(main())
