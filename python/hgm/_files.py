"""What stands for a file: a path, or an image of nibabel's, which is written to a temporary file."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._errors import InputRefused


class Files:
    """Paths for the words of a command; keeps the temporary files until it is closed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str, value: Any) -> str:
        """The path of what was given as the argument `name`."""
        if isinstance(value, (str, os.PathLike)):
            path = os.fspath(value)
            if isinstance(path, bytes):
                path = os.fsdecode(path)
            # A word that begins with a dash is an option.
            return f".{os.sep}{path}" if path.startswith("-") else path
        save = getattr(value, "to_filename", None)
        if callable(save) and hasattr(value, "affine"):
            kept = self.folder / f"{name}.nii.gz"
            _nifti(value).to_filename(str(kept))
            return str(kept)
        raise InputRefused(
            f"{name}: {type(value).__name__} is no file: give a path (str or pathlib.Path) or an image of nibabel's"
        )

    def text(self, name: str, text: str) -> str:
        """A text as a file."""
        kept = self.folder / name
        kept.write_text(text, encoding="utf-8")
        return str(kept)


def _nifti(image: Any) -> Any:
    """An image that can be written as NIfTI: nibabel writes FreeSurfer's, MINC's and others under their own endings alone."""
    try:
        import nibabel
    except ImportError:
        return image
    if isinstance(image, nibabel.Nifti1Image) or not isinstance(image, nibabel.spatialimages.SpatialImage):
        return image
    nifti = nibabel.Nifti1Image.from_image(image)  # type: ignore[no-untyped-call]
    # All of nibabel's affines are in mm.
    nifti.header.set_xyzt_units("mm")
    return nifti


@contextlib.contextmanager
def files() -> Iterator[Files]:
    """A folder for what must be a file, for as long as a command runs."""
    with tempfile.TemporaryDirectory(prefix="hgm-") as folder:
        yield Files(Path(folder))
