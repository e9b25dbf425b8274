"""The README's script prints what the README shows."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from conftest import ROOT


def test_the_script_of_the_readme_prints_what_is_shown(tmp_path: Path) -> None:
    part = (ROOT / "README.md").read_text().partition("## In Python")[2].partition("\n## ")[0]
    script, shown = re.search(r"```python\n(.*?)```.*?```\n(.*?)```", part, re.DOTALL).groups()
    assert len([line for line in script.splitlines() if line.strip()]) < 15
    (tmp_path / "sample-data").symlink_to(ROOT / "sample-data")
    ended = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == shown
