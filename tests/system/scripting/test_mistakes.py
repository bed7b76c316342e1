"""The mistakes of a script: each is an error of one sentence, and nothing heats."""

import math
import threading
from dataclasses import replace

import pytest

import smadrive
from smadrive.bluesky.sma_wire import SmaWire
from smadrive.errors import (
    ConfigError,
    ControllerError,
    DataError,
    IdentificationError,
    ModelError,
    SmadriveError,
)

SINE = smadrive.sine(low_mm=2, high_mm=9, period_s=20, cycles=1)


class Warm:
    """Warms the wire, and holds something."""

    def __init__(self, held=None):
        self.held = held

    def update(self, time_s, measurement, dt_s):
        return smadrive.Command(0.2)


MISTAKES = [  # name, action, type of the error, its part `where` without folders, its part `value`
    (
        "open",
        lambda rig, wire: smadrive.open_rig("in-proces"),
        ConfigError,
        "'in-proces'",
        "bench-supply, in-process, simulated, tclab",
    ),
    ("open", lambda rig, wire: smadrive.open_rig(3), ConfigError, "rig", "int"),
    ("wire", lambda rig, wire: rig.track(SINE, None), ConfigError, "wire", "NoneType"),
    ("wire", lambda rig, wire: rig.track(SINE, wire.model), ConfigError, "wire", "TSFuzzyDuhem"),
    ("wire", lambda rig, wire: rig.track(SINE, "excitation.h5"), ModelError, "excitation.h5", None),
    ("wire", lambda rig, wire: rig.drive(Warm(), 3, duration_s=1), ConfigError, "wire", "int"),
    ("reference", lambda rig, wire: rig.track([1, 2, 3], wire), ConfigError, "reference", "list"),
    ("reference", lambda rig, wire: rig.track(wire, SINE), ConfigError, "wire", "Reference"),
    ("reference", lambda rig, wire: rig.track("sin:low_mm=2", wire), ConfigError, "reference 'sin:low_mm=2'", None),
    ("reference", lambda rig, wire: rig.track("sine:low_mm=2", wire), ConfigError, "reference 'sine:low_mm=2'", None),
    (
        "reference",
        lambda rig, wire: rig.track(_sine(high_mm=40), wire),
        ConfigError,
        "reference: highest value",
        "40 mm",
    ),
    ("reference", lambda rig, wire: rig.track(_sine(period_s=1), wire), ConfigError, "reference", None),
    ("log", lambda rig, wire: rig.excite(7), ConfigError, "log", "int"),
    ("log", lambda rig, wire: rig.excite("l.csv"), DataError, "l.csv", None),
    ("log", lambda rig, wire: rig.excite("excitation.h5"), DataError, "excitation.h5", None),
    ("log", lambda rig, wire: rig.excite("no/folder/l.h5"), DataError, "l.h5", None),
    ("step", lambda rig, wire: rig.heat(1.0), ConfigError, "step", "none is given"),
    ("step", lambda rig, wire: rig.heat("1", current_a=0.1), ConfigError, "duration_s", "str"),
    ("step", lambda rig, wire: rig.heat(1.0, temperature_c=200.0), ConfigError, "step: temperature", "200 °C"),
    ("repeat", lambda rig, wire: rig.track(SINE, wire, repeat=0), ConfigError, "repeat", "0"),
    ("repeat", lambda rig, wire: rig.track(SINE, wire, repeat=10**6), DataError, "reference", "2e+07 s"),
    ("controller", lambda rig, wire: rig.drive(Warm, wire, duration_s=1), ConfigError, "controller", "Warm"),
    ("controller", lambda rig, wire: rig.drive(Warm(), wire), ConfigError, "duration_s", "Warm"),
    (
        "controller",
        lambda rig, wire: rig.drive(Warm(threading.Lock()), wire, duration_s=1),
        ControllerError,
        "controller",
        "cannot pickle '_thread.lock' object",
    ),
    ("data", lambda rig, wire: smadrive.identify(3), ConfigError, "data", "int"),
    ("data", lambda rig, wire: smadrive.identify([1.0, 2.0]), ConfigError, "data", "list"),
    (
        "data",
        lambda rig, wire: smadrive.identify([1.0, 2.0], [1.0]),
        DataError,
        "temperature_c and displacement_mm",
        "2 and 1",
    ),
    (
        "data",
        lambda rig, wire: smadrive.identify([1.0, 2.0], ["a", "b"]),
        DataError,
        "displacement_mm",
        "could not convert string to float: 'a'",
    ),
    ("data", lambda rig, wire: smadrive.identify([1.0, 2.0], [1.0, 2.0]), IdentificationError, "record", "2"),
    (
        "data",
        lambda rig, wire: smadrive.identify(rig.drive(Warm(), wire, duration_s=1)),
        DataError,
        "run.h5",
        "own controller",
    ),
    (
        "data",
        lambda rig, wire: smadrive.identify(rig.heat(1.0, current_a=0.1, log="warm.h5").log_file),
        DataError,
        "warm.h5",
        "manual step",
    ),
    ("data", lambda rig, wire: smadrive.identify({"temperature": [1.0]}), DataError, "data", None),
    ("data", lambda rig, wire: smadrive.identify("absent.csv"), DataError, "absent.csv", None),
    ("kind", lambda rig, wire: smadrive.identify("excitation.h5", kind="fuzy"), ConfigError, "kind", "'fuzy'"),
    ("sets", lambda rig, wire: smadrive.identify("excitation.h5", sets=2), ConfigError, "sets", "2"),
    ("fit", lambda rig, wire: smadrive.load_wire(_saved(wire)).fit, ConfigError, "saved.json", None),
    (
        "memory",
        lambda rig, wire: smadrive.identify("l.csv", memory=0),
        ConfigError,
        "memory",
        "0",
    ),
    (
        "memory",
        lambda rig, wire: smadrive.identify("l.csv", memory=2),
        ConfigError,
        "memory",
        "2",
    ),
    ("components", lambda rig, wire: smadrive.identify("l.csv", components=3), ConfigError, "components", "3"),
    (
        "components",
        lambda rig, wire: smadrive.identify("l.csv", kind="duhem", components=7),
        ConfigError,
        "components",
        "7",
    ),
    ("sets", lambda rig, wire: smadrive.identify("excitation.h5", sets=-1), ConfigError, "sets", "-1"),
    ("column", lambda rig, wire: smadrive.identify({}, input=3), ConfigError, "input", "int"),
    ("sets", lambda rig, wire: smadrive.identify("l.csv", kind="duhem", sets=7), ConfigError, "sets", "7"),
    ("column", lambda rig, wire: smadrive.identify("excitation.h5", output="b"), ConfigError, "excitation.h5", "b"),
    (
        "column",
        lambda rig, wire: smadrive.identify(smadrive.read_log("excitation.h5"), input="a"),
        ConfigError,
        "excitation.h5",
        "a",
    ),
    ("cool", lambda rig, wire: rig.cool_down("1"), ConfigError, "duration_s", "str"),
    ("cool", lambda rig, wire: rig.cool_down(math.nan), ConfigError, "duration_s", "nan"),
    ("cool", lambda rig, wire: rig.cool_down(-5), ConfigError, "duration_s", "-5.0"),
    ("cool", lambda rig, wire: rig.cool_down(86_401), ConfigError, "duration_s", "86401 s"),
    ("path", lambda rig, wire: smadrive.load_wire(3), ConfigError, "path", "int"),
    ("path", lambda rig, wire: smadrive.read_log(None), ConfigError, "path", "NoneType"),
    ("path", lambda rig, wire: smadrive.read_log("absent.h5"), DataError, "absent.h5", None),
    ("save", lambda rig, wire: wire.save("wire.txt"), DataError, "wire.txt", None),
    ("save", lambda rig, wire: wire.save(3), ConfigError, "path", "int"),
    ("set", lambda rig, wire: SmaWire(rig, wire).set("4"), ConfigError, "displacement_mm", "str"),
    ("check", lambda rig, wire: SmaWire(rig, wire).check_value(None), ConfigError, "displacement_mm", "NoneType"),
    ("column", lambda rig, wire: smadrive.read_log("excitation.h5")["displacement"], DataError, "excitation.h5", None),
]


