"""On a system without the modules of POSIX, models, fits and logs work, and a rig is refused in one sentence."""

import subprocess
import sys

import pytest

from smadrive.errors import ConfigError
from smadrive.posix import MODULES, MissingModule, check_posix, module_or_missing

ELSEWHERE = """
import importlib, os, pkgutil, signal, subprocess, sys
import h5py, matplotlib, pydantic, pymodbus.pdu, rich.console, scipy.optimize, serial, typer  # of other projects

lacking = ("fcntl", "grp", "pwd", "termios", "tty")
sys.modules.update(dict.fromkeys(lacking))
for module, names in {os: ("uname", "register_at_fork", "geteuid", "getuid", "openpty", "memfd_create",
                           "sched_setscheduler"),
                      signal: ("SIGHUP", "SIGPIPE", "pthread_kill", "SIGSTOP")}.items():
    for name in names:
        delattr(module, name)
"""

IMPORTS = """
import firmware_sim, smadrive
for package in (smadrive, firmware_sim):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        is_of_an_extra = ".tuning.page" in module.name or ".tuning.front" in module.name or ".testing" in module.name
        if not is_of_an_extra and not module.name.endswith(("__main__", "loop_process")):
            importlib.import_module(module.name)
print("imported")
"""

WORK = """
import numpy as np
import smadrive
from smadrive.hysteresis import DuhemModel
from smadrive.cli.parsing.app import command_line

branches = {"mu_heating": 90, "mu_cooling": 69, "sigma_heating": 5, "sigma_cooling": 5}
model = DuhemModel.gaussian(**branches, scale=12, input_range=(20, 140))
turns = [20, 130, 20, 95, 75, 105, 60, 90, 20]
v = np.concatenate([np.linspace(a, b, 100) for a, b in zip(turns[:-1], turns[1:])])
smadrive.identify(v, model.simulate(v), memory=1).save("wire.json")
np.savetxt("in.csv", np.column_stack([np.arange(v.size), v]), delimiter=",", header="time_s,temperature_c", comments="")
sys.argv = ["smadrive", "simulate", "wire.json", "in.csv", "-o", "out.csv"]
command_line("simulate")(standalone_mode=False)
assert smadrive.load_wire("wire.json").model.scale > 0.0
sys.argv = ["smadrive", "report", "heat.h5", "-o", "heat.html"]
command_line("report")(standalone_mode=False)
sys.argv = ["smadrive", "campaign", "reversals", "-o", "folder"]
campaign = lambda: command_line("campaign")(standalone_mode=False)
for open_it in (lambda: smadrive.open_rig("in-process"), lambda: smadrive.rig.rig.Rig(
        smadrive.rig.config.load_rig("in-process")).__enter__(), campaign):
    try:
        open_it()
    except smadrive.errors.ConfigError as error:
        print("refused:", error)
"""


def run(script, folder):
    command = [sys.executable, "-c", ELSEWHERE + script]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_this_system_has_all_modules():
    check_posix()
    assert not any(isinstance(module_or_missing(name), MissingModule) for name in MODULES)


def test_missing_module_raises_where_it_is_used():
    module = module_or_missing("no_such_module_of_python")
    with pytest.raises(ConfigError) as error:
        module.flock(0, 1)
    assert error.value.value == "no no_such_module_of_python.flock"
    assert error.value.cure


@pytest.mark.exhaustive
def test_every_module_can_be_imported_elsewhere(tmp_path):
    done = run(IMPORTS, tmp_path)
    assert (done.returncode, done.stdout.strip()) == (0, "imported"), done.stderr


@pytest.mark.exhaustive
def test_models_work_elsewhere_and_a_rig_is_refused(tmp_path):
    heat = (sys.executable, "-m", "smadrive", "heat", "in-process", "--current", "0.2", "--for", "2")
    subprocess.run(heat, cwd=tmp_path, capture_output=True, check=True)
    done = run(WORK, tmp_path)
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("refused:")]
    assert len(lines) == 3
    assert all("Linux or macOS" in line for line in lines)
    assert all((tmp_path / name).exists() for name in ("out.csv", "heat.html"))
    assert not (tmp_path / "folder").exists()
