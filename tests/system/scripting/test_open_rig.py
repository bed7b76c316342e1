"""A script's rig: measure, excite, identify, track, drive, read again; mistakes are errors of one sentence."""

import importlib
import math
import shutil
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import smadrive
from smadrive.errors import (
    ConfigError,
    ControllerError,
    DataError,
    SafetyError,
    TripError,
)
from smadrive.rig.config import load_rig
from smadrive.runs.log.reader import ENDED_BY
from smadrive.runs.replay import replay
from smadrive.safety.faults import Fault
from smadrive.safety.shutdown import shutdown_of

SINE = smadrive.sine(low_mm=2, high_mm=9, period_s=20, cycles=1)


class Warm:
    """Warms the wire, and remembers what it saw."""

    def __init__(self, action=lambda time_s: None):
        self.action = action
        self.seen = []

    def update(self, time_s, measurement, dt_s):
        self.seen.append(measurement.temperature_c)
        self.action(time_s)
        return smadrive.Command(0.2, setpoint_mm=0.5)


class Hot:
    """Heats as much as the rig allows."""

    duration_s = 60.0

    def update(self, time_s, measurement, dt_s):
        return smadrive.Command(1.0)


class Fussy(Exception):
    """An error that can be pickled, but not restored."""

    def __init__(self, one, other):
        super().__init__(f"{one} and {other}")


class Traceable(Exception):
    """An error of the user's own."""


@pytest.mark.exhaustive
def test_identified_wire_drives_the_rig(rig, wire):
    run = rig.track(SINE, wire, "tracked.h5")
    assert run.rms_percent < 2.0
    assert run.max_percent < 5.0
    assert (run.trips, run.missed_deadlines, run.kind) == (0, 0, "tracking")
    assert run.ticks == run["time_s"].size > 500
    again = smadrive.read_log("tracked.h5")
    assert (again.rms_percent, again.ticks, again.trips) == (run.rms_percent, run.ticks, 0)


@pytest.mark.exhaustive
def test_wire_comes_from_every_form_of_its_record(rig, identified, tmp_path):
    import pandas as pd  # here, because every test process imports this file

    run = smadrive.read_log(shutil.copy(identified.log.path, "excitation.h5"))
    wire = smadrive.identify("excitation.h5")
    assert isinstance(wire, smadrive.IdentifiedWire)
    assert (wire.heat_balance is None, Path(wire.source).name) == (False, "excitation.h5")
    assert wire.fit.rms_percent == identified.wire.hysteresis.rms_percent
    temperature_c, displacement_mm = run["estimated_c"][::4], run["displacement_mm"][::4]
    frame = pd.DataFrame({"temperature_c": temperature_c, "displacement_mm": displacement_mm})
    frame.to_csv(tmp_path / "record.csv", index=False)
    renamed = frame.rename(columns={"displacement_mm": "strain"})
    quick = {"kind": "duhem", "components": 1}  # the form of the data does not depend on the model
    forms = [
        smadrive.identify(frame, **quick),
        smadrive.identify(tmp_path / "record.csv", **quick),
        smadrive.identify(temperature_c, displacement_mm, **quick),
        smadrive.identify(temperature_c.tolist(), displacement_mm.tolist(), **quick),
        smadrive.identify(dict(frame), **quick),
        smadrive.identify(renamed, output="strain", **quick),
        smadrive.identify(run.to_xarray().isel(time_s=slice(None, None, 4)), input="estimated_c", **quick),
    ]
    assert len({form.fit.rms_percent for form in forms}) == 1
    assert all(form.heat_balance is None for form in forms)
    assert dict(run).keys() == set(run)
    assert "units" in run.to_xarray()["displacement_mm"].attrs


@pytest.mark.exhaustive
def test_saved_wire_is_loaded_and_tracks(rig, wire):
    wire.save("wire.json")
    loaded = smadrive.load_wire("wire.json")
    assert loaded.heat_balance == wire.heat_balance
    assert rig.track("sine:low_mm=2,high_mm=9,period_s=20,cycles=1", "wire.json").rms_percent < 2.0
    Path("path.csv").write_text("time_s,displacement_mm\n0,1\n30,4\n")
    assert rig.track(Path("path.csv"), loaded).rms_percent < 2.0


