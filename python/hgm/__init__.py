"""hgm: from a pre- and post-operative T1 pair to a biomechanical answer: how the brain deformed, which stiffness explains it,
and how sure that is.

Positions are in mm, RAS+; moduli in Pa. The same inputs and settings give the same bytes, on any number of threads, and the same
as the command ``hgm``. Research software, not a medical device.

>>> import hgm
>>> case = hgm.run("pre.nii.gz", "post.nii.gz", "case", progress=hgm.bars())  # doctest: +SKIP
>>> case.outcome["verdict"]["sentence"]  # doctest: +SKIP
"""

from ._case import Case, Points, warp_points
from ._errors import ComputationFailed, HgmError, InputRefused, QualityRefused
from ._hgm import VERSION as __version__
from ._jobs import Registration, Segmentation, predict, register, run, segment
from ._material import Materials, Prior, fit_law
from ._mesh import Mesh, Result, mesh, simulate
from ._progress import bars

__all__ = [
    "Case",
    "ComputationFailed",
    "HgmError",
    "InputRefused",
    "Materials",
    "Mesh",
    "Points",
    "Prior",
    "QualityRefused",
    "Registration",
    "Result",
    "Segmentation",
    "__version__",
    "bars",
    "fit_law",
    "mesh",
    "predict",
    "register",
    "run",
    "segment",
    "simulate",
    "warp_points",
]
