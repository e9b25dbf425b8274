"""Meshes as arrays, and what a simulation finds on them."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _hgm
from ._command import Progress, Settings, as_json, call, options
from ._errors import InputRefused, QualityRefused
from ._files import files


@dataclass
class Mesh:
    """Labelled linear tetrahedra with named sets. Positions in mm, RAS+; nodes counted from 0.

    Attributes
    ----------
    points : (n, 3) float64
        Nodes, mm.
    cells : (m, 4) uint32
        Nodes of each tetrahedron, right-handed.
    labels : (m,) uint8
        1 CSF, 2 grey matter, 3 white matter, 4 ventricle, 5 resected tissue.
    sets : dict of (k,) uint32
        Node sets by name.
    facets : dict of (k, 3) uint32
        Facet sets by name.
    point_data, cell_data : dict of arrays
        What stands on nodes and cells, the unit in the name (``displacement`` is in mm).
    record : dict
        What hgm notes of how the mesh was made.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.uint32]
    labels: NDArray[np.uint8]
    sets: dict[str, NDArray[np.uint32]] = field(default_factory=dict)
    facets: dict[str, NDArray[np.uint32]] = field(default_factory=dict)
    point_data: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    cell_data: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Any) -> Mesh:
        """A mesh of a VTU file: hgm's own, gmsh's or meshio's."""
        with files() as temporary:
            return cls(**_hgm.read_mesh(temporary.path("mesh", path)))

    def to_meshio(self) -> Any:
        """The mesh as meshio has it (``pip install meshio``), with labels, sets and data."""
        import meshio

        # Node sets are 0/1 arrays, as in hgm's own files: every format of meshio's keeps arrays.
        point_data: dict[str, NDArray[Any]] = dict(self.point_data)
        for name, nodes in self.sets.items():
            member = np.zeros(len(self.points), dtype=np.uint8)
            member[nodes] = 1
            point_data[name] = member
        cell_data = {"label": [self.labels], **{name: [values] for name, values in self.cell_data.items()}}
        return meshio.Mesh(
            self.points, [("tetra", self.cells.astype(np.int64))], point_data=point_data, cell_data=cell_data
        )


@dataclass
class Result(Mesh):
    """A deformed state. Its mesh is the given one, cut open where sets slide along a sheet.

    Attributes
    ----------
    displacement_mm : (n, 3) float64
        Displacement of every node.
    reaction_n : (n, 3) float64
        Force that keeps every held or moved node where it is told to be, N; zero elsewhere. Forces of walls and
        springs are in ``record["contact"]`` and ``record["tethers"]``.
    jacobian : (m,) float64
        Volume ratio of every cell.
    strain_energy_density_pa : (m,) float64
        Stored energy per undeformed volume.
    contact_pressure_pa : (n,) float64 or None
        Pressure of walls; None without walls.
    convergence : dict
        The solver's record.
    warnings : list of str
        What a reader must know.
    """

    @property
    def displacement_mm(self) -> NDArray[np.float64]:
        return self.point_data["displacement"]

    @property
    def reaction_n(self) -> NDArray[np.float64]:
        return self.point_data["reaction_n"]

    @property
    def jacobian(self) -> NDArray[np.float64]:
        return self.cell_data["jacobian"]

    @property
    def strain_energy_density_pa(self) -> NDArray[np.float64]:
        return self.cell_data["strain_energy_density_pa"]

    @property
    def contact_pressure_pa(self) -> Optional[NDArray[np.float64]]:
        return self.point_data.get("contact_pressure_pa")

    @property
    def convergence(self) -> dict[str, Any]:
        return dict(self.record["convergence"])

    @property
    def warnings(self) -> list[str]:
        return list(self.record["warnings"])


