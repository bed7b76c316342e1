"""Code that travels to the loop process keeps the name of its file, and the lines of a notebook's cell."""

import linecache
import pickle
import traceback

from smadrive.scripting.loop.code_origin import dumps
from smadrive.scripting.loop.transfer import pickled

CELL = "<cell 7>"
SOURCE = """
class Broken:
    def update(self, time_s, measurement, dt_s):
        return 1 / 0
"""


def traceback_of(controller):
    try:
        controller.update(0.0, None, 0.05)
    except ZeroDivisionError as error:
        return "".join(traceback.format_exception(error))


def test_traceback_shows_the_line_of_a_cell(monkeypatch):
    space = {"__name__": "__main__"}
    exec(compile(SOURCE, CELL, "exec"), space)  # noqa: S102
    monkeypatch.setitem(linecache.cache, CELL, (len(SOURCE), None, SOURCE.splitlines(keepends=True), CELL))
    message = dumps(space["Broken"]())
    del linecache.cache[CELL]
    text = traceback_of(pickle.loads(message))  # noqa: S301
    assert f'File "{CELL}", line 4, in update' in text
    assert "return 1 / 0" in text
    linecache.cache.pop(CELL)


def test_traceback_names_the_module_of_the_user(tmp_path, monkeypatch):
    path = tmp_path / "own_module.py"
    path.write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    import own_module

    text = traceback_of(pickle.loads(pickled(own_module.Broken())))  # noqa: S301
    assert f'File "{path}", line 4, in update' in text
    assert "return 1 / 0" in text
