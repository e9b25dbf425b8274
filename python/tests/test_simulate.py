"""`hgm.simulate`: the command's answer, other people's answer, and what is refused."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

import hgm
from bodies import bar, scenario

POINTS, CELLS, LABELS = bar()
BASE = np.nonzero(POINTS[:, 2] == 0)[0]


def test_arrays_give_what_the_command_gives_to_the_bit(command: str, tmp_path: Path) -> None:
    result = hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, scenario())
    given = hgm.Mesh(POINTS, CELLS, LABELS, {"base": BASE})
    meshio = pytest.importorskip("meshio")
    meshio.write(tmp_path / "body.vtu", given.to_meshio())
    (tmp_path / "scenario.toml").write_text(
        'fixed = ["base"]\n[materials.grey_matter]\nlaw = "neo-hookean"\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n'
        '[loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\n[solver]\nelement = "tet4"\nrelative_residual = 1e-12\n'
    )
    words = [command, "simulate", tmp_path / "body.vtu", tmp_path / "scenario.toml", "-o", tmp_path / "out.vtu", "-q"]
    subprocess.run(list(map(str, words)), check=True)
    told = hgm.Mesh.read(tmp_path / "out.vtu")
    np.testing.assert_array_equal(told.point_data["displacement"], result.displacement_mm)
    np.testing.assert_array_equal(told.point_data["reaction_n"], result.reaction_n)
    np.testing.assert_array_equal(told.cell_data["jacobian"], result.jacobian)
    from_file = hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, tmp_path / "scenario.toml")
    np.testing.assert_array_equal(from_file.displacement_mm, result.displacement_mm)


def test_the_weight_stands_on_the_base() -> None:
    result = hgm.simulate(POINTS, CELLS, LABELS, {"base": POINTS[:, 2] == 0}, scenario())
    weight_n = 1000.0 * 0.03**3 * 9.81
    assert result.reaction_n.sum(axis=0) == pytest.approx([0.0, 0.0, weight_n], abs=1e-9 * weight_n)
    assert result.displacement_mm[POINTS[:, 2] == 30.0, 2].max() < 0
    assert result.convergence["relative_residual"] <= 1e-12


def test_zeros_and_ones_of_every_node_are_truth_values() -> None:
    """As ``Mesh.to_meshio`` and hgm's own files have sets."""
    truth = POINTS[:, 2] == 0
    given = [hgm.simulate(POINTS, CELLS, LABELS, {"base": base}, scenario()) for base in (truth, truth.astype(np.uint8), BASE)]
    for result in given[1:]:
        np.testing.assert_array_equal(result.displacement_mm, given[0].displacement_mm)
        np.testing.assert_array_equal(result.sets["base"], BASE)


def test_a_small_load_moves_the_body_as_scikit_fem_says() -> None:
    """Small strains: the neo-Hookean law is Hooke's but for terms of second order, which loads up and down have alike and half of
    their difference has not. The same mesh goes to scikit-fem, which solves the linear problem (SI)."""
    skfem = pytest.importorskip("skfem")
    from skfem.models.elasticity import linear_elasticity

    gravity = -1e-4
    mu, nu = 1000.0, 0.45
    mesh = skfem.MeshTet(POINTS.T * 1e-3, CELLS.T.astype(np.int64))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))
    stiffness = skfem.asm(linear_elasticity(2 * mu * nu / (1 - 2 * nu), mu), basis)
    load = skfem.asm(skfem.LinearForm(lambda v, w: 1000.0 * gravity * v[2]), basis)
    held = basis.get_dofs(lambda x: x[2] < 1e-9)
    theirs = skfem.solve(*skfem.condense(stiffness, load, D=held))[basis.nodal_dofs].T * 1e3
    down, up = (hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, scenario(g)) for g in (gravity, -gravity))
    ours = (down.displacement_mm - up.displacement_mm) / 2
    assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(theirs).max()