def simulate(
    points: ArrayLike,
    cells: ArrayLike,
    labels: ArrayLike,
    sets: Any,
    scenario: Any,
    *,
    progress: Optional[Progress] = None,
) -> Result:
    """Deforms a mesh by the loads and materials of a scenario.

    Parameters
    ----------
    points : (n, 3) float64
        Nodes, mm; borrowed without a copy, so in one piece (``numpy.ascontiguousarray``).
    cells : (m, 4) integers
        Nodes of each tetrahedron, counted from 0, right-handed; uint32 is borrowed without a copy.
    labels : (m,) integers
        2 grey matter, 3 white matter, or other numbers that the scenario's table ``labels`` names.
    sets : dict
        Node sets, as node numbers or (n,) truth values (0 and 1 are such), and facet sets as (k, 3) node numbers.
    scenario : dict or path
        As in a scenario file: ``fixed``, ``materials`` (moduli in Pa), ``loads`` (m/s2, N, Pa), ``solver`` ...
    progress : callable, optional
        Hears ``(part, done, total, doing)``.

    Returns
    -------
    Result

    Examples
    --------
    >>> import hgm
    >>> tet = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]]
    >>> brain = {"law": "neo-hookean", "shear_modulus_pa": 1000.0, "poisson_ratio": 0.45}
    >>> scenario = {
    ...     "fixed": ["base"],
    ...     "materials": {"grey_matter": brain},
    ...     "loads": {"gravity_m_per_s2": [0.0, 0.0, -9.81]},
    ... }
    >>> result = hgm.simulate(tet, [[0, 1, 2, 3]], [2], {"base": [0, 1, 2]}, scenario)
    >>> bool(result.displacement_mm[3, 2] < 0)
    True
    """
    nodes = _arrays.points("points", points)
    tets = _arrays.cells("cells", cells)
    of_cells = _arrays.labels("labels", labels, len(tets))
    node_sets, facet_sets = _arrays.sets(sets, len(nodes))
    with files() as temporary:
        json_text = hasattr(scenario, "items")
        text = as_json("scenario", scenario) if json_text else _text(temporary.path("scenario", scenario))
        found = _hgm.simulate(nodes, tets, of_cells, node_sets, facet_sets, text, json_text, progress)
    record = json.loads(found.pop("record"))
    point_data = {"displacement": found.pop("displacement_mm"), "reaction_n": found.pop("reaction_n")}
    if "contact_pressure_pa" in found:
        point_data["contact_pressure_pa"] = found.pop("contact_pressure_pa")
    cell_data = {name: found.pop(name) for name in ("jacobian", "strain_energy_density_pa")}
    return Result(**found, point_data=point_data, cell_data=cell_data, record=record)


def _text(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputRefused(f"{path}: cannot be read ({error}); check the path") from None


def mesh(
    labels: Any,
    affine: Optional[ArrayLike] = None,
    *,
    cells: Optional[int] = None,
    edge_mm: Optional[float] = None,
    engine: Optional[str] = None,
    numbers: Optional[str] = None,
    without: Any = (),
    mni: Optional[bool] = None,
    settings: Settings = None,
    progress: Optional[Progress] = None,
) -> Mesh:
    """Meshes a label map: conforming tetrahedra of every nonzero label.

    Parameters
    ----------
    labels : (i, j, k) integers, path or nibabel image
        1 CSF, 2 grey matter, 3 white matter, 4 ventricle, 5 resected tissue; a map of FreeSurfer, SynthSeg, SimNIBS, GIF or
        MUSE is known by its numbers.
    affine : (4, 4) float64
        Voxel indices to mm (RAS+); of an array only, files have their own.
    cells : int, optional
        Target number of tetrahedra.
    edge_mm : float, optional
        Target edge instead.
    engine : str, optional
        ``lattice`` (always there), ``cgal``, ``gmsh`` or ``tetgen``.
    numbers : str, optional
        Whose numbers the map holds; found out where it is not said.
    without : sequence of int
        Labels to leave out.
    mni : bool, optional
        Whether the map is in MNI space, which boundary sets need; what the file says where it is not given, False for an array.
    settings : dict or path, optional
        As in a settings file.
    progress : callable, optional
        Hears ``(part, done, total, doing)``.

    Returns
    -------
    Mesh
        Its ``record`` has quality, volumes and sets.

    Raises
    ------
    QualityRefused
        A boundary set is not to be believed; its ``found`` is the mesh.
    """
    in_mni: Optional[bool]
    with files() as temporary:
        if hasattr(labels, "__array__") and not hasattr(labels, "affine") or isinstance(labels, list):
            if affine is None:
                raise InputRefused("affine: missing: an array needs its affine, voxel indices to mm (RAS+)")
            values = _arrays.label_map("labels", labels)
            encoded = _hgm.encode_label_map(
                values.shape, np.ascontiguousarray(values.ravel(order="F")), _arrays.affine("affine", affine)
            )
            kept = temporary.folder / "labels.nii.gz"
            kept.write_bytes(encoded)
            source, in_mni = str(kept), mni or False
        else:
            if affine is not None:
                raise InputRefused("affine: files and images have their own: leave it out")
            source, in_mni = temporary.path("labels", labels), mni
        chosen = None if in_mni is None else ("mni" if in_mni else "none")
        output = temporary.folder / "mesh.vtu"
        words = ["mesh", source, f"--output={output}"]
        left_out = ",".join(str(int(label)) for label in without) or None
        words += options(
            temporary,
            settings,
            cells=cells,
            edge_mm=edge_mm,
            mesher=engine,
            labels=numbers,
            without=left_out,
            sets=chosen,
        )
        try:
            record = call(words, progress)
        except QualityRefused as refused:
            if refused.result is not None:
                refused.found = Mesh(**_hgm.read_mesh(str(output)), record=refused.result)
            raise
        return Mesh(**_hgm.read_mesh(str(output)), record=record)
