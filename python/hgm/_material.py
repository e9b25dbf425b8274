"""Materials: the literature's prior, and laws fitted to tests."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _hgm
from ._command import Settings, call, options
from ._errors import InputRefused
from ._files import files


@dataclass
class Materials:
    """Materials of one tissue.

    Attributes
    ----------
    shear_modulus_pa : (n,) float64
        Small-strain shear moduli.
    materials : list of dict
        Tables of a scenario: ``scenario["materials"]["grey_matter"] = drawn.materials[0]``.
    fits : list of dict
        The fitted laws: parameters, goodness, stability.
    """

    shear_modulus_pa: NDArray[np.float64]
    materials: list[dict[str, Any]]
    fits: list[dict[str, Any]]

    def __len__(self) -> int:
        return len(self.materials)


def _materials(text: str) -> Materials:
    rows = json.loads(text)
    moduli = np.array([row["fit"]["shear_modulus_pa"] for row in rows], dtype=np.float64)
    return Materials(moduli, [row["material"] for row in rows], [row["fit"] for row in rows])


class Prior:
    """What the Gaussian process over 73 published models says of one tissue.

    Parameters
    ----------
    task : str
        Kind of study and region: ``hyperelastic-white``, ``hyperelastic-grey``, ``mre-healthy``, ``linear-abnormal`` ...
    law : str
        The law that is fitted to each curve: ``neo-hookean``, ``mooney-rivlin``, ``ogden`` ...
    studies : path, optional
        A table of your own studies (CSV, as ``hgm gp studies`` prints): added, or in place of those of their id.

    Attributes
    ----------
    stretches : (k,) float64
        Stretches over the task's window.
    mean, sd, observation_sd : (k,) float64
        Of ln W (W, strain energy density, in Pa): mean, standard deviation of the tissue's own curve and of a new study's.

    Examples
    --------
    >>> import hgm
    >>> drawn = hgm.Prior("hyperelastic-white").draw(3, seed=7)
    >>> drawn.shear_modulus_pa.shape
    (3,)
    """

    def __init__(
        self,
        task: str = "hyperelastic-healthy",
        *,
        law: str = "neo-hookean",
        studies: Optional[Union[str, os.PathLike[str]]] = None,
    ) -> None:
        self.task, self.law = task, law
        self._prior = _hgm.Prior(task, law, None if studies is None else os.fspath(studies))
        self.stretches: NDArray[np.float64] = self._prior.stretches()
        self.mean: NDArray[np.float64] = self._prior.mean()
        self.sd: NDArray[np.float64]
        self.observation_sd: NDArray[np.float64]
        self.sd, self.observation_sd = self._prior.sds()

    def __repr__(self) -> str:
        return f"hgm.Prior({self.task!r}, law={self.law!r})"

    def draw(self, n: int, seed: int = 0, *, spread: str = "tissue", poisson_ratio: float = 0.45) -> Materials:
        """Materials fitted to `n` random curves; draw k of a seed is the same whatever their number.

        ``spread``: ``tissue`` (its own curve) or ``study`` (what one more study would report of it).
        """
        if not 1 <= n <= 1_000_000:
            raise InputRefused(f"n: {n}: give 1 to 1000000 draws")
        if not 0 <= seed < 1 << 53:
            raise InputRefused(f"seed: {seed}: give 0 or more, below 2^53")
        if spread not in ("tissue", "study"):
            raise InputRefused(f"spread: {spread!r}: say tissue or study")
        return _materials(self._prior.draw(n, seed, spread == "study", _poisson(poisson_ratio)))

    def levels(self, sds: ArrayLike = (-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2), *, poisson_ratio: float = 0.45) -> Materials:
        """Materials at standard deviations from the mean: the paper's quantile envelopes."""
        levels = np.asarray(sds, dtype=np.float64).ravel()
        if not (np.abs(levels) <= 6).all():
            raise InputRefused("sds: give standard deviations from -6 to 6")
        return _materials(self._prior.levels(levels.tolist(), _poisson(poisson_ratio)))


def _poisson(ratio: float) -> float:
    if not 0 <= ratio < 0.5:
        raise InputRefused(f"poisson_ratio: {ratio}: it must be at least 0 and below 0.5")
    return float(ratio)


def fit_law(
    stretch: Any,
    nominal_stress_pa: Optional[ArrayLike] = None,
    *,
    law: Any = (),
    poisson_ratio: float = 0.45,
    settings: Settings = None,
) -> Materials:
    """Fits laws to a uniaxial test.

    Parameters
    ----------
    stretch : (k,) float64 or path
        Stretches; or a CSV whose header names quantity and unit, as ``hgm law fit`` takes it.
    nominal_stress_pa : (k,) float64
        Nominal stresses, Pa; of an array only.
    law : str or sequence of str
        ``neo-hookean``, ``mooney-rivlin``, ``ogden`` ...; all of them where none is named.
    poisson_ratio : float
        Of the scenario's tables.

    Returns
    -------
    Materials
        One for each law, in order.
    """
    with files() as temporary:
        if isinstance(stretch, (str, os.PathLike)):
            if nominal_stress_pa is not None:
                raise InputRefused("nominal_stress_pa: the file has its own: leave it out")
            test = temporary.path("stretch", stretch)
        else:
            if nominal_stress_pa is None:
                raise InputRefused("nominal_stress_pa: missing: give one stress for each stretch, in Pa")
            x, y = (np.asarray(v, dtype=np.float64).ravel() for v in (stretch, nominal_stress_pa))
            if x.shape != y.shape:
                raise InputRefused(f"nominal_stress_pa: {len(y)} for {len(x)} stretches: give one each")
            for name, values in (("stretch", x), ("nominal_stress_pa", y)):
                if not np.isfinite(values).all():
                    raise InputRefused(f"{name}: not finite everywhere: take those points away")
            lines = "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist()))
            test = temporary.text("test.csv", "stretch,nominal stress (Pa)\n" + lines)
        laws = [law] if isinstance(law, str) else list(law)
        words = ["law", "fit", test]
        words += options(temporary, settings, law=",".join(laws) or None, poisson_ratio=_poisson(poisson_ratio))
        fits = call(words)["fits"]
    moduli = np.array([one["fit"]["shear_modulus_pa"] for one in fits], dtype=np.float64)
    return Materials(moduli, [one["material"] for one in fits], [one["fit"] for one in fits])
