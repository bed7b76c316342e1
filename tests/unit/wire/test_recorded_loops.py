"""The recorded loops of a wire: their sections, what lies outside of them, and their way through the wire's file."""

import json

import numpy as np
import pytest

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, PreisachPlane, TriangularSets, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.hysteresis.turning_points import MOST_TURNS
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire, load_wire, parse_wire
from smadrive.wire.recorded_loops import dropped_turns, outside, recorded_sections, sections_of
from smadrive.wire.wire_properties import WireProperties

DUHEM = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
)
MAJOR = np.array([20.0, 120.0, 20.0])
NESTED = np.array([20.0, 120.0, 40.0, 110.0, 50.0, 100.0, 60.0, 90.0, 20.0])


def test_sections_of_a_path_are_its_turning_points_and_ends():
    assert sections_of(np.array([20.0, 60.0, 120.0, 119.0, 120.0, 40.0]), 1.0) == ((20.0, 120.0), (120.0, 40.0))
    assert sections_of(np.array([20.0, 20.0])) == ()


def test_of_sections_with_one_turning_point_the_longest_is_kept():
    repeated = np.concatenate([MAJOR, [80.0, 20.0], MAJOR, MAJOR])
    assert set(recorded_sections(repeated)) == {(20.0, 120.0), (120.0, 20.0), (80.0, 20.0)}
    assert len(recorded_sections(np.tile(NESTED, 200))) <= 2 * len(NESTED)


@pytest.mark.parametrize(
    ("run", "found"),
    [
        (MAJOR, 0),
        ([20.0, 85.0, 20.0], 1),  # no falling section began near 85
        ([20.0, 120.0, 70.0, 118.0], 1),  # no rising section began near 70
        ([20.0, 115.0, 95.0, 99.0], 0),  # the short way is no loop
        ([10.0, 135.0, 5.0], 0),  # outside of the recorded range nothing transforms
    ],
)
def test_sections_far_from_a_record_of_the_major_loop_are_found(run, found):
    assert len(outside(sections_of(np.array(run)), recorded_sections(MAJOR))) == found


def test_sections_near_those_of_a_nested_record_are_not_found():
    recorded = recorded_sections(NESTED)
    assert outside(sections_of(NESTED + 5.0), recorded) == ()
    assert outside(sections_of(np.array([20.0, 100.0, 75.0, 95.0])), recorded) == ((75.0, 95.0),)


@pytest.mark.parametrize(("turns", "dropped"), [(0, 0), (1, 0), (MOST_TURNS - 1, 0), (MOST_TURNS + 9, 10)])
def test_turning_points_of_too_many_loops_inside_each_other_are_counted(turns, dropped):
    sets = TriangularSets(tuple(np.linspace(25.0, 125.0, 15)))
    plane = PreisachPlane([70.0, 110.0], [30.0, 60.0], [[1.0]])
    model = TSFuzzyPreisach(TSFuzzyDuhem.from_duhem(DUHEM, sets), plane, 0.5)
    path = [20.0, *(80.0 + (-1) ** number * (40.0 - 0.3 * number) for number in range(turns))]
    assert dropped_turns(model, sections_of(np.array(path))) == dropped


def test_every_run_is_near_an_unknown_record():
    assert outside(sections_of(NESTED), ()) == ()


def test_sections_are_kept_while_the_model_of_a_wire_is_tuned():
    sections_c = recorded_sections(NESTED)
    balance = HeatBalance(0.0298, 0.014, 0.83, 22.0, 16.5, -0.12, 0.15)
    tuned = WireProperties(balance, None, sections_c).identified(DUHEM)
    assert parse_wire(tuned.text(), place="tuned").sections_c == sections_c


def test_sections_are_kept_in_the_file_of_a_wire(tmp_path):
    sections_c = recorded_sections(NESTED)
    IdentifiedWire(DUHEM, sections_c=sections_c).save(tmp_path / "wire.json")
    assert load_wire(tmp_path / "wire.json").sections_c == sections_c
    document = json.loads((tmp_path / "wire.json").read_text())
    document["provenance"]["sections"]["ends_c"].pop()
    (tmp_path / "damaged.json").write_text(json.dumps(document))
    with pytest.raises(ModelError) as caught:
        load_wire(tmp_path / "damaged.json")
    assert "ends_c" in caught.value.where
