"""A case from Python: the command's bytes, and everything in it as arrays."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hgm
from conftest import CHEAP

#: Of hgm's label maps.
WHITE_MATTER = 3


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="session")
def case(made: Path, scans: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> hgm.Case:
    """The bundled pair after `hgm.run`, one scan as a path, the other as text."""
    heard = []
    # The page is headed by the folder's name.
    folder = tmp_path_factory.mktemp("python") / "case"
    found = hgm.run(scans[0], str(scans[1]), folder, settings=CHEAP, progress=lambda *told: heard.append(told))
    assert heard and all(0 <= done <= total for _, done, total, _ in heard)
    return found


def test_python_and_the_command_leave_the_same_bytes(case: hgm.Case, made: Path) -> None:
    ours, its = contents(case.path), contents(made)
    assert sorted(ours) == sorted(its)
    assert [name for name in its if ours[name] != its[name]] == []


def test_a_dictionary_of_settings_is_the_file_of_settings(case: hgm.Case, scans: tuple[Path, Path]) -> None:
    before = contents(case.path)
    tomllib = pytest.importorskip("tomllib")
    hgm.run(*scans, case.path, settings=tomllib.loads(CHEAP.read_text()))
    assert contents(case.path) == before


def test_a_case_hands_over_what_is_in_it(case: hgm.Case) -> None:
    nibabel = pytest.importorskip("nibabel")
    outcome = case.outcome
    assert outcome["samples"] and outcome["verdict"]
    assert case.settings["mesh"]["size"] == {"cells": 3000}
    table = case.table()
    assert list(table["sample"]) == [sample["id"] for sample in outcome["samples"]]
    assert float(table["displacement_max_mm"][0]) == outcome["samples"][0]["displacement_max_mm"]
    mesh = case.mesh()
    assert mesh.points.shape[1] == 3 and mesh.cells.shape == (len(mesh.labels), 4) and "base" in mesh.sets
    assert case.page.name == "report.html"
    assert case.mask("cavity").get_fdata().any() and case.mask("brain", space="mni").get_fdata().any()
    # Before surgery there are ventricles too: which are meant must be said.
    assert case.mask("ventricle", of="post", space="mni").get_fdata().any()
    for unclear in [{"space": "mni"}, {"of": "post"}, {"of": "pre"}, {"of": "pre", "space": "mni"}]:
        with pytest.raises(hgm.InputRefused, match="ventricle post mni; the ventricles before surgery are label 4 of"):
            case.mask("ventricle", **unclear)
    assert set(np.unique(case.labels().get_fdata())) >= {0, 2, 3}
    files = case.files
    assert files["mesh/rest.vtu"]["space"] == "mni" and all((case.path / name).exists() for name in files)
    best = outcome["best_sample"] or outcome["samples"][0]["id"]
    state = case.mesh(best)
    np.testing.assert_array_equal(case.array("displacement", best), state.point_data["displacement"])
    assert isinstance(case.image("anat/pre_space-native_T1w.nii.gz"), nibabel.Nifti1Image)
    meshio = pytest.importorskip("meshio")
    assert isinstance(state.to_meshio(), meshio.Mesh)


def test_points_go_where_simpleitk_takes_them_by_the_written_field(case: hgm.Case) -> None:
    sitk = pytest.importorskip("SimpleITK")
    kept = [name for name in case.files if name.startswith("xfm/from-pre_to-post_desc-")]
    assert kept
    brain = case.mask("brain")
    rng = np.random.default_rng(3)
    voxels = np.argwhere(brain.get_fdata() > 0)
    chosen = voxels[rng.choice(len(voxels), 400, replace=False)]
    points = chosen @ brain.affine[:3, :3].T + brain.affine[:3, 3]
    for name in kept:
        state = name.split("desc-")[1].split("_")[0]
        field = sitk.DisplacementFieldTransform(sitk.Cast(sitk.ReadImage(str(case.path / name)), sitk.sitkVectorFloat64))
        lps = np.array([-1.0, -1.0, 1.0])
        theirs = np.array([field.TransformPoint(tuple(p)) for p in points * lps]) * lps
        ours = hgm.warp_points(case, np.ascontiguousarray(points), to="post", state=state)
        held = [where in ("tissue", "fluid") for where in ours.where]
        assert sum(held) > 300 and ours.state == state
        assert np.abs(ours.points - theirs)[held].max() < 1e-3


def test_a_landmark_moves_with_its_sd(case: hgm.Case) -> None:
    labels = case.labels()
    white = np.asarray(labels.dataobj) == WHITE_MATTER
    # White matter on all sides, so that no rounding makes fluid of it.
    for axis in range(3):
        white &= np.roll(white, 1, axis) & np.roll(white, -1, axis)
    inside = np.argwhere(white)
    deep = inside[np.linalg.norm(inside - inside.mean(axis=0), axis=1).argmin()]
    landmark = labels.affine[:3, :3] @ deep + labels.affine[:3, 3]
    moved = hgm.warp_points(case, [landmark], to="deformed")
    assert moved.where == ["tissue"] and moved.state == case.state
    np.testing.assert_array_equal(moved.displacement_mm, moved.points - landmark)
    assert moved.sd_mm[0] >= 0
    back = case.warp_points(case.warp_points([landmark], to="post").points, to="pre")
    assert np.linalg.norm(back.points - landmark) < 0.5


def test_scans_of_nibabel_are_taken(scans: tuple[Path, Path]) -> None:
    nibabel = pytest.importorskip("nibabel")
    moving, fixed = (nibabel.load(path) for path in scans)
    settings = {"register": {"levels_mm": [4.0], "samples": 50000}}
    found = hgm.register(moving, fixed, settings=settings)
    same = hgm.register(*scans, settings=settings)
    np.testing.assert_allclose(found.matrix, same.matrix, atol=1e-3)
    assert found.matrix.shape == (4, 4) and abs(np.linalg.det(found.matrix[:3, :3]) - 1) < 1e-9


def test_a_file_of_a_case_is_its_outcomes_or_refused(case: hgm.Case, tmp_path: Path) -> None:
    def other(change: Callable[[Path], object]) -> hgm.Case:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        shutil.copytree(case.path, folder)
        change(folder)
        return hgm.Case(folder)

    best = case.state
    # Another job has left the folder with settings that the outcome is not of.
    stale = other(lambda folder: (folder / "settings.toml").write_text("seed = 1\n"))
    reads: list[Callable[[hgm.Case], object]] = [
        lambda of: of.outcome,
        lambda of: of.brain_shift,
        lambda of: of.table(),
        lambda of: of.mesh(best),
        lambda of: of.array("displacement", best),
        lambda of: of.sd(state="fused"),
        lambda of: of.mask("cavity"),
        lambda of: of.warp_points([[0.0, 0.0, 0.0]], state="observed"),
    ]
    for read in reads:
        read(case)
        with pytest.raises(hgm.InputRefused, match="not of the present state"):
            read(stale)
    # A stage that the outcome knows nothing of.
    def left_behind(folder: Path) -> None:
        file = folder / "provenance.json"
        kept = json.loads(file.read_text())
        kept["stages"] = [stage for stage in kept["stages"] if stage["stage"] != "fields"]
        file.write_text(json.dumps(kept))

    left = other(left_behind)
    shifts: list[Callable[[], object]] = [
        lambda: left.brain_shift,
        lambda: left.sd(state="fused"),
        lambda: left.field(state=best),
    ]
    for ask in shifts:
        with pytest.raises(hgm.InputRefused, match="not of the present state"):
            ask()
    left.mask("cavity"), left.mesh(best)
    # A file that was changed since.
    changed = other(lambda folder: (folder / "mesh/rest.vtu").write_text(""))
    with pytest.raises(hgm.InputRefused, match="`mesh/rest.vtu` was changed"):
        changed.mesh()
    # Nothing gathered, and so nothing that a mask could be at odds with.
    other(lambda folder: (folder / "provenance.json").unlink()).mask("cavity")


def test_points_of_a_case_that_did_not_pass_its_gate_come_with_a_warning(
    case: hgm.Case, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert case.warp_points([[0.0, 0.0, 0.0]]).warnings == []
    folder = tmp_path / "case"
    shutil.copytree(case.path, folder)
    file = folder / ".stages/mesh.manifest.json"
    manifest = json.loads(file.read_text())
    manifest["facts"]["implausible"] = ["the falx is not where it should be"]
    file.write_text(json.dumps(manifest))
    moved = hgm.warp_points(folder, [[0.0, 0.0, 0.0]], to="mni")
    assert len(moved.warnings) == 1 and "the falx is not where" in moved.warnings[0]
    assert moved.warnings[0] in caplog.text


def test_a_freesurfer_image_of_nibabel_is_taken_as_its_nifti(case: hgm.Case, tmp_path: Path) -> None:
    nibabel = pytest.importorskip("nibabel")
    labels = case.labels(space="mni")
    values = np.asarray(labels.dataobj).astype(np.uint8)
    surfer = nibabel.MGHImage(values, labels.affine)
    options = {"cells": 3000, "engine": "lattice", "mni": False}
    of_surfer, of_nifti = (hgm.mesh(image, **options) for image in (surfer, nibabel.Nifti1Image(values, labels.affine)))
    np.testing.assert_array_equal(of_surfer.cells, of_nifti.cells)
    np.testing.assert_allclose(of_surfer.points, of_nifti.points, atol=1e-4)


def test_a_refused_segmentation_keeps_its_labels(
    case: hgm.Case, scans: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    labels = case.labels()

    def refuses(words: list[str], progress: object) -> None:
        """The command with labels that are not to be believed."""
        output = next(word for word in words if word.startswith("--output=")).removeprefix("--output=")
        shutil.copyfile(labels.get_filename(), output)
        raise hgm.QualityRefused("not to be believed", None, {"volumes": {"brain_cc": 1.0}, "warnings": ["odd"]})

    monkeypatch.setattr("hgm._jobs.call", refuses)
    with pytest.raises(hgm.QualityRefused) as caught:
        hgm.segment(scans[0])
    found = caught.value.found
    assert isinstance(found, hgm.Segmentation) and found.warnings == ["odd"]
    np.testing.assert_array_equal(found.labels, np.asarray(labels.dataobj))


def test_a_label_map_as_an_array_is_meshed_as_its_file(case: hgm.Case) -> None:
    labels = case.labels(space="mni")
    values = np.asarray(labels.dataobj)
    options = {"cells": 3000, "engine": "lattice"}
    of_array = hgm.mesh(values.astype(np.int16), labels.affine, **options)
    of_image = hgm.mesh(labels, mni=False, **options)
    np.testing.assert_array_equal(of_array.points, of_image.points)
    np.testing.assert_array_equal(of_array.cells, of_image.cells)
    assert set(np.unique(of_array.labels)) <= set(np.unique(values)) and not of_array.sets
    assert of_array.record["tets"] == len(of_array.cells)


def test_what_cannot_be_used_is_refused_in_the_commands_words(
    case: hgm.Case, command: str, scans: tuple[Path, Path], tmp_path: Path
) -> None:
    def told(*words: object) -> str:
        ended = subprocess.run([command, *map(str, words), "--json", "-q"], capture_output=True, text=True)
        assert ended.returncode == 3
        return json.loads(ended.stdout)["error"]["message"]

    pre, post = scans
    out = tmp_path / "out"
    moved = np.eye(4)
    moved[:3, 3] = 5
    for ask, words in [
        (lambda: hgm.run(tmp_path / "none.nii.gz", post, out), ["run", tmp_path / "none.nii.gz", post, "-o", out]),
        (lambda: hgm.run(pre, pre, out), ["run", pre, pre, "-o", out]),
        (lambda: hgm.Case(tmp_path), ["report", tmp_path]),
    ]:
        with pytest.raises(hgm.InputRefused) as caught:
            ask()
        assert str(caught.value) == told(*words)
    for ask, words in [
        (lambda: hgm.run(pre, post, out, settings={"mesh": {"cels": 1}}), "unknown setting `cels`"),
        (lambda: hgm.run(pre, post, out, settings={"resection": {"poisson_ratio": 0.6}}), "below 0.5"),
        (lambda: hgm.run(pre, post, out, settings={"resection": {"poisson_ratio": float("nan")}}), "settings:"),
        (lambda: hgm.run(pre, post, out, tissues=7), "tissues"),
        (lambda: hgm.run(pre, post, out, head="sideways"), "no way to lie"),
        (lambda: hgm.run(pre, 7, out), "give a path"),
        (lambda: hgm.predict(pre, ["small.nii.gz", "wide.nii.gz"], out), "give six numbers"),
        (lambda: hgm.predict(pre, np.zeros((3, 3, 3)), out), "or one path"),
        (lambda: hgm.predict(pre, [1, 2, 3], out), "give six numbers"),
        (lambda: hgm.run(pre, post, out, progress=7), "progress: not a function"),
        (lambda: case.warp_points([[0, 0, 0]], to="up"), "say post, deformed, pre or mni"),
        (lambda: case.warp_points([[0, 0]]), "give (n, 3)"),
        (lambda: case.image("anat/none.nii.gz"), "case.files"),
        (lambda: case.mask("tumour"), "say one of"),
        (lambda: case.array("none"), "none"),
        (lambda: hgm.mesh(np.zeros((3, 3)), np.eye(4)), "give (i, j, k)"),
        (lambda: hgm.mesh(np.ones((3, 3, 3), dtype=np.uint8)), "needs its affine"),
        (lambda: hgm.mesh(np.full((3, 3, 3), np.nan), np.eye(4)), "whole numbers"),
        (lambda: hgm.mesh(np.ones((3, 3, 3), dtype=np.uint8), np.diag([0, 0, 0, 1])), "no inverse"),
        (lambda: hgm.mesh(np.ones((3, 3, 3), dtype=np.uint8), np.zeros((4, 4))), "last row is 0 0 0 1"),
        (lambda: hgm.mesh(np.ones((3, 3, 3), dtype=np.uint8), moved.T), "or its transpose affine.T"),
        (lambda: hgm.mesh(np.ones((3, 3, 3), dtype=np.uint8), moved * 1j), "give real numbers"),
    ]:
        with pytest.raises(hgm.InputRefused) as caught:
            ask()
        assert words in str(caught.value), str(caught.value)
    assert not out.exists()


def test_ctrl_c_ends_a_run_between_two_files_and_another_goes_on(
    case: hgm.Case, scans: tuple[Path, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "broken" / "case"
    program = (
        "import sys, hgm\n"
        "def heard(part, done, total, doing):\n"
        "    print(part, flush=True)\n"
        "try:\n"
        f"    hgm.run({str(scans[0])!r}, {str(scans[1])!r}, {str(folder)!r}, settings={str(CHEAP)!r}, progress=heard)\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(9)\n"
    )
    # Where these tests run behind a shell without job control, interrupts are ignored from birth.
    heard = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    job = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, preexec_fn=heard)
    assert job.stdout
    job.stdout.readline()
    os.kill(job.pid, signal.SIGINT)
    assert job.wait(timeout=120) == 9
    assert not list(folder.rglob("*.part"))
    again = hgm.run(*scans, folder, settings=CHEAP)
    assert contents(again.path) == contents(case.path)


def test_the_command_of_the_wheel_is_the_command(command: str, scans: tuple[Path, Path], tmp_path: Path) -> None:
    said = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert said.stdout == f"hgm {hgm.__version__}\n"
    from importlib.metadata import version

    assert version("hgm") == hgm.__version__
    module = subprocess.run([sys.executable, "-m", "hgm", "--version"], capture_output=True, text=True, check=True)
    assert module.stdout == said.stdout
    for words, code in [(["rnu"], 2), (["report", str(tmp_path)], 3), (["layout"], 0)]:
        assert subprocess.run([command, *words], capture_output=True).returncode == code
    job = subprocess.Popen([command, "run", *map(str, scans), "-o", str(tmp_path / "case")], stderr=subprocess.DEVNULL)
    while not (tmp_path / "case").exists():
        assert job.poll() is None
    job.send_signal(signal.SIGINT)
    assert job.wait(timeout=60) == 130
    assert not list(tmp_path.rglob("*.part"))