def _saved(wire):
    wire.save("saved.json")
    return "saved.json"


def _sine(**changed):
    return smadrive.sine(**{"low_mm": 2, "high_mm": 9, "period_s": 20, **changed})


@pytest.mark.parametrize(("act", "kind", "where", "value"), [pytest.param(*case[1:], id=case[0]) for case in MISTAKES])
def test_mistake_is_one_sentence_with_its_parts(rig, wire, act, kind, where, value):
    with pytest.raises(SmadriveError) as caught:
        act(rig, wire)
    assert type(caught.value) is kind
    assert caught.value.where.rpartition("/")[2] == where
    assert value == (None if caught.value.value is None else str(caught.value.value))
    assert caught.value.what
    assert len(str(caught.value).splitlines()) == 1
    assert not rig.measure().armed


@pytest.mark.exhaustive
def test_caveats_of_the_model_are_notes_of_a_reference_that_it_cannot_follow(rig, wire):
    doubtful = replace(wire, caveats=("displacement_mm looks like metres",))
    with pytest.raises(ConfigError) as caught:
        rig.track(_sine(high_mm=40), doubtful)
    assert len(caught.value.__notes__) == 1
    with pytest.raises(ConfigError) as caught:
        rig.track(_sine(period_s=1), doubtful)  # simulated in the loop process
    assert any("metres" in note for note in caught.value.__notes__)
    with pytest.raises(ConfigError) as caught:
        rig.track(_sine(high_mm=40), wire)
    assert not hasattr(caught.value, "__notes__")
