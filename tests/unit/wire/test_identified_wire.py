"""A wire's file: model, heat balance and caveats come back, or the file is rejected."""

import json
from dataclasses import replace

import pytest

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel
from smadrive.wire.heat_balance import BalanceSource, HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.identified_wire import IdentifiedWire, load_wire, parse_wire

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=70, sigma_heating=5, sigma_cooling=5, scale=10, input_range=(0, 200)
)
BALANCE = HeatBalance(0.02, 0.01, 0.1, 22.0, 10.0, 0.1, 0.1)
WIRE = IdentifiedWire(MODEL, BALANCE, metrics={"rms_percent": 0.3}, source="a test")
RESISTANCE = WireResistance(70.0, 10.3, 0.006, 0.04, 0.004, 0.001, 0.01, (20.0, 80.0, 140.0), (11.2, 11.5, 11.8))


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "wire.json"
    WIRE.save(path)
    return path


def change(path, **values):
    """Write other values into the document of the file."""
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def change_balance(path, **values):
    document = json.loads(path.read_text())
    document["provenance"]["heat_balance"] |= values
    path.write_text(json.dumps(document))


def test_heat_balance_comes_back(path):
    assert load_wire(path).heat_balance == BALANCE


def test_byte_order_mark_is_accepted(path):
    path.write_text("\ufeff" + path.read_text())
    assert load_wire(path).heat_balance == BALANCE


def test_file_keeps_origin_and_metrics(path):
    provenance = json.loads(path.read_text())["provenance"]
    assert (provenance["source"], provenance["rms_percent"]) == ("a test", 0.3)
    assert load_wire(path).metrics["rms_percent"] == 0.3


@pytest.mark.parametrize("source", BalanceSource)
def test_source_of_the_heat_balance_comes_back(path, source):
    balance = replace(BALANCE, source=source)
    wire = replace(WIRE, heat_balance=balance)
    wire.save(path)
    assert load_wire(path).heat_balance == balance
    assert parse_wire(wire.text(), "a log").heat_balance == balance


def test_noise_of_an_older_file_is_not_measured(path):
    document = json.loads(path.read_text())
    del document["provenance"]["heat_balance"]["thermocouple_noise_c"]
    path.write_text(json.dumps(document))
    assert load_wire(path).heat_balance.thermocouple_noise_c == 0.0


def test_heat_balance_without_a_source_counts_as_identified(path):
    document = json.loads(path.read_text())
    del document["provenance"]["heat_balance"]["source"]
    path.write_text(json.dumps(document))
    assert load_wire(path).heat_balance.source is BalanceSource.IDENTIFIED


@pytest.mark.parametrize("source", ["guessed", 1, None])
def test_unknown_source_is_rejected(path, source):
    change_balance(path, source=source)
    with pytest.raises(ModelError) as error:
        load_wire(path)
    assert error.value.where.startswith(str(path))
    assert error.value.value == repr(source)


def test_wire_without_heat_balance_is_loaded_but_has_no_wire_model(path):
    IdentifiedWire(MODEL).save(path)
    wire = load_wire(path)
    assert wire.heat_balance is None
    with pytest.raises(ModelError) as error:
        wire.wire_model()
    assert error.value.where == str(path)


def test_wire_model_steps_the_loaded_wire(path):
    wire = load_wire(path)
    assert wire.wire_model().balance == BALANCE
    assert wire.wire_model().model is wire.model


def test_caveats_come_back(path):
    assert load_wire(path).caveats == ()
    IdentifiedWire(MODEL, caveats=("it misses its record", "it guesses")).save(path)
    assert load_wire(path).caveats == ("it misses its record", "it guesses")


def test_model_file_without_provenance_gives_a_model_alone(path):
    document = json.loads(path.read_text())
    del document["provenance"]
    path.write_text(json.dumps(document))
    wire = load_wire(path)
    assert (wire.heat_balance, wire.caveats) == (None, ())


