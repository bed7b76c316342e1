"""What the provenance of a model tells of the wire: all of it, or a refusal."""

import json
from dataclasses import replace

import pytest

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel
from smadrive.wire.heat_balance import BalanceSource, HeatBalance
from smadrive.wire.wire_file import load_wire_file, parse_wire, save_wire, wire_text

WIRE = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=70, sigma_heating=5, sigma_cooling=5, scale=10, input_range=(0, 200)
)
BALANCE = HeatBalance(0.02, 0.01, 0.1, 22.0, 10.0, 0.1, 0.1)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "wire.json"
    save_wire(path, WIRE, BALANCE, {}, source="a test")
    return path


def test_it_comes_back(path):
    assert load_wire_file(path).balance == BALANCE
    path.write_text("\ufeff" + path.read_text())
    assert load_wire_file(path).balance == BALANCE


@pytest.mark.parametrize("source", BalanceSource)
def test_the_source_of_the_balance_comes_back(path, source):
    balance = replace(BALANCE, source=source)
    save_wire(path, WIRE, balance, {}, source="a test")
    assert load_wire_file(path).balance == balance
    assert parse_wire(wire_text(WIRE, balance), "a log")[1] == balance


def test_a_balance_without_a_source_was_identified(path):
    document = json.loads(path.read_text())
    del document["provenance"]["heat_balance"]["source"]
    path.write_text(json.dumps(document))
    assert load_wire_file(path).balance.source is BalanceSource.IDENTIFIED


@pytest.mark.parametrize("source", ["guessed", 1, None])
def test_an_unknown_source_is_refused(path, source):
    document = json.loads(path.read_text())
    document["provenance"]["heat_balance"]["source"] = source
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError):
        load_wire_file(path)


def test_a_model_may_have_none(path):
    save_wire(path, WIRE, None, {}, source="a test")
    assert load_wire_file(path).balance is None


def test_what_lets_doubt_a_model_comes_back_with_it(path):
    assert load_wire_file(path).caveats == ()
    save_wire(path, WIRE, None, {}, source="a test", caveats=("it misses its record", "it guesses"))
    assert load_wire_file(path).caveats == ("it misses its record", "it guesses")


def test_a_model_file_without_a_provenance_tells_a_model_alone(path):
    document = json.loads(path.read_text())
    del document["provenance"]
    path.write_text(json.dumps(document))
    assert load_wire_file(path)[1:] == (None, ())


@pytest.mark.parametrize("caveats", ["it guesses", [1.0], None])
def test_caveats_of_another_shape_are_refused(path, caveats):
    document = json.loads(path.read_text())
    document["provenance"]["caveats"] = caveats
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError, match=r"provenance: caveats = .* is not a list of texts"):
        load_wire_file(path)


@pytest.mark.parametrize(
    ("provenance", "told"),
    [
        ({"ambient_c": "22"}, "provenance: heat_balance: ambient_c = '22' is not a number"),
        ({"ambient_c": float("nan")}, "ambient_c = nan is not a number"),
        ({"ambient_c": None}, "ambient_c = None is not a number"),
        ({"loss_w_per_k": True}, "loss_w_per_k = True is not a number"),
        ({"loss_w_per_k": -1.0}, "heat balance: loss_w_per_k must be positive, it is -1"),
        ({"colour": 1.0}, "unknown key 'colour'"),
    ],
)
def test_a_wrong_number_is_refused_when_it_is_read(path, provenance, told):
    document = json.loads(path.read_text())
    document["provenance"]["heat_balance"] |= provenance
    path.write_text(json.dumps(document))
    for read in (load_wire_file, lambda path: parse_wire(path.read_text(), str(path))):
        with pytest.raises(ModelError, match=told) as caught:
            read(path)
        assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("provenance", [None, [], "a test", {"heat_balance": 3}])
def test_a_provenance_of_another_shape_is_refused(path, provenance):
    path.write_text(json.dumps(json.loads(path.read_text()) | {"provenance": provenance}))
    with pytest.raises(ModelError, match="expected a JSON object"):
        load_wire_file(path)
