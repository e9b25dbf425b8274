"""Priors and laws from Python: the command's figures."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

import hgm


def test_draws_are_those_of_the_command(command: str, tmp_path: Path) -> None:
    drawn = hgm.Prior("hyperelastic-white").draw(5, seed=7)
    words = [command, "gp", "sample", "--task", "hyperelastic-white", "--draws", "5", "--seed", "7", "-o", str(tmp_path)]
    subprocess.run([*words, "-q"], check=True, stdout=subprocess.DEVNULL)
    tables = [path.read_text().splitlines() for path in sorted(tmp_path.glob("*.csv"))]
    columns = [
        np.array([float(line.split(",")[head.split(",").index("shear_modulus_pa")]) for line in lines])
        for head, *lines in tables
        if "shear_modulus_pa" in head.split(",") and len(lines) == 5
    ]
    assert columns, [table[0] for table in tables]
    np.testing.assert_allclose(drawn.shear_modulus_pa, columns[0], rtol=1e-12)


def test_a_draw_does_not_depend_on_how_many_there_are() -> None:
    prior = hgm.Prior("hyperelastic-grey")
    np.testing.assert_array_equal(prior.draw(2, seed=3).shear_modulus_pa, prior.draw(6, seed=3).shear_modulus_pa[:2])
    assert (prior.draw(2, seed=4).shear_modulus_pa != prior.draw(2, seed=3).shear_modulus_pa).all()
    assert (np.diff(prior.levels().shear_modulus_pa) > 0).all()
    assert prior.stretches.shape == prior.mean.shape == prior.sd.shape == (501,)
    assert (prior.observation_sd > prior.sd).all()


def test_a_drawn_material_is_a_scenarios() -> None:
    from bodies import bar, scenario

    points, cells, labels = bar(2)
    given = scenario()
    given["materials"] = {"grey_matter": hgm.Prior("hyperelastic-grey").draw(1, seed=1).materials[0]}
    result = hgm.simulate(points, cells, labels, {"base": points[:, 2] == 0}, given)
    assert np.isfinite(result.displacement_mm).all() and result.displacement_mm.any()


def test_a_law_is_found_again_from_its_own_curve() -> None:
    stretch = np.linspace(0.8, 1.2, 21)
    stress = 700.0 * (stretch - stretch**-2)
    fit = hgm.fit_law(stretch, stress, law="neo-hookean")
    assert fit.shear_modulus_pa == pytest.approx([700.0], rel=1e-6)
    assert fit.materials[0]["law"] == "neo-hookean"
    assert len(hgm.fit_law(stretch, stress)) > 1


def test_a_test_in_a_file_gives_what_its_arrays_give(command: str, tmp_path: Path) -> None:
    stretch = np.linspace(0.9, 1.1, 11)
    stress = 350.0 * (stretch - stretch**-2)
    file = tmp_path / "test.csv"
    file.write_text("stretch,nominal stress (Pa)\n" + "".join(f"{x!r},{y!r}\n" for x, y in zip(stretch.tolist(), stress.tolist())))
    printed = subprocess.run([command, "law", "fit", str(file), "--law", "ogden", "--json"], check=True, capture_output=True)
    assert hgm.fit_law(stretch, stress, law="ogden").fits[0] == json.loads(printed.stdout)["fits"][0]["fit"]
    assert hgm.fit_law(file, law="ogden").fits == hgm.fit_law(stretch, stress, law="ogden").fits


def test_what_cannot_be_drawn_or_fitted_is_refused_in_the_commands_words() -> None:
    for words, ask in [
        ("say for example hyperelastic-healthy", lambda: hgm.Prior("white")),
        ("law `hooke` is unknown", lambda: hgm.Prior(law="hooke")),
        ("give 1 to 1000000", lambda: hgm.Prior().draw(0)),
        ("-6 to 6", lambda: hgm.Prior().levels([7])),
        ("not finite everywhere", lambda: hgm.fit_law([0.9, np.nan, 1.1], [1, 2, 3])),
        ("give one each", lambda: hgm.fit_law([0.9, 1.1], [1, 2, 3])),
        ("law `hooke` is unknown", lambda: hgm.fit_law([0.9, 1.0, 1.1], [1, 2, 3], law="hooke")),
        ("no-such.csv", lambda: hgm.fit_law("no-such.csv")),
    ]:
        with pytest.raises(hgm.InputRefused) as caught:
            ask()
        assert words in str(caught.value), str(caught.value)