def refused(words: str, **changed: object) -> None:
    given: dict[str, object] = {
        "points": POINTS, "cells": CELLS, "labels": LABELS, "sets": {"base": BASE}, "scenario": scenario(), **changed
    }
    with pytest.raises(hgm.InputRefused) as caught:
        hgm.simulate(**given)  # type: ignore[arg-type]
    assert words in str(caught.value), str(caught.value)
    assert caught.value.exit_code == 3 and isinstance(caught.value, ValueError)


def test_what_cannot_be_used_is_refused_with_the_remedy() -> None:
    refused("points.astype(numpy.float64)", points=POINTS.astype(np.float32))
    refused("numpy.ascontiguousarray(points)", points=np.asfortranarray(POINTS))
    refused("numpy.ascontiguousarray(points)", points=np.repeat(POINTS, 2, axis=0)[::2])
    refused("give (n, 3)", points=POINTS[:, :2].copy())
    refused("row 7 (counted from 0) is not finite", points=np.where(np.arange(len(POINTS))[:, None] == 7, np.nan, POINTS))
    refused("give (m, 4)", cells=CELLS[:, :3].copy())
    refused("whole numbers", cells=CELLS.astype(float))
    refused("node numbers counted from 0", cells=CELLS.astype(np.int64) - 1)
    refused("there are only 64 nodes", cells=np.where(CELLS == 3, 64, CELLS).astype(np.uint32))
    refused("inverted or flat", cells=CELLS[:, [0, 2, 1, 3]].copy())
    refused("one label for each tetrahedron", labels=LABELS[:-1])
    refused("labels from 0 to 255", labels=LABELS.astype(np.int64) + 300)
    refused("only 64 nodes", sets={"base": [0, 64]})
    refused("a truth value for every node", sets={"base": np.ones(3, dtype=bool)})
    refused("node 7 is named more than once", sets={"base": [7, 8, 7]})
    refused("node 0 is named more than once", sets={"base": np.zeros(len(POINTS) - 1, dtype=int)})
    refused("`base` is a set of facets", sets={"base": CELLS[:1, :3]})
    refused("not numbers", points=[["a", None, {}]])
    refused("`base`", sets={})
    refused("scenario: unknown setting `fixd`", scenario={**scenario(), "fixd": []})
    refused("cannot be read", scenario="no-such-scenario.toml")


def test_a_body_without_equilibrium_is_no_result() -> None:
    with pytest.raises(hgm.HgmError):
        hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, scenario(-1e9, newton_iterations=3))


def test_an_exception_of_progress_ends_the_job_and_is_raised() -> None:
    class Enough(Exception):
        pass

    heard = []

    def progress(part: str, done: int, total: int, doing: str) -> None:
        heard.append((part, done, total))
        raise Enough

    with pytest.raises(Enough):
        hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, scenario(), progress=progress)
    assert heard == [("simulation", 0, 100)]


def test_bars_of_tqdm_follow_a_job() -> None:
    class Bar:
        made: list["Bar"] = []

        def __init__(self, total: int, desc: str) -> None:
            self.n, self.total, self.desc, self.closed = 0, total, desc, False
            Bar.made.append(self)

        def update(self, steps: int) -> None:
            self.n += steps

        def set_postfix_str(self, text: str, refresh: bool) -> None:
            assert "residual" in text and not refresh

        def close(self) -> None:
            self.closed = True

    hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, scenario(), progress=hgm.bars(Bar))
    assert [(bar.desc, bar.n, bar.total, bar.closed) for bar in Bar.made][0] == ("simulation", 100, 100, True)


def test_a_result_is_meshios_too(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    result = hgm.simulate(POINTS, CELLS, LABELS, {"base": BASE}, scenario())
    meshio.write(tmp_path / "out.vtu", result.to_meshio())
    again = hgm.Mesh.read(tmp_path / "out.vtu")
    np.testing.assert_array_equal(again.sets["base"], BASE)
    np.testing.assert_array_equal(again.point_data["displacement"], result.displacement_mm)
