"""The metadata of a log become typed values, also those of a log of version 0.1."""

import json
from pathlib import Path

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.runs.log.reader import ENDED_BY, Log, RunEvent
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import (
    RECORDED,
    excitation_caveats,
    excitation_of,
    excitation_record,
    nominal_balance,
    reference_of,
    rig_config_of,
    wire_of,
)
from smadrive.wire.heat_balance import BalanceSource


@pytest.fixture
def log_of_0_1():
    """A log with metadata that smadrive 0.1 wrote."""
    values = json.loads(Path(__file__).with_name("metadata_0_1.json").read_text())
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}
    return Log(Path("old.h5"), {"time_s": np.arange(3.0)}, texts, (), "", "", "0.1.0")


def test_rig_file_of_0_1_is_understood(log_of_0_1):
    config = rig_config_of(log_of_0_1)
    assert (config.wire, config.rate_hz, config.limits.current_max_a) == ("flexinol-lt-0.15mm", 20.0, 0.6)


def test_heat_balance_of_0_1_is_understood(log_of_0_1):
    balance = nominal_balance(log_of_0_1)
    assert (balance.ambient_c, balance.resistance_cold_ohm) == (22.0, 16.5)
    assert balance.source is BalanceSource.DATA_SHEET


def test_experiments_of_0_1_are_understood(log_of_0_1):
    excitation, reference = excitation_of(log_of_0_1), reference_of(log_of_0_1)
    assert excitation.duration_s == pytest.approx((98 + 80 + 66.5 + 66.5) / 6.0)
    np.testing.assert_array_equal(reference.times_s, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(reference.displacement_mm, [0.0, 0.5, 0.5])


def test_wire_of_0_1_is_understood(log_of_0_1):
    wire = wire_of(log_of_0_1)
    assert wire.model.input_range == (20.0, 130.0)
    assert wire.heat_balance.heat_capacity_j_per_k == pytest.approx(0.0286206)


@pytest.mark.parametrize("change", [{"times_s": [0.0, 2.0, 1.0]}, {"times_s": [0.0, 1.0]}, {"displacement_mm": None}])
def test_invalid_reference_is_refused(log_of_0_1, change):
    reference = json.dumps({**json.loads(log_of_0_1.metadata["reference"]), **change})
    with pytest.raises(DataError) as error:
        reference_of(Log(Path("old.h5"), {}, {"reference": reference}, (), "", "", ""))
    assert error.value.where == "old.h5: reference"


EXCITATION = json.dumps({"turning_points_c": [20.0, 120.0, 20.0], "rate_c_per_s": 1.0})
END_TIME = "2026-01-01T00:00:00+00:00"


def excited(columns, metadata=None, ended_by="", end_time=END_TIME):
    """The log of an excitation of 200 s."""
    events = (RunEvent(0.0, ENDED_BY + ended_by),) if ended_by else ()
    metadata = {"kind": RunKind.EXCITATION, "excitation": EXCITATION, **(metadata or {})}
    return Log(Path("e.h5"), columns, metadata, events, "", end_time, "")


@pytest.mark.parametrize(
    ("ended_s", "end", "caveats"),
    [
        (200.0, {}, 0),
        (197.0, {}, 0),
        (240.0, {}, 0),
        (76.0, {}, 1),
        (76.0, {"ended_by": "interruption: Ctrl-C"}, 1),
        (215.0, {"ended_by": "interruption: Ctrl-C"}, 1),
        (215.0, {"end_time": ""}, 1),
    ],
)
def test_cut_experiment_has_a_caveat(ended_s, end, caveats):
    found = excitation_caveats(excited({"time_s": np.linspace(0.0, ended_s, 100)}, **end))
    assert len(found) == caveats
    assert all(f"{ended_s:.0f} s" in caveat for caveat in found)


@pytest.mark.parametrize("stroke_mm", [12.0, 12_000.0])
@pytest.mark.parametrize("metadata", [{"data_sheet": '{"length_mm": 300.0}'}, {}])
def test_stroke_that_the_wire_cannot_have_is_a_caveat(metadata, stroke_mm):
    columns = {"time_s": np.linspace(0.0, 200.0, 100), "displacement_mm": np.linspace(0.0, stroke_mm, 100)}
    caveats = excitation_caveats(excited(columns, metadata))
    assert [caveat.split(" by ")[0] for caveat in caveats] == ["displacement_mm moves"] * (stroke_mm > 1000.0)


def with_gaps(gaps, name="temperature_c"):
    """The log of an excitation with 1000 samples, of which `gaps` lack a value in the column `name`."""
    columns = {column: np.linspace(0.0, 200.0, 1000) for column in RECORDED}
    columns[name][5 : 5 + gaps] = np.nan
    return excited(columns)


@pytest.mark.parametrize("name", ["temperature_c", "displacement_mm", "voltage_v"])
@pytest.mark.parametrize(("gaps", "caveats"), [(0, 0), (1, 0), (10, 0), (11, 1), (200, 1)])
def test_samples_without_a_value_are_left_out(name, gaps, caveats):
    log = with_gaps(gaps, name)
    record = excitation_record(log)
    assert [column.size for column in vars(record).values()] == [1000 - gaps] * len(RECORDED)
    assert np.isfinite(list(vars(record).values())).all()
    assert len(excitation_caveats(log)) == caveats


@pytest.mark.parametrize("gaps", [201, 995])
def test_record_of_too_few_valid_samples_is_refused(gaps):
    with pytest.raises(DataError) as error:
        excitation_record(with_gaps(gaps))
    assert error.value.where == "e.h5, sample 6, column 'temperature_c'"


@pytest.mark.parametrize("kind", [kind for kind in RunKind if kind is not RunKind.EXCITATION])
def test_log_of_another_experiment_holds_no_record_of_an_excitation(kind):
    with pytest.raises(DataError) as error:
        excitation_record(Log(Path("warm.h5"), {}, {"kind": kind}, (), "", "", ""))
    assert (error.value.where, error.value.value) == ("warm.h5", kind)
    assert error.value.cure


def test_unknown_kind_of_run_is_an_error():
    with pytest.raises(DataError) as error:
        Log(Path("warm.h5"), {}, {"kind": "dance"}, (), "", "", "").kind  # noqa: B018 (the property raises)
    assert (error.value.where, error.value.value) == ("warm.h5", "dance")
