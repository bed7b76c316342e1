"""Requests as bytes, with the user's code that they need.

A request contains the present code of the classes and functions from the script, the notebook and the user's own
modules. So a module that was edited and reloaded takes effect, although the loop process may have imported it before.
Installed packages are sent by name only.
"""

from __future__ import annotations

import pickle
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from smadrive.errors import ControllerError
from smadrive.scripting.loop.code_origin import dumps

_OURS = ("smadrive", "firmware_sim")
_INSTALLED = tuple({str(Path(path).resolve()) for path in (*sysconfig.get_paths().values(), sys.base_prefix)})


def pickled(request: Any) -> bytes:
    """Return the pickled request with the user's code or, if this code cannot be pickled, with the names of its parts.

    ControllerError when that fails, too. A request without fields needs no code of the user, and finding this code in
    all imported modules takes some milliseconds.
    """
    if is_dataclass(request) and not fields(request):
        return pickle.dumps(request)
    try:
        with _own_code_by_value():
            message = dumps(request)
    except Exception:  # noqa: BLE001 (the user's module may hold an object that cannot be copied: send its name)
        return _pickled_by_name(request)
    return message


def _pickled_by_name(request: Any) -> bytes:
    try:
        message = dumps(request)
    except Exception as error:
        cure = "open files, ports and threads inside update, not before"
        raise ControllerError("cannot be transferred", where="controller", value=str(error), cure=cure) from error
    return message


@contextmanager
def _own_code_by_value() -> Iterator[None]:
    """In the `with` block, cloudpickle copies the code of the user's modules instead of their names."""
    registered = cloudpickle.list_registry_pickle_by_value()
    own = [module for module in tuple(sys.modules.values()) if _is_own(module) and module.__name__ not in registered]
    for module in own:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in own:
            cloudpickle.unregister_pickle_by_value(module)


def _is_own(module: ModuleType) -> bool:
    """Return True if the module is a file of the user: not installed, not part of Python, not part of smadrive."""
    file = getattr(module, "__file__", None)
    name = getattr(module, "__name__", "")
    if not isinstance(file, str) or sys.modules.get(name) is not module or name.partition(".")[0] in _OURS:
        return False
    return _is_outside_installation(file)


@cache
def _is_outside_installation(file: str) -> bool:
    """Return True if the file of a module is not installed. Cached, because resolving 1000 paths takes 0.3 s."""
    return not str(Path(file).resolve()).startswith(_INSTALLED)
