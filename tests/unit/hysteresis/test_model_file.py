"""Model files come back bit for bit; a malformed file or an uncertified model is rejected with file, key and cure."""

import json

import numpy as np
import pytest

from smadrive.errors import CertificateError, ModelError
from smadrive.hysteresis import TriangularSets, TSFuzzyDuhem, load_model, save_model
from smadrive.hysteresis.model_file import CURE, MOST_BYTES


@pytest.fixture
def path(tmp_path):
    return tmp_path / "model.json"


def edited(path, **changes):
    document = json.loads(path.read_text())
    for key, value in changes.items():
        if value is None:
            del document[key]
        else:
            document[key] = value
    path.write_text(json.dumps(document))


def test_round_trip(model, turns, path):
    save_model(model, path, provenance={"source": "a test"})
    np.testing.assert_array_equal(load_model(path).simulate(turns), model.simulate(turns))
    assert json.loads(path.read_text())["provenance"] == {"source": "a test"}
    assert [entry.name for entry in path.parent.iterdir()] == ["model.json"]


def test_failed_write_keeps_the_old_file(model, path):
    save_model(model, path)
    before = path.read_bytes()
    with pytest.raises(ModelError) as error:
        save_model(model, path, provenance={"rms": float("nan")})
    assert error.value.where == f"{path}: provenance"
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("changes", "key", "value"),
    [
        ({"schema": 99}, "schema", "99"),
        ({"kind": "preisach"}, "kind", "'preisach'"),
        ({"scale": None}, "scale", None),
        ({"scale": "wide"}, "scale", "'wide'"),
        ({"scale": 0}, "scale", 0.0),
        ({"scale": 10**400}, "scale", ...),
        ({"input_range": [1, 2, 3]}, "input_range", "3 numbers"),
        ({"input_range": [5, -5]}, "input_range", (5.0, -5.0)),
    ],
)
def test_wrong_value_is_rejected_by_its_key(model, path, changes, key, value):
    save_model(model, path)
    edited(path, **changes)
    with pytest.raises(ModelError) as error:
        load_model(path)
    assert error.value.where == f"{path}: {key}"
    assert value in (..., error.value.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


def test_missing_file_is_rejected(path):
    with pytest.raises(ModelError) as error:
        load_model(path)
    assert isinstance(error.value.__cause__, FileNotFoundError)


@pytest.mark.parametrize("text", ["not json", "[1, 2]", "[" * 100_000])
def test_file_of_another_kind_is_rejected(path, text):
    path.write_text(text)
    with pytest.raises(ModelError) as error:
        load_model(path)
    assert error.value.where == str(path)
    assert error.value.cure == CURE


def test_byte_order_mark_is_accepted(model, path):
    save_model(model, path)
    path.write_text("\ufeff" + path.read_text())
    assert load_model(path).input_range == model.input_range


def test_expanding_rules_need_permission(path):
    model = TSFuzzyDuhem(
        TriangularSets((0.0, 1.0)),
        a_heating=[1, 1],
        b_heating=[0, 0],
        a_cooling=[1, 1],
        b_cooling=[0, 0],
        input_range=(0, 1),
    )
    assert not model.certificate().contracting
    save_model(model, path)
    with pytest.raises(CertificateError) as error:
        load_model(path)
    assert error.value.where == str(path)
    assert load_model(path, allow_uncertified=True).simulate([0.0, 1.0], 0.5)[1] == pytest.approx(0.5 * np.e)


def test_model_whose_branch_reverses_is_rejected(path):
    """The model is contracting and bounded, but cooling to the cold end takes it back to w = 0.6."""
    model = TSFuzzyDuhem(
        TriangularSets((20.0, 40.0, 60.0, 80.0)),
        a_heating=[-1e-3, -1e-3, -0.5, -0.5],
        b_heating=[0.0, 0.0, 0.5, 0.5],
        a_cooling=[0.5, 0.5, 0.5, 1e-3],
        b_cooling=[-0.3, 0.0, 0.0, 0.0],
        input_range=(10.0, 90.0),
    )
    certificate = model.certificate()
    assert certificate.contracting
    assert certificate.bounded
    assert certificate.turned_share > 0.5
    assert not certificate.holds
    save_model(model, path)
    with pytest.raises(CertificateError) as error:
        load_model(path)
    assert len(certificate.shortcomings) == 1
    assert certificate.shortcomings[0] in error.value.what
    assert load_model(path, allow_uncertified=True).input_range == model.input_range


def test_too_many_sets_are_rejected(path):
    count = 20_000
    laws = {"a_heating": -1.0, "b_heating": 1.0, "a_cooling": 1.0, "b_cooling": 0.0}
    document = {
        "schema": 1,
        "kind": "tsfuzzy",
        "sets": {"shape": "triangular", "centres": list(range(count))},
        **{name: [value] * count for name, value in laws.items()},
        "scale": 1.0,
        "offset": 0.0,
        "input_range": [0, count],
    }
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError) as error:
        load_model(path)
    assert (error.value.value, error.value.limit) == (count, 200)
    assert len(str(error.value)) < 300


def test_too_large_file_is_rejected(model, path):
    save_model(model, path, provenance={"source": "x" * (1 << 20)})
    with pytest.raises(ModelError) as error:
        load_model(path)
    assert error.value.limit == MOST_BYTES
