"""A forked child of a script cannot use the rig, and has no effect on the rig of its parent."""

import subprocess
import sys
from pathlib import Path

import programs
import pytest

RIG = Path(__file__).parents[3] / "configs" / "rigs" / "in-process.toml"

SAID = """
import os, signal, sys
import smadrive
from smadrive.errors import ConfigError

def said(call):
    try:
        return repr(call())
    except ConfigError as error:
        return f"{error.where}: {error.value}"
"""

FORKS = """
parent = os.getpid()
with smadrive.open_rig(sys.argv[1]) as rig:
    child = os.fork()
    if child == 0:
        signal.alarm(60)  # ends a child that waits for a reply
        for call in (rig.measure, rig.off, rig.clear_faults, lambda: rig.cool_down(1.0), rig.close):
            print(said(call) == f"rig: opened in process {parent}", flush=True)
        if sys.argv[2] == "exits":
            sys.exit(0)
        if sys.argv[2] == "fails":
            raise ConfigError("fails")
    else:
        print("child ended with", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
        print("armed:", rig.measure().armed, flush=True)
        rig.off()
if os.getpid() == parent:
    print("closed:", not rig.is_open, flush=True)
"""

SERVES = """
parent = os.getpid()
with smadrive.open_rig(sys.argv[1]) as rig:
    with rig.servo(sys.argv[2], "servo.h5") as servo:
        servo.sample().wait()
        motion = servo.move(2.0)
        child = os.fork()
        if child == 0:
            signal.alarm(60)
            calls = (servo.sample, servo.stop, lambda: servo.move(1.0), lambda: servo.measurement, motion.wait)
            for call in calls:
                print(said(call) == f"rig: opened in process {parent}", flush=True)
            sys.exit(0)
        print("child ended with", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
        servo.move(3.0).wait()
    print("ticks:", servo.run.ticks > 0, flush=True)
"""


def printed_by(script, *arguments, cwd):
    done = programs.run(
        [sys.executable, "-c", SAID + script, str(RIG), *map(str, arguments)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        text=True,
    )
    return done.stdout.splitlines()


@pytest.mark.exhaustive
@pytest.mark.parametrize(("how", "code"), [("exits", 0), ("leaves", 0), ("fails", 1)])
def test_forked_child_cannot_use_the_rig_and_leaves_it_open(tmp_path, how, code):
    said = printed_by(FORKS, how, cwd=tmp_path)
    assert said == ["True"] * 5 + [f"child ended with {code}", "armed: False", "closed: True"]


@pytest.mark.exhaustive
def test_forked_child_cannot_use_the_servo_and_leaves_it_running(identified, tmp_path):
    said = printed_by(SERVES, identified.wire_file, cwd=tmp_path)
    assert said == ["True"] * 5 + ["child ended with 0", "ticks: True"]
