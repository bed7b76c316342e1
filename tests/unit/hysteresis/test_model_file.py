"""Model files: they come back bit for bit, and what is no certified model is refused with file, key and cure."""

import json

import numpy as np
import pytest

from smadrive.errors import CertificateError, ModelError
from smadrive.hysteresis import TriangularSets, TSFuzzyDuhem, load_model, save_model


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


def test_a_failed_write_leaves_the_old_file(model, path):
    save_model(model, path)
    before = path.read_bytes()
    with pytest.raises(ModelError, match="provenance"):
        save_model(model, path, provenance={"rms": float("nan")})
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema": 99}, "schema is 99"),
        ({"kind": "preisach"}, "kind = 'preisach'"),
        ({"scale": None}, "'scale' is missing"),
        ({"scale": "wide"}, "scale = 'wide' is not a number"),
        ({"scale": 0}, "scale is 0"),
        ({"scale": 10**400}, "is not a number; put a finite number there"),
        ({"input_range": [1, 2, 3]}, "input_range has 3 numbers"),
        ({"input_range": [5, -5]}, "increasing"),
    ],
)
def test_broken_files_are_refused(model, path, changes, message):
    save_model(model, path)
    edited(path, **changes)
    with pytest.raises(ModelError, match=message) as caught:
        load_model(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_foreign_files_are_refused(path):
    with pytest.raises(ModelError, match="cannot be read"):
        load_model(path)
    path.write_text("not json")
    with pytest.raises(ModelError, match="not a JSON file"):
        load_model(path)
    path.write_text("[1, 2]")
    with pytest.raises(ModelError, match="expected a JSON object"):
        load_model(path)
    path.write_text("[" * 100_000)
    with pytest.raises(ModelError, match="nested too deeply for a model file"):
        load_model(path)


def test_a_byte_order_mark_is_no_part_of_it(model, path):
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
    with pytest.raises(CertificateError, match="not certified"):
        load_model(path)
    assert load_model(path, allow_uncertified=True).simulate([0.0, 1.0], 0.5)[1] == pytest.approx(0.5 * np.e)


def test_a_model_whose_branch_comes_back_is_refused(path):
    """Contracting and bounded, and yet cooling to the cold end takes it back to 0.6."""
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
    with pytest.raises(CertificateError, match=r"a branch comes back by \d+ % of the travel"):
        load_model(path)
    assert load_model(path, allow_uncertified=True).input_range == model.input_range


def test_more_sets_than_are_of_use_are_refused(path):
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
    with pytest.raises(ModelError, match="at most 200") as caught:
        load_model(path)
    assert len(str(caught.value)) < 300


def test_file_larger_than_any_model_is_refused(model, path):
    save_model(model, path, provenance={"source": "x" * (1 << 20)})
    with pytest.raises(ModelError, match="bytes"):
        load_model(path)
