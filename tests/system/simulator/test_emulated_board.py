"""The program of the microcontroller behind a pseudo-terminal and under the commands of smadrive."""

import json
import re
import shutil
import subprocess
import sys

import programs
import pytest
from emulated_board import needs_emulator
from served import served

from smadrive.files.shipped import configs_dir

pytestmark = needs_emulator
SIM = "flexinol-lt-0.15mm"
REFERENCE = "sine:low_mm=2.3,high_mm=9.7,period_s=56,cycles=2"
"""The reference of the demo."""


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="needs mbpoll (Debian package mbpoll)")
def test_mbpoll_reads_and_writes_the_emulated_board():
    with served("--board", "atmega328p") as (_, url):
        mbpoll = ["mbpoll", "-a1", "-0", "-1", "-m", "rtu", "-b115200", "-Pnone", "-o2", "-r48"]
        line = url.removeprefix("serial://")
        subprocess.run([*mbpoll, line, "700", "900", "4000"], check=True, capture_output=True)
        output = subprocess.run([*mbpoll, "-c3", line], check=True, capture_output=True, text=True).stdout
    assert re.findall(r"\[\d+\]:\s+(\d+)", output) == ["700", "900", "4000"]


@pytest.fixture
def rig(tmp_path):
    """The shipped in-process rig, with the emulated board."""
    sim = tmp_path / "sim.toml"
    text = (configs_dir() / "sims" / f"{SIM}.toml").read_text()
    sim.write_text(text.replace("[board]\n", '[board]\nimplementation = "atmega328p"\nserial_number = 5\n'))
    path = tmp_path / "rig.toml"
    path.write_text((configs_dir() / "rigs" / "in-process.toml").read_text().replace(f"sim://{SIM}", f"sim://{sim}"))
    return path


def smadrive(rig, command, *arguments):
    """Run a command in the folder of the rig, and return its JSON object."""
    line = [sys.executable, "-m", "smadrive", command, *map(str, arguments), "--json"]
    done = programs.run(line, cwd=rig.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.exhaustive
def test_wire_is_identified_and_tracked_as_in_the_demo(rig):
    assert smadrive(rig, "probe", rig)["temperature_c"] == pytest.approx(22.0, abs=1.0)
    smadrive(rig, "excite", rig, "-o", "excitation.h5")
    smadrive(rig, "identify", "excitation.h5", "-o", "model.json")
    run = smadrive(rig, "run", rig, "--model", "model.json", "--reference", REFERENCE, "-o", "run.h5")
    assert 0.0 < run["rms_percent"] <= 0.5
    assert (run["trips"], run["missed_deadlines"]) == (0, 0)
    assert smadrive(rig, "off", rig)["safe"] is True


@pytest.mark.exhaustive
def test_board_is_checked_and_calibrated(rig):
    smadrive(rig, "heat", rig, "--current", 0.2, "--for", 5, "-o", "held.h5")
    held = ("--log", "held.h5", "--current", 0.19, "--voltage", 3.2)
    with served("--board", "atmega328p", sim=str(rig.with_name("sim.toml"))) as (_, url):
        port = url.removeprefix("serial://")
        checks = smadrive(rig, "board", "check", port)["checks"]
        first = smadrive(rig, "board", "calibrate", port, *held)
        again = smadrive(rig, "board", "calibrate", port, *held)
    assert {one["verdict"] for one in checks} <= {"passed", "not checked"}
    assert first["source_gain"] == pytest.approx(0.2 / 0.19, rel=0.01)
    assert again == first
