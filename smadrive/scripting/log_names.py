"""The names of new logs. The loop process creates the file after the name is chosen, so a chosen name is in use."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Literal
from weakref import WeakKeyDictionary

from smadrive.files.atomic import check_output, unused_record
from smadrive.files.kinds import LOG
from smadrive.scripting.arguments import PathText, path_text
from smadrive.scripting.rig_connection import RigConnection

_latest: WeakKeyDictionary[RigConnection, Path] = WeakKeyDictionary()
"""The absolute path of the latest log of each rig of this process."""

_mutex = threading.Lock()


def new_log(rig: RigConnection, log: PathText | None, kind: Literal["excitation", "heat", "run", "servo"]) -> Path:
    """Return the path of a new log of `rig`.

    Without `log` this is the first of KIND.h5, KIND-2.h5 and so on that does not exist, and that is not the latest log
    of another open rig. DataError if `log` exists or has a wrong ending.
    """
    with _mutex:
        others = [path for other, path in _latest.items() if other is not rig and other.is_open]
        path = unused_record(kind, LOG, others) if log is None else _checked(log)
        _latest[rig] = path.absolute()
    return path


def _checked(log: PathText) -> Path:
    path = Path(path_text(log, "log", "the path of a file to write, such as 'run.h5'"))
    check_output(path, LOG)
    return path