@pytest.mark.parametrize("caveats", ["it guesses", [1.0], None])
def test_caveats_of_another_shape_are_rejected(path, caveats):
    provenance = json.loads(path.read_text())["provenance"]
    change(path, provenance=provenance | {"caveats": caveats})
    with pytest.raises(ModelError) as error:
        load_wire(path)
    assert error.value.where == f"{path}: provenance: caveats"


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"ambient_c": "22"}, "provenance: heat_balance: ambient_c"),
        ({"ambient_c": float("nan")}, "provenance: heat_balance: ambient_c"),
        ({"ambient_c": None}, "provenance: heat_balance: ambient_c"),
        ({"loss_w_per_k": True}, "provenance: heat_balance: loss_w_per_k"),
        ({"loss_w_per_k": -1.0}, "heat balance: loss_w_per_k"),
        ({"thermocouple_noise_c": 1e9}, "heat balance: thermocouple_noise_c"),
        ({"colour": 1.0}, "provenance: heat_balance: colour"),
    ],
)
def test_wrong_parameter_is_rejected_by_its_key(path, values, key):
    change_balance(path, **values)
    for read in (load_wire, lambda path: parse_wire(path.read_text(), str(path))):
        with pytest.raises(ModelError) as error:
            read(path)
        assert error.value.where == f"{path}: {key}"


@pytest.mark.parametrize("provenance", [None, [], "a test", {"heat_balance": 3}])
def test_provenance_of_another_shape_is_rejected(path, provenance):
    change(path, provenance=provenance)
    with pytest.raises(ModelError) as error:
        load_wire(path)
    assert error.value.where.startswith(f"{path}: provenance")


def test_resistance_is_kept_in_file_and_log(tmp_path):
    wire = replace(WIRE, resistance=RESISTANCE)
    wire.save(tmp_path / "wire.json")
    assert load_wire(tmp_path / "wire.json").resistance == RESISTANCE
    assert parse_wire(wire.text(), "log").resistance == RESISTANCE
    assert wire.wire_model().resistance == RESISTANCE


def test_wire_with_one_metric_is_shown(path):
    IdentifiedWire(MODEL, metrics={"max_percent": 1.0}).save(path)
    assert "fit" not in repr(load_wire(path))


def test_file_of_version_2_has_no_resistance(tmp_path):
    path = tmp_path / "wire.json"
    WIRE.save(path)
    document = json.loads(path.read_text())
    document["schema"] = 2
    path.write_text(json.dumps(document))
    assert load_wire(path).resistance is None


@pytest.mark.parametrize(
    ("key", "value"),
    [("strain", 3.0), ("nodes_c", [1.0]), ("noise_v", None), ("austenite_ohm", [1.0, 1.0, 1.0])],
)
def test_wrong_resistance_in_a_file_is_named(tmp_path, key, value):
    path = tmp_path / "wire.json"
    replace(WIRE, resistance=RESISTANCE).save(path)
    document = json.loads(path.read_text())
    document["provenance"]["resistance"][key] = value
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError) as raised:
        load_wire(path)
    assert str(path) in raised.value.where
    assert key in raised.value.where


@pytest.mark.parametrize(("strain", "austenite_ohm"), [(0.0, (9.9, 10.1, 10.3)), (0.15, (13.4, 13.8, 14.2))])
def test_change_of_another_wire_is_refused(tmp_path, strain, austenite_ohm):
    """The resistance of the heat balance rises by 10 % over the stroke."""
    path = tmp_path / "wire.json"
    falling = replace(RESISTANCE, strain=strain, austenite_ohm=austenite_ohm)
    replace(WIRE, resistance=falling).save(path)
    with pytest.raises(ModelError) as raised:
        load_wire(path)
    assert raised.value.where.startswith(f"{path}: resistance")


@pytest.mark.parametrize("factor", [1e-3, 0.6, 1.5])
def test_resistance_of_another_wire_is_refused(tmp_path, factor):
    path = tmp_path / "wire.json"
    ohms = {
        "martensite_ohm": factor * RESISTANCE.martensite_ohm,
        "martensite_ohm_per_k": factor * RESISTANCE.martensite_ohm_per_k,
        "austenite_ohm": tuple(factor * ohm for ohm in RESISTANCE.austenite_ohm),
    }
    replace(WIRE, resistance=replace(RESISTANCE, **ohms)).save(path)
    with pytest.raises(ModelError) as raised:
        load_wire(path)
    assert raised.value.where.startswith(f"{path}: resistance")
