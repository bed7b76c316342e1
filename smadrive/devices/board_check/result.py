"""The results of the checks of a board."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple


class CheckKind(StrEnum):
    """The subject of a check: the replies of the board (CONFORMANCE), or its safety functions (SAFETY)."""

    CONFORMANCE = "conformance"
    SAFETY = "safety"


class CheckVerdict(StrEnum):
    """The outcome of a check."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_CHECKED = "not checked"


class CheckResult(NamedTuple):
    """The verdict on the check `name`; `detail` says what the check found."""

    kind: CheckKind
    name: str
    verdict: CheckVerdict
    detail: str = ""


def judged(kind: CheckKind, name: str, *, passed: bool, detail: str = "") -> CheckResult:
    """Return the result of a check that was carried out: PASSED or FAILED."""
    return CheckResult(kind, name, CheckVerdict.PASSED if passed else CheckVerdict.FAILED, detail)


def failed(results: Iterable[CheckResult], kind: CheckKind) -> list[CheckResult]:
    """Return the failed checks of this kind."""
    return [one for one in results if one.kind is kind and one.verdict is CheckVerdict.FAILED]
