"""Pickles the user's code with the name of its file, which cloudpickle leaves out.

So a traceback in the loop process names the user's file, and shows its lines. The cell of a notebook is no file, so its
lines are sent, too; Python's `linecache` then finds them in the loop process.
"""

from __future__ import annotations

import io
import linecache
from collections import ChainMap
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any, ClassVar

import cloudpickle

_reduced: Callable[[CodeType], tuple[Any, ...]] = cloudpickle.Pickler.dispatch_table[CodeType]


def dumps(value: Any) -> bytes:
    """Return `value` pickled by cloudpickle; code objects keep the name of their file."""
    buffer = io.BytesIO()
    _CodePickler(buffer).dump(value)
    return buffer.getvalue()


def _with_origin(code: CodeType) -> tuple[Any, ...]:
    """Return the function and the arguments with which unpickling restores the code object.

    The lines of the code are sent only if its file does not exist.
    """
    name = code.co_filename
    lines = None if Path(name).exists() else linecache.getlines(name)
    kind, arguments = _reduced(code)[:2]
    return _restored, (kind, arguments, name, lines or None)


def _restored(
    kind: Callable[..., CodeType], arguments: tuple[Any, ...], name: str, lines: list[str] | None
) -> CodeType:
    """Return the code object, and make its lines known to `linecache`."""
    if lines is not None:
        linecache.cache[name] = (sum(map(len, lines)), None, lines, name)
    return kind(*arguments).replace(co_filename=name)


class _CodePickler(cloudpickle.Pickler):  # type: ignore[misc]  # cloudpickle has no types
    """cloudpickle's pickler, except that code objects are pickled by `_with_origin`."""

    dispatch_table: ClassVar = ChainMap({CodeType: _with_origin}, cloudpickle.Pickler.dispatch_table)
