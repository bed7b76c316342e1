"""The experiments of a campaign: identification, fits, controllers, references, disturbances, devices."""

import numpy as np
import pytest

from smadrive.campaigns.experiments.run import execute, identify
from smadrive.campaigns.plan.plan import load_plan
from smadrive.files.csv_table import write_table

pytestmark = pytest.mark.exhaustive

TRACK = """
title = "experiments"
[run]
reference = "slow"
[run.wire]
kind = "duhem"
[[vary]]
random_wires = 1
{vary}
[references.slow]
shape = "sine:period_s=40,cycles=1"
smooth = false
[references.fast]
shape = "steps:dwell_s=6,cycles=1"
[references.table]
file = "table.csv"
[[disturbances.draft]]
name = "draft"
between_s = [5.0, 10.0]
factor = 1.6
for_s = 20.0
"""


@pytest.fixture
def rows(tmp_path):
    """`rows(vary)` are the rows of a campaign whose runs share one identification."""

    def executed(vary):
        path = tmp_path / "campaign.toml"
        path.write_text(TRACK.format(vary=vary), encoding="utf-8")
        plan = load_plan(str(path))
        knowledge = identify(plan.run(0))
        results = [execute(plan.run(number), knowledge) for number in range(plan.count)]
        assert [result.row.get("error") for result in results] == [None] * plan.count
        return [result.row for result in results]

    return executed


def test_the_inverse_is_better_than_the_baselines(rows):
    found = rows('[[vary]]\ncontroller = ["inverse", "duhem-inverse", "plain-map", "feedback-only"]\n')
    inverse, duhem, plain, feedback = (row["rms_percent"] for row in found)
    assert max(inverse, duhem) < 0.3
    assert inverse < 0.5 * min(plain, feedback)
    assert found[0]["fit_rms_percent"] < 0.5
    assert found[0]["certified"]


def test_a_run_without_sensor_is_scored_by_the_true_displacement(rows):
    with_sensor, without = rows("[[vary]]\ndisplacement_sensor = [true, false]\n")
    assert with_sensor["rms_percent"] < without["rms_percent"] < 3.0
    assert with_sensor["ticks"] == without["ticks"]


def test_a_draft_costs_accuracy(rows):
    quiet, draft = rows('[[vary]]\ndisturbance = ["none", "draft"]\n[[vary]]\ndisplacement_sensor = [false]\n')
    assert draft["rms_percent"] > 1.5 * quiet["rms_percent"]
    assert draft["energy_j"] > quiet["energy_j"]


def test_a_reference_that_is_too_fast_is_smoothed(rows, tmp_path):
    write_table(tmp_path / "table.csv", {}, {"time_s": np.array([0.0, 20.0]), "phase": np.array([0.2, 0.5])})
    slow, fast, table = rows('[[vary]]\nreference = ["slow", "fast", "table"]\n')
    assert (slow["smoothed"], fast["smoothed"], table["smoothed"]) == (False, True, False)
    assert fast["rms_percent"] < 3.0
    assert table["rms_percent"] < 1.0


def test_records_are_fitted(tmp_path):
    rising, falling = np.linspace(20.0, 120.0, 400), np.linspace(120.0, 20.0, 400)
    for name, middle_c in (("a", 80.0), ("b", 90.0)):
        displacement_mm = [
            10.0 / (1.0 + np.exp(-(t - m) / 4.0)) for t, m in ((rising, middle_c), (falling, middle_c - 15))
        ]
        columns = {
            "temperature_c": np.concatenate((rising, falling)),
            "displacement_mm": np.concatenate(displacement_mm),
        }
        write_table(tmp_path / f"{name}.csv", {}, columns)
    text = 'title = "reel"\n[run]\nexperiment = "fit"\nfit.kind = "duhem"\n[[vary]]\nrecords = "*.csv"\n'
    (tmp_path / "reel.toml").write_text(text, encoding="utf-8")
    plan = load_plan(str(tmp_path / "reel.toml"))
    rows = [execute(plan.run(number)).row for number in range(plan.count)]
    assert len(rows) == 2
    assert all(row["fit_rms_percent"] < 3.0 for row in rows)
    assert all(abs(row["identified_stroke_mm"] - 10.0) < 0.5 for row in rows)


def test_a_supply_with_other_sensors_is_a_rig_too(tmp_path):
    text = (
        'title = "supply"\n[run]\nexperiment = "identify"\nrig.file = "bench-supply"\nfit.memory = 1\n'
        '[[vary]]\nrig.devices.supply.profile = ["riden-rd60xx"]\n'
    )
    (tmp_path / "supply.toml").write_text(text, encoding="utf-8")
    run = load_plan(str(tmp_path / "supply.toml")).run(0)
    row = execute(run, identify(run)).row
    assert row["fit_rms_percent"] < 2.0
    assert row["identified_heat_capacity_j_per_k"] == pytest.approx(row["heat_capacity_j_per_k"], rel=0.2)
