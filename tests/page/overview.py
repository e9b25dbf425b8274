#!/usr/bin/env python3
"""Puts pictures of a page's sections (test_page.py --pictures) side by side: the README's picture.

    tests/page/overview.py target/page-pictures/page-1-pair/light docs/overview.png
"""

import argparse
import pathlib

import cv2
import numpy as np

# Two columns of sections, top to bottom.
COLUMNS = (("glance", "masks"), ("view", "error", "mesh"))
WIDTH, GAP, HEIGHT = 760, 10, 1330


def column(folder, names):
    """The sections below each other on white, cut at HEIGHT."""
    canvas = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    top = 0
    for name in names:
        picture = cv2.imread(str(folder / f"{name}.png"))
        if picture is None:
            raise SystemExit(f"{folder / name}.png: is not there; run test_page.py with --pictures first")
        height = round(picture.shape[0] * WIDTH / picture.shape[1])
        part = cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)[: max(HEIGHT - top, 0)]
        canvas[top:top + part.shape[0]] = part
        top += height + GAP
    return canvas


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", type=pathlib.Path, help="folder of one page's section pictures")
    parser.add_argument("output", type=pathlib.Path, help="PNG to write")
    options = parser.parse_args()
    columns = [column(options.pictures, names) for names in COLUMNS]
    gap = np.full((HEIGHT, GAP, 3), 255, np.uint8)
    overview = np.hstack([columns[0], gap, columns[1]])
    cv2.imwrite(str(options.output), overview, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