@pytest.mark.exhaustive
def test_runs_wires_and_rigs_show_themselves(rig, wire):
    run = rig.track(SINE, wire)
    for shown in (run, wire, rig, smadrive.load_wire(_saved(wire)), smadrive.read_log("excitation.h5")):
        assert len(shown._repr_html_()) < 30_000
        assert " at 0x" not in repr(shown)
    for figure in (run.plot(), run.plot("heat"), run.plot("loop"), run.plot("timing"), wire.plot()):
        assert len(figure._repr_svg_()) < 250_000
    assert smadrive.load_wire(_saved(wire)).plot().axes
    with pytest.raises(ConfigError, match="Did you mean 'timing'") as refused:
        run.plot("timming")
    assert (refused.value.where, refused.value.value) == ("plot", "timming")


def _saved(wire):
    wire.save("shown.json")
    return "shown.json"


@pytest.mark.exhaustive
def test_logs_without_a_name_are_numbered(rig, wire):
    first, second = (rig.drive(Warm(), wire, duration_s=1).log_file for _ in range(2))
    assert first != second
    assert first.stem.startswith("run")


def test_own_controller_runs_supervised_and_comes_back_with_what_it_saw(rig, wire):
    controller = Warm()
    run = rig.drive(controller, wire, "own.h5", duration_s=5.0)
    assert controller.seen == []
    assert len(run.controller.seen) == run.ticks == 101
    assert run.kind == "own controller"
    assert max(run["commanded_a"]) == 0.2
    assert math.isfinite(run.rms_percent)
    with pytest.raises(DataError, match="a controller of the user ran"):
        replay(run.log)


def test_run_of_a_controller_that_cannot_be_restored_is_complete(rig, wire):
    class Keeps(Warm):
        def update(self, time_s, measurement, dt_s):
            self.action = Fussy("this", "that")
            return smadrive.Command(0.2)

    run = rig.drive(Keeps(), wire, duration_s=0.5)
    assert run.controller is None
    assert run.ticks == 11


MODULE = """
import smadrive
from helper import CURRENT_A

class Edited:
    duration_s = 0.5
    def update(self, time_s, measurement, dt_s):
        return smadrive.Command(CURRENT_A)
"""


