"""The command `hgm`, and a command of it within Python."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, Optional, Union

from . import _hgm
from ._errors import InputRefused
from ._files import Files

#: Hears where a job stands: part, steps done, steps in all, what is being done.
Progress = Callable[[str, int, int, str], Any]
#: Settings by room, as in a settings file; or the path of such a file.
Settings = Union[Mapping[str, Any], str, "os.PathLike[str]", None]


def main() -> int:
    """Runs the command in this process and returns its exit code."""
    return _hgm.main(["hgm", *sys.argv[1:]])


def plain(value: Any) -> Any:
    """Values of numpy's and paths as JSON takes them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} has no place in it")


def as_json(name: str, value: Any) -> str:
    """A dictionary as JSON."""
    try:
        return json.dumps(value, default=plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputRefused(f"{name}: {error}: give numbers, texts, lists and dictionaries") from None


def options(files: Files, settings: Settings, **given: Any) -> list[str]:
    """Options of a command, of those arguments that are given; the settings as its settings file."""
    words: list[str] = []
    if isinstance(settings, Mapping):
        words.append("--config=" + files.text("settings.toml", _hgm.settings_text(as_json("settings", settings))))
    elif settings is not None:
        words.append("--config=" + files.path("settings", settings))
    for name, value in given.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(option)
        elif isinstance(value, (list, tuple)):
            words.extend(f"{option}={one}" for one in value)
        else:
            words.append(f"{option}={value}")
    return words


def call(words: list[str], progress: Optional[Progress] = None) -> Any:
    """What a command prints with --json."""
    if progress is not None and not callable(progress):
        raise InputRefused("progress: not a function: give one of (part, done, total, doing), or hgm.bars()")
    told = _hgm.call(words, sys.executable or None, progress)
    return None if told is None else json.loads(told)
