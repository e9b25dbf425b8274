"""What hgm raises. The texts are those of the command; a class stands for each of its exit codes."""

from __future__ import annotations

import json
from typing import Any


class HgmError(RuntimeError):
    """Anything that hgm gives up on.

    Attributes
    ----------
    exit_code : int
        What the command would have ended with: 1 failed, 3 input rejected, 4 refused by a quality gate.
    """

    exit_code = 1


class ComputationFailed(HgmError):
    """The computation or the machine failed; nothing is half-written."""


class InputRefused(HgmError, ValueError):
    """An input or a setting cannot be used; nothing was written. The message names it, the rule and the remedy."""

    exit_code = 3


class QualityRefused(HgmError):
    """Computed, and not to be believed; what was computed is kept.

    Attributes
    ----------
    answer : str or None
        ``no-operation`` or ``not-one-person`` where the two scans themselves gave that answer.
    result : dict or None
        What the command prints with ``--json``, where it came that far.
    found : Case, Mesh, Registration, Segmentation or None
        What the function would have returned.
    """

    exit_code = 4

    def __init__(self, message: str, answer: str | None = None, result: dict[str, Any] | None = None) -> None:
        super().__init__(message)
        self.answer = answer
        self.result = result
        self.found: Any = None


def of_code(code: int, message: str, answer: str | None, result: str | None) -> HgmError:
    """The exception of an exit code."""
    if code == QualityRefused.exit_code:
        return QualityRefused(message, answer, json.loads(result) if result else None)
    return (InputRefused if code == InputRefused.exit_code else ComputationFailed)(message)