def test_reloaded_module_of_the_user_runs_as_it_was_reloaded(rig, wire, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "edited.py").write_text(MODULE)
    for current_a in (0.1, 0.15):
        (tmp_path / "helper.py").write_text(f"CURRENT_A = {current_a}  # {'x' * int(1000 * current_a)}")
        for name in ("helper", "edited"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        run = rig.drive(importlib.import_module("edited").Edited(), wire)
        assert max(run["commanded_a"]) == current_a


@pytest.mark.exhaustive
def test_module_that_cannot_be_copied_travels_by_name(wire, tmp_path, monkeypatch):
    text = MODULE.replace("from helper import CURRENT_A", "import threading\nCURRENT_A = 0.1\nLOCK = threading.Lock()")
    (tmp_path / "locked.py").write_text(text.replace("return", "with LOCK: return"))
    monkeypatch.syspath_prepend(tmp_path)
    controller = importlib.import_module("locked").Edited()
    with smadrive.open_rig("in-process") as opened:  # which searches where the script searches now
        assert opened.drive(controller, wire, tmp_path / "locked.h5").ticks == 11


class Constant:
    """A controller with a constant command."""

    duration_s = 0.5

    def __init__(self, *command):
        self.command = smadrive.Command(*command)

    def update(self, time_s, measurement, dt_s):
        return self.command


def test_current_of_an_own_controller_is_clamped_with_a_caveat(rig, wire):
    limit_a = rig.config.limits.current_max_a
    run = rig.drive(Constant(3.0 * limit_a), wire)
    assert np.nanmax(run["current_a"]) < 1.05 * limit_a
    assert math.isnan(run.rms_percent)
    assert [str(run.ticks) in caveat for caveat in run.caveats] == [True]


def test_negative_current_has_a_caveat(rig, wire):
    (caveat,) = rig.drive(Constant(-0.1), wire).caveats
    assert "negative (lowest -0.1 A)" in caveat


def test_current_in_milliamperes_is_an_error_before_any_heat(rig, wire):
    with pytest.raises(ControllerError) as caught:
        rig.drive(Constant(300.0), wire, "milli.h5")
    assert caught.value.limit == "current_max_a = 0.6 A"
    assert not Path("milli.h5").exists()


def test_setpoint_beyond_the_reach_of_the_wire_has_a_caveat(rig, wire):
    assert len(rig.drive(Constant(0.1, math.nan, 500.0), wire).caveats) == 1
    assert rig.drive(Constant(0.1, math.nan, 5.0), wire).caveats == ()


def raises(error):
    """A controller that raises the error after one second."""

    def act(time_s):
        if time_s > 1.0:
            raise error

    return Warm(act)


def test_error_of_an_own_controller_ends_at_zero_current_with_its_traceback(rig, wire):
    with pytest.raises(ZeroDivisionError) as caught:
        rig.drive(raises(ZeroDivisionError("no zero")), wire, "raised.h5", duration_s=5)
    assert "in act" in str(caught.value.__cause__)
    assert shutdown_of(caught.value).confirmed
    assert "raised.h5" in caught.value.__notes__[-1]
    assert smadrive.read_log("raised.h5").log.ended_by == "ZeroDivisionError: no zero"
    assert not rig.measure().armed


def test_error_class_of_a_script_stays_that_class(rig, wire):
    with pytest.raises(Traceable, match="mine"):
        rig.drive(raises(Traceable("mine")), wire, duration_s=5)


def raise_fussy(time_s):
    raise Fussy("this", "that")


def raise_with_a_lock(time_s):
    raise Traceable(threading.Lock())


@pytest.mark.parametrize(("act", "kind"), [(raise_fussy, Fussy), (raise_with_a_lock, Traceable)])
def test_error_that_cannot_be_transferred_arrives_as_text(rig, wire, act, kind):
    with pytest.raises(ControllerError) as caught:
        rig.drive(Warm(act), wire, duration_s=5)
    assert kind.__name__ in str(caught.value)
    assert "Traceback" in str(caught.value.__cause__)
    assert shutdown_of(caught.value).confirmed


def test_controller_that_returns_nonsense_ends_at_zero_current(rig, wire):
    class Nonsense:
        duration_s = 5.0

        def update(self, time_s, measurement, dt_s):
            return "full power" if time_s > 1.0 else smadrive.Command(0.2)

    with pytest.raises(ControllerError) as caught:
        rig.drive(Nonsense(), wire, "nonsense.h5")
    assert (caught.value.where.split(".")[-1], caught.value.value) == ("Nonsense", "'full power'")
    assert shutdown_of(caught.value).confirmed
    assert smadrive.read_log("nonsense.h5").log.ended_by.startswith("ControllerError")


def test_trip_arrives_with_its_number_and_its_record(wire, tmp_path):
    tight = {"displacement_max_mm": 9.5, "tracking_max_mm": 0.001, "tracking_for_s": 0.1}
    limits = load_rig("in-process").limits.model_copy(update=tight)
    config = load_rig("in-process").model_copy(update={"limits": limits})
    with smadrive.open_rig(config) as rig:
        with pytest.raises(TripError) as caught:
            rig.track(SINE, wire, tmp_path / "tripped.h5")
        assert caught.value.number == Fault.TRACKING_LOST.number
        assert shutdown_of(caught.value).confirmed
        assert caught.value.__cause__ is None
        rig.clear_faults()
        with pytest.raises(TripError) as driven:
            rig.drive(Hot(), wire, tmp_path / "hot.h5")
        assert driven.value.number == Fault.OVER_DISPLACEMENT.number
        assert driven.value.__cause__ is None
        with pytest.raises(SafetyError, match="the last run tripped"):
            rig.track(SINE, wire)
    run = smadrive.read_log(tmp_path / "tripped.h5")
    assert (run.trips, run.kind) == (1, "tracking")
    assert any(event.message.startswith(ENDED_BY) for event in run.log.events)
    assert "ended by" in repr(run)


def test_closed_rig_refuses_and_closes_twice(tmp_path):
    rig = smadrive.open_rig("in-process")
    assert rig.measure().current_a == pytest.approx(0.0, abs=0.01)
    rig.close()
    rig.close()
    assert not rig.is_open
    assert "closed" in repr(rig)
    with pytest.raises(ConfigError, match="the rig is closed") as refused:
        rig.measure()
    assert refused.value.cure == "open it again"
