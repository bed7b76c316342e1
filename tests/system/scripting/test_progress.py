"""The progress of a script's run: a line in a terminal, a bar in a notebook; an interrupted kernel ends the run."""

import re
import sys
from math import inf, nan

import programs
import pytest
from brief_rig import brief_rig
from jupyter_client.manager import start_new_kernel

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.runs.log.reader import read_log
from smadrive.scripting.loop.messages import RunProgress
from smadrive.scripting.progress import is_notebook, progress_text, share_done

EXCITE = "import smadrive\nwith smadrive.open_rig({rig!r}) as rig: rig.excite()"
HEAT = """
import smadrive

class Warm:
    duration_s = float("inf")

    def update(self, time_s, measurement, dt_s):
        return smadrive.Command(0.2)

rig = smadrive.open_rig("in-process")
wire = smadrive.load_wire({wire!r})
rig.drive(Warm(), wire, {log!r})
"""
CURRENT = re.compile(r"([\d.]+) A<")
HANG_GUARD_S = 300


def progress_at(time_s, duration_s):
    measurement = Measurement(time_s, 54.32, 0.2, 3.0)
    return RunProgress(Tick(time_s, 0.0, measurement, Command(0.2)), duration_s)


@pytest.mark.parametrize(
    ("time_s", "duration_s", "share", "text"),
    [
        (5.0, 20.0, 0.25, "tracking: 5.0 of 20.0 s · 54.3 °C · – · 0.200 A"),
        (20.01, 20.0, 1.0, "tracking: 20.0 of 20.0 s · 54.3 °C · – · 0.200 A"),
        (5.0, inf, 0.0, "tracking: 5.0 s · 54.3 °C · – · 0.200 A"),
    ],
)
def test_progress_names_time_and_values(time_s, duration_s, share, text):
    progress = progress_at(time_s, duration_s)
    assert share_done(progress) == share
    assert progress_text("tracking", progress) == text
    assert str(nan) not in text


@pytest.mark.exhaustive
def test_terminal_shows_a_line_that_vanishes(tmp_path):
    text = programs.run_on_terminal([sys.executable, "-c", EXCITE.format(rig=brief_rig(tmp_path))], tmp_path)
    assert "exciting, excitation.h5: " in text
    assert re.search(r"of \d+\.\d s · \d+\.\d °C", text)
    assert "━" in text
    assert text.rstrip().endswith("\x1b[2K")


@pytest.mark.exhaustive
def test_script_without_a_terminal_prints_nothing(tmp_path):
    command = [sys.executable, "-c", EXCITE.format(rig=brief_rig(tmp_path))]
    done = programs.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.fixture
def kernel(tmp_path):
    manager, client = start_new_kernel(kernel_name="python3", cwd=str(tmp_path))
    yield manager, client
    client.stop_channels()
    manager.shutdown_kernel()
    manager.cleanup_resources()


@pytest.mark.exhaustive
def test_interrupted_kernel_ends_the_run_confirmed(kernel, identified, tmp_path):
    manager, client = kernel
    log = tmp_path / "run.h5"
    client.execute(HEAT.format(wire=str(identified.wire_file), log=str(log)))
    shown, error = [], None
    while error is None:
        message = client.get_iopub_msg(timeout=HANG_GUARD_S)
        content = message["content"]
        if message["msg_type"] in {"display_data", "update_display_data"}:
            shown.append(content["data"]["text/html"])
            if len(shown) == 3:
                assert float(CURRENT.search(shown[-1])[1]) == pytest.approx(0.2, abs=0.01)  # measured, with noise
                manager.interrupt_kernel()
        elif message["msg_type"] == "error":
            error = content
    while content.get("execution_state") != "idle":  # an earlier request would be aborted with this one
        content = client.get_iopub_msg(timeout=HANG_GUARD_S)["content"]
    assert error["ename"] == "KeyboardInterrupt"
    assert any("confirmed" in line or "run.h5" in line for line in error["traceback"])
    assert "<progress" in shown[0]
    assert "driving, run.h5: ended" in shown[-1]
    assert read_log(log).ended_by.startswith("interruption")
    reply = client.execute("print(rig.measure().armed); rig.close()", reply=True, timeout=HANG_GUARD_S)
    assert reply["content"]["status"] == "ok"


def test_test_is_no_notebook():
    assert not is_notebook()
