"""One excitation of the shipped rig in process and the wire identified from it, computed once for all tests."""

import pickle
from pathlib import Path
from typing import NamedTuple

import pytest

from smadrive.identification.wire import WireFit, identify_wire
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.run_log import record_excitation
from smadrive.runs.run_metadata import excitation_record, nominal_balance


class Identified(NamedTuple):
    """The log of the excitation, the wire identified from it, and its file."""

    log: Log
    wire: WireFit
    wire_file: Path


def _identify(folder):
    with Rig(load_rig("in-process")) as rig:
        excitation = rig.excitation(22.0)
        with record_excitation(folder / "excitation.h5", rig, excitation) as recorder:
            rig.excite(excitation, recorder.tick)
    log = read_log(folder / "excitation.h5")
    wire = identify_wire(excitation_record(log), nominal_balance(log))
    (folder / "wire.json").write_text(wire.wire.text())
    (folder / "wire.pickle").write_bytes(pickle.dumps(wire))


@pytest.fixture(scope="session")
def identified(once_per_run):
    folder = once_per_run("identified", _identify)
    wire = pickle.loads((folder / "wire.pickle").read_bytes())  # noqa: S301 (written by this run)
    return Identified(read_log(folder / "excitation.h5"), wire, folder / "wire.json")
