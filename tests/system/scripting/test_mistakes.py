"""The mistakes of a script: each is an error of one sentence, and nothing heats."""

import threading
from dataclasses import replace

import pytest

import smadrive
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


MISTAKES = [
    ("open", lambda rig, wire: smadrive.open_rig("in-proces"), ConfigError, "in-process"),
    ("open", lambda rig, wire: smadrive.open_rig(3), ConfigError, "rig: of the wrong type (int)"),
    ("wire", lambda rig, wire: rig.track(SINE, None), ConfigError, "wire: of the wrong type (NoneType)"),
    ("wire", lambda rig, wire: rig.track(SINE, wire.model), ConfigError, "wire: of the wrong type (TSFuzzyDuhem)"),
    ("wire", lambda rig, wire: rig.track(SINE, "excitation.h5"), ModelError, "is a log"),
    ("wire", lambda rig, wire: rig.drive(Warm(), 3, duration_s=1), ConfigError, "wire: of the wrong type (int)"),
    ("reference", lambda rig, wire: rig.track([1, 2, 3], wire), ConfigError, "reference: of the wrong type (list)"),
    ("reference", lambda rig, wire: rig.track(wire, SINE), ConfigError, "of the wrong type"),
    ("reference", lambda rig, wire: rig.track("sin:low_mm=2", wire), ConfigError, "Did you mean 'sine'?"),
    ("reference", lambda rig, wire: rig.track("sine:low_mm=2", wire), ConfigError, "missing: high_mm, period_s"),
    ("reference", lambda rig, wire: rig.track(_sine(high_mm=40), wire), ConfigError, "outside the travel"),
    ("reference", lambda rig, wire: rig.track(_sine(period_s=1), wire), ConfigError, "cools no faster"),
    ("reference", lambda rig, wire: rig.track(_sine(period_s=1), wire), ConfigError, "can follow (smooth=True)"),
    ("log", lambda rig, wire: rig.excite(7), ConfigError, "log: of the wrong type (int)"),
    ("log", lambda rig, wire: rig.excite("l.csv"), DataError, "the name of a log ends in .h5"),
    ("log", lambda rig, wire: rig.excite("excitation.h5"), DataError, "a record is never overwritten"),
    ("log", lambda rig, wire: rig.excite("no/folder/l.h5"), DataError, "cannot be written"),
    ("step", lambda rig, wire: rig.heat(1.0), ConfigError, "step: needs exactly one"),
    ("step", lambda rig, wire: rig.heat("1", current_a=0.1), ConfigError, "duration_s: of the wrong type (str)"),
    ("step", lambda rig, wire: rig.heat(1.0, temperature_c=200.0), ConfigError, "step: temperature: too hot"),
    ("repeat", lambda rig, wire: rig.track(SINE, wire, repeat=0), ConfigError, "repeat: not a number of cycles (0"),
    ("repeat", lambda rig, wire: rig.track(SINE, wire, repeat=10**6), DataError, "too long"),
    ("controller", lambda rig, wire: rig.drive(Warm, wire, duration_s=1), ConfigError, "a class, not an object"),
    ("controller", lambda rig, wire: rig.drive(Warm(), wire), ConfigError, "the length of the run is unknown"),
    (
        "controller",
        lambda rig, wire: rig.drive(Warm(threading.Lock()), wire, duration_s=1),
        ControllerError,
        "transferred",
    ),
    ("data", lambda rig, wire: smadrive.identify(3), ConfigError, "data: no record (int)"),
    ("data", lambda rig, wire: smadrive.identify([1.0, 2.0]), ConfigError, "data: no record (list)"),
    ("data", lambda rig, wire: smadrive.identify([1.0, 2.0], [1.0]), DataError, "different numbers of samples"),
    ("data", lambda rig, wire: smadrive.identify([1.0, 2.0], ["a", "b"]), DataError, "not numbers"),
    ("data", lambda rig, wire: smadrive.identify([1.0, 2.0], [1.0, 2.0]), IdentificationError, "too few samples (2"),
    ("data", lambda rig, wire: smadrive.identify(rig.drive(Warm(), wire, duration_s=1)), DataError, "not the log of"),
    (
        "data",
        lambda rig, wire: smadrive.identify(rig.heat(1.0, current_a=0.1, log="warm.h5").log_file),
        DataError,
        "warm.h5: not the log of an excitation (manual step)",
    ),
    ("data", lambda rig, wire: smadrive.identify({"temperature": [1.0]}), DataError, "no column 'temperature_c'"),
    ("data", lambda rig, wire: smadrive.identify("absent.csv"), DataError, "no such file"),
    ("kind", lambda rig, wire: smadrive.identify("excitation.h5", kind="fuzy"), ConfigError, "kind: unknown ('fuzy')"),
    ("sets", lambda rig, wire: smadrive.identify("excitation.h5", sets=2), ConfigError, "sets: not a number of fuzzy"),
    ("fit", lambda rig, wire: smadrive.load_wire(_saved(wire)).fit, ConfigError, "a wire from a file has no fit"),
    (
        "memory",
        lambda rig, wire: smadrive.identify("l.csv", memory=0),
        ConfigError,
        "limit 1 for no memory, or 4 to 40",
    ),
    (
        "memory",
        lambda rig, wire: smadrive.identify("l.csv", memory=2),
        ConfigError,
        "limit 1 for no memory, or 4 to 40",
    ),
    ("components", lambda rig, wire: smadrive.identify("l.csv", components=3), ConfigError, 'kind="duhem"'),
    ("components", lambda rig, wire: smadrive.identify("l.csv", kind="duhem", components=7), ConfigError, "1 to 6"),
    ("sets", lambda rig, wire: smadrive.identify("excitation.h5", sets=-1), ConfigError, "Pass a whole number"),
    ("column", lambda rig, wire: smadrive.identify({}, input=3), ConfigError, "input: of the wrong type (int)"),
    ("sets", lambda rig, wire: smadrive.identify("l.csv", kind="duhem", sets=7), ConfigError, "sets: only a T-S fuzzy"),
    ("column", lambda rig, wire: smadrive.identify("excitation.h5", output="b"), ConfigError, "cannot be chosen (b"),
    (
        "column",
        lambda rig, wire: smadrive.identify(smadrive.read_log("excitation.h5"), input="a"),
        ConfigError,
        "cannot be chosen (a",
    ),
    ("cool", lambda rig, wire: rig.cool_down("1"), ConfigError, "duration_s: of the wrong type (str)"),
    ("path", lambda rig, wire: smadrive.load_wire(3), ConfigError, "path: of the wrong type (int)"),
    ("path", lambda rig, wire: smadrive.read_log(None), ConfigError, "path: of the wrong type (NoneType)"),
    ("path", lambda rig, wire: smadrive.read_log("absent.h5"), DataError, "no such file"),
    ("save", lambda rig, wire: wire.save("wire.txt"), DataError, "the name of a model file ends in .json"),
    ("column", lambda rig, wire: smadrive.read_log("excitation.h5")["displacement"], DataError, "displacement_mm"),
]


def _saved(wire):
    wire.save("saved.json")
    return "saved.json"


def _sine(**changed):
    return smadrive.sine(**{"low_mm": 2, "high_mm": 9, "period_s": 20, **changed})


@pytest.mark.parametrize(("act", "kind", "text"), [pytest.param(*case[1:], id=case[0]) for case in MISTAKES])
def test_mistake_is_one_sentence_with_its_parts(rig, wire, act, kind, text):
    with pytest.raises(SmadriveError) as caught:
        act(rig, wire)
    assert type(caught.value) is kind
    assert text in str(caught.value)
    assert caught.value.what
    assert len(str(caught.value).splitlines()) == 1
    assert not rig.measure().armed


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
