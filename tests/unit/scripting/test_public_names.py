"""`import smadrive`: its names are there, are typed, and cost nothing until they are used."""

import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest

import smadrive

CONTRACT = {
    *("open_rig", "identify", "load_wire", "read_log", "Command", "Measurement", "__version__"),
    *("sine", "triangle", "trapezoid", "steps", "staircase", "chirp"),
}
HEAVY = ("numpy", "scipy", "h5py", "matplotlib", "pydantic", "rich")

SCRIPT = """
import smadrive
from smadrive import Command, IdentifiedWire, Measurement, OpenRig, Reference, Run

class Warm:
    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        return Command(0.2 if measurement.temperature_c < 60 else 0.0)

class Wrong:
    def update(self) -> None: ...

with smadrive.open_rig("in-process") as rig:
    opened: OpenRig = rig
    excited: Run = rig.excite()
    wire: IdentifiedWire = smadrive.identify(excited)
    reference: Reference = smadrive.sine(low_mm=2, high_mm=9, period_s=56)
    error: float = rig.track(reference, wire).rms_percent
    rig.drive(Warm(), wire, duration_s=5)
    rig.drive(Wrong(), wire, duration_s=5)  # line 19
version: str = smadrive.__version__
smadrive.opne_rig("in-process")  # line 21
"""


def test_names_of_the_contract_are_public():
    assert set(smadrive.__all__) >= CONTRACT
    assert set(dir(smadrive)) >= set(smadrive.__all__)


@pytest.mark.parametrize("name", smadrive.__all__)
def test_name_is_there(name):
    assert getattr(smadrive, name) is not None


def test_version_is_that_of_the_package():
    assert smadrive.__version__ == importlib.metadata.version("smadrive")


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'opne_rig'"):
        smadrive.opne_rig  # noqa: B018


def test_import_alone_loads_nothing_heavy():
    program = f"import sys, smadrive; dir(smadrive); print(*(set({HEAVY!r}) & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.exhaustive
def test_a_strict_type_checker_sees_the_names(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir", str(tmp_path), "script.py"]
    environment = {"PATH": "", "MYPYPATH": str(Path(smadrive.__file__).parents[1])}
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=environment)
    lines = [line for line in done.stdout.splitlines() if line.startswith("script.py") and ": error:" in line]
    assert [line.split(":")[1] for line in lines] == ["19", "21"], done.stdout
