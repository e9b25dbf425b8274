"""What the tests of the package start from."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: Settings that make a case cheap where a test is not about accuracy.
CHEAP = ROOT / "tests/data/cheap.toml"


@pytest.fixture(scope="session")
def command() -> str:
    """The command that the wheel installed beside this interpreter."""
    found = shutil.which("hgm", path=str(Path(sys.executable).parent))
    assert found, "the wheel installs the command `hgm` beside the interpreter"
    return found


@pytest.fixture(scope="session")
def scans() -> tuple[Path, Path]:
    """The tests' own pair, smaller than the bundled one."""
    return ROOT / "tests/data/pair/pre.nii.gz", ROOT / "tests/data/pair/post.nii.gz"


@pytest.fixture(scope="session")
def made(command: str, scans: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tests' pair after the command's `run`, cheaply."""
    case = tmp_path_factory.mktemp("command") / "case"
    subprocess.run([command, "run", "-q", *map(str, scans), "-o", str(case), "--config", str(CHEAP)], check=True)
    return case
