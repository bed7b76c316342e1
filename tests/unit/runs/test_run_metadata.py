"""The metadata of a log become typed values, also those of a log of version 0.1."""

import json
from pathlib import Path

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.runs.log.reader import Log
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import (
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


@pytest.mark.parametrize(("ended_s", "expected"), [(200.0, ()), (197.0, ()), (76.0, ("ended after 76 of its 200 s",))])
def test_cut_experiment_has_a_caveat(ended_s, expected):
    metadata = {"excitation": json.dumps({"turning_points_c": [20.0, 120.0, 20.0], "rate_c_per_s": 1.0})}
    columns = {"time_s": np.linspace(0.0, ended_s, 100)}
    caveats = excitation_caveats(Log(Path("e.h5"), columns, metadata, (), "", "", ""))
    assert len(caveats) == len(expected)
    assert all(part in caveat for part, caveat in zip(expected, caveats, strict=True))


@pytest.mark.parametrize("stroke_mm", [12.0, 12_000.0])
@pytest.mark.parametrize("metadata", [{"data_sheet": '{"length_mm": 300.0}'}, {}])
def test_stroke_that_the_wire_cannot_have_is_a_caveat(metadata, stroke_mm):
    excitation = json.dumps({"turning_points_c": [20.0, 120.0, 20.0], "rate_c_per_s": 1.0})
    columns = {"time_s": np.linspace(0.0, 200.0, 100), "displacement_mm": np.linspace(0.0, stroke_mm, 100)}
    caveats = excitation_caveats(Log(Path("e.h5"), columns, {"excitation": excitation, **metadata}, (), "", "", ""))
    assert [caveat.split(" by ")[0] for caveat in caveats] == ["displacement_mm moves"] * (stroke_mm > 1000.0)


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
