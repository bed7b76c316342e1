"""The campaign file: axes, their combinations, the changes of rig and wire, and mistakes."""

import os
from pathlib import Path

import pytest

from smadrive.campaigns.campaign import check_plan
from smadrive.campaigns.execution.scheduling import groups_of
from smadrive.campaigns.experiments.run import execute, identification_key
from smadrive.campaigns.plan.axes import MOST_RUNS
from smadrive.campaigns.plan.plan import load_plan
from smadrive.errors import ConfigError, DataError
from smadrive.files.shipped import configs_dir

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
CAMPAIGNS = sorted([*(configs_dir() / "campaigns").glob("*.toml"), *BENCHMARKS.glob("*.toml")])

BASE = """
title = "x"
[run]
reference = "sine"
[references.sine]
shape = "sine:period_s=56"
"""


@pytest.fixture
def planned(tmp_path):
    def plan(text, base=BASE):
        path = tmp_path / "campaign.toml"
        path.write_text(base + text, encoding="utf-8")
        return load_plan(str(path))

    return plan


def test_axes_are_combined_and_the_last_one_is_fastest(planned):
    plan = planned("[[vary]]\nrig.rate_hz = [10.0, 20.0]\n[[vary]]\nrandom_wires = 3\n")
    assert plan.count == 6
    assert [tuple(plan.run(n).levels.values()) for n in range(6)] == [
        (10.0, 0), (10.0, 1), (10.0, 2), (20.0, 0), (20.0, 1), (20.0, 2),
    ]  # fmt: skip
    assert [plan.run(n).documents.rig.rate_hz for n in range(6)] == [10.0] * 3 + [20.0] * 3


def test_lists_of_one_axis_go_together(planned):
    text = "[[vary]]\nrig.rate_hz = [10.0, 20.0]\nrig.limits.current_max_a = [0.4, 0.5]\n"
    runs = [planned(text).run(n).documents.rig for n in range(2)]
    assert [(rig.rate_hz, rig.limits.current_max_a) for rig in runs] == [(10.0, 0.4), (20.0, 0.5)]


def test_runs_of_one_wire_share_an_identification(planned):
    plan = planned("[[vary]]\ndisplacement_sensor = [true, false]\n[[vary]]\nrandom_wires = 2\n")
    assert groups_of(plan, set()) == [[0, 2], [1, 3]]
    assert groups_of(plan, {0, 2}) == [[1, 3]]


def test_source_of_the_displacement_needs_no_identification_of_its_own(planned):
    vary = '[[vary]]\nrig.displacement_from = ["sensor", "resistance", "none"]\n[[vary]]\nrandom_wires = 2\n'
    plan = planned(vary)
    assert groups_of(plan, set()) == [[0, 2, 4], [1, 3, 5]]
    sensor, resistance = (plan.run(number).documents for number in (0, 2))
    assert sensor.rig.displacement_from != resistance.rig.displacement_from
    assert sensor.for_excitation() == resistance.for_excitation()


def test_a_setting_of_the_rig_needs_an_identification_of_its_own(planned):
    plan = planned("[[vary]]\nrig.rate_hz = [10.0, 20.0]\n")
    assert identification_key(plan.run(0)) != identification_key(plan.run(1))


@pytest.mark.parametrize(
    ("grid", "values"),
    [
        ("{low = 5.0, high = 20.0, number = 4}", [5.0, 10.0, 15.0, 20.0]),
        ('{low = 5.0, high = 20.0, number = 3, spacing = "logarithmic"}', [5.0, 10.0, 20.0]),
    ],
)
def test_a_grid_replaces_a_list(planned, grid, values):
    plan = planned(f"[[vary]]\nrig.rate_hz = {grid}\n")
    assert [plan.run(n).documents.rig.rate_hz for n in range(plan.count)] == values


def test_devices_are_changed_by_name(planned):
    text = """
    [run.rig]
    file = "bench-supply"
    devices.supply.profile = "hanmatek-hm30x"
    """
    (supply, *others) = planned(text).run(0).documents.rig.devices
    assert supply.profile == "hanmatek-hm30x"
    assert [device.name for device in others] == ["thermometer", "laser"]


def test_table_on_an_axis_keeps_the_other_keys_of_the_run(planned):
    run = "[run.rig]\nrate_hz = 15.0\nlimits.stale_after_s = 0.4\n[run.fit]\nmemory = 1\n"
    axis = """[[vary]]
    labels = ["a", "b"]
    rig = [{file = "in-process"}, {file = "bench-supply", limits = {watchdog_s = 3.0}}]
    fit = [{sets = 11}, {sets = 21}]
    """
    first, second = map(planned(run + axis).run, range(2))
    assert [one.documents.rig.rate_hz for one in (first, second)] == [15.0, 15.0]
    assert [one.documents.rig.limits.stale_after_s for one in (first, second)] == [0.4, 0.4]
    assert second.documents.rig.limits.watchdog_s == 3.0
    assert [(one.settings.fit.sets, one.settings.fit.memory) for one in (first, second)] == [(11, 1), (21, 1)]


def test_device_whose_name_has_a_dot_varies_in_a_table(planned):
    run = "[[run.rig.devices]]\nname = 'a.b'\nprofile = 'sma-reference'\nurl = 'sim://a.b'\n"
    axis = "[[vary]]\nlabels = ['a']\nrig.devices = [{'a.b' = {unit_id = 7}}]\n"
    (device,) = planned(run + axis).run(0).documents.rig.devices
    assert (device.name, device.unit_id) == ("a.b", 7)


def test_a_diameter_brings_its_own_data_sheet(planned):
    plan = planned("[run.wire]\ndiameter_mm = 0.25\n")
    sheet, sim = plan.run(0).documents.data_sheet, plan.run(0).documents.sim
    balance = sheet.heat_balance()
    assert balance.loss_w_per_k == pytest.approx(sim.wire.loss_w_per_k)
    assert balance.heat_capacity_j_per_k == pytest.approx(sim.wire.heat_capacity_j_per_k)
    assert balance.resistance_cold_ohm == pytest.approx(sim.wire.resistance_cold_ohm)


def test_a_grid_of_a_thousand_million_runs_is_an_error(planned):
    axes = "".join(
        f"[[vary]]\nsim.{key} = {{low = 0.1, high = 0.9, number = 1000}}\n"
        for key in ("wire.stroke_mm", "wire.mass_kg", "board.watchdog_s")
    )
    with pytest.raises(ConfigError) as caught:
        planned(axes)
    assert caught.value.limit == MOST_RUNS
    assert "1000000000" in caught.value.value
    assert caught.value.cure


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("[[vary]]\nrig.rate_hs = [1.0, 2.0]\n", "[run.rig]"),
        ("[[vary]]\nrig.rate_hz = [1000.0]\n", "[run.rig]"),
        ("[[vary]]\nsim.thermocouple.noise = [0.1]\n", "[run.sim]"),
        ("[[vary]]\ncontroler = ['inverse']\n", "[[vary]] 1"),
        ("[[vary]]\nrig.rate_hz = 20.0\n", "[[vary]] 1: rig.rate_hz"),
        ("[[vary]]\nrig.rate_hz = [10.0, 20.0]\nseed = [1]\n", "[[vary]] 1"),
        ("[[vary]]\nexperiment = ['track', 'identify']\n", "[[vary]] 1: experiment"),
        ("[[vary]]\nname = 'a'\n", "[[vary]] 1"),
        ("[[vary]]\nrig.rate_hz = {low = 1.0, high = 9.0, number = 1}\n", "[[vary]] 1: rig.rate_hz"),
        ("[[vary]]\nrig.rate_hz = {low = 1.0, hihg = 9.0, number = 2}\n", "[[vary]] 1: rig.rate_hz"),
        ("[[vary]]\nrig.rate_hz = {low = 1.0, high = 1.0, number = 2}\n", "[[vary]] 1: rig.rate_hz"),
        ("[[vary]]\nrig.rate_hz = {low = 9.0, high = 1.0, number = 2}\n", "[[vary]] 1: rig.rate_hz"),
        ("[[vary]]\nrandom_wires = 100000000\n", "[[vary]] 1"),
        ("[[vary]]\nseed = [1, 1]\n", "[[vary]] 1"),
        ("[[vary]]\nseed = [1]\n[[vary]]\nseed = [2]\n", "[[vary]]"),
        ("[[vary]]\nseed = [1]\n[[vary]]\nname = 'other'\nseed = [2]\n", "[[vary]]"),
        ("[[vary]]\nsim.board.watchdog_s = [0.1]\n[[vary]]\nlabels = ['a']\nsim.board = [{}]\n", "[[vary]]"),
        ("[[vary]]\nrepeats = 2\nseed = [7, 8]\n", "[[vary]] 1: seed"),
        ("[[vary]]\nlabels = ['a', 'a']\nrig.rate_hz = [10.0, 20.0]\n", "[[vary]] 1"),
        ("[[vary]]\nrig.file = [3]\n", "file"),
        ("[[vary]]\nrig.devices.'a.b'.profile = ['tclab']\n", "[[vary]] 1"),
        ("[[vary]]\nrig.devices = [[{name = 'a'}]]\n", "[[vary]] 1"),
        ("[[vary]]\nname = 'rms_percent'\nseed = [1]\n", "[[vary]]"),
        ("[[vary]]\nreference = ['sin']\n", "[run]"),
        ("[[vary]]\ndisturbance = ['draught']\n", "[run]"),
        ("[[vary]]\nreference = ['a']\n[references.a]\nshape = 'sine:period=56'\n", "reference 'sine:period=56"),
        ("[[vary]]\nrecords = '*.h5'\n", "[[vary]] 1: records"),
        ("[run.rig]\ndevices.bord.profile = 'tclab'\n", "[run.rig] devices"),
        ("[[vary]]\nrig.devices.board = ['tclab']\n", "[run.rig] devices: board"),
        ("[run.rig]\nrate_hz = 2026-01-01\n", "[run.rig]"),
        ("[[vary]]\nlabels = ['a']\nsim.wire.ambient_c = [12:00:00]\n", "[run.sim]"),
        ("[run.sim]\ndevices.bord.profile = 'tclab'\n", "[run]: sim.devices"),
        ("[run.wire]\nseed = 5\n[[vary]]\nrandom_wires = 2\n", "[run]: wire.seed"),
        ("[[vary]]\nrandom_wire = 2\n", "[[vary]] 1"),
        ("[[vary]]\nseed = {low = -1e308, high = 1e308, number = 3}\n", "[[vary]] 1: seed"),
        ("[[disturbances.none]]\nname = 'draft'\nat_s = 1.0\nfactor = 1.6\nfor_s = 5.0\n", "campaign.toml"),
        ("[run.wire]\ndiameter_mm = 0.15\nlength_m = 300.0\n", "campaign.toml"),
        ("[run.wire]\ndiameter_mm = 0.15\n[run.sim]\nwire.resistance_change = 2.0\n", "data sheet"),
        ('[[vary]]\nmodel = ["a\\u0000b.json"]\n', "a\\x00b.json"),
        ("[run.fit]\nmemory = 2\n", "campaign.toml"),
        ("[run.fit]\nkind = 'duhem'\nsets = 5\n", "campaign.toml"),
        ("[[vary]]\nfit.sets = [11, 60]\n", "campaign.toml"),
        ("[report]\nmetric = 'rms'\n", "[report] metric"),
        ("[report]\nby = ['wires']\n", "[report] by"),
        ("unknown = 1\n", "campaign.toml"),
        ("[run.sim]\nfile = 'flexinol-lt-0.15mm'\n[run.wire]\ndiameter_mm = 0.1\n", "[run]"),
        ("[run.wire]\ndiameter_mm = 0.11\n", "flexinol"),
    ],
)
def test_a_mistake_names_its_place_and_is_found_before_the_start(planned, text, where):
    with pytest.raises(ConfigError) as caught:
        check_plan(planned(text))
    assert where in caught.value.where


@pytest.mark.parametrize("parameters", ["factr = 1.6", "factor = 1.6"])
def test_an_unknown_parameter_of_a_fault_is_found_before_the_start(planned, parameters):
    text = f"[[vary]]\ndisturbance = ['d']\n[[disturbances.d]]\nname = 'draft'\nat_s = 1.0\n{parameters}\n"
    with pytest.raises(ConfigError) as caught:
        check_plan(planned(text))
    assert "draft" in caught.value.where


def test_a_rig_that_is_not_possible_does_not_end_the_start_with_a_disturbance(planned):
    """The current is too small for this wire. So the run becomes a failed row, as without a disturbance."""
    text = "[[vary]]\ndisturbance = ['d']\n[[disturbances.d]]\nname = 'draft'\nat_s = 1.0\nfactor = 1.6\nfor_s = 5.0\n"
    rig = "[run.rig.limits]\ncurrent_max_a = 0.01\n"
    plan = planned(rig + text)
    check_plan(plan)
    assert execute(plan.run(0)).row["error_type"] == "ConfigError"


@pytest.mark.parametrize(
    "run",
    [
        "experiment = 'track'",
        "experiment = 'fit'",
        "reference = 'a'\nmodel = 'm.json'\ncontroller = 'plain-map'",
        "experiment = 'identify'\nmodel = 'm.json'",
    ],
)
def test_a_run_that_lacks_something_is_an_error(planned, run):
    with pytest.raises(ConfigError) as caught:
        check_plan(planned("", base=f"title = 'x'\n[run]\n{run}\n[references.a]\nshape = 'sine:period_s=56'\n"))
    assert caught.value.cure


def test_a_missing_model_is_an_error(planned):
    with pytest.raises(ConfigError) as caught:
        check_plan(planned("[[vary]]\nmodel = ['nowhere.json']\n"))
    assert caught.value.where.endswith("nowhere.json")


@pytest.mark.parametrize("folder", ["reel", "reel [2026]"])
@pytest.mark.parametrize("is_absolute", [False, True])
def test_records_are_an_axis_of_files(tmp_path, folder, is_absolute):
    reel, campaigns = tmp_path / "records", tmp_path / folder
    reel.mkdir()
    campaigns.mkdir()
    for name in ("b.csv", "a.csv"):
        (reel / name).write_text("temperature_c,displacement_mm\n20,0\n21,0\n")
    pattern = reel / "*.csv" if is_absolute else "../records/*.csv"
    text = f"title = 'reel'\n[run]\nexperiment = 'fit'\n[[vary]]\nrecords = '{pattern}'\n"
    (campaigns / "campaign.toml").write_text(text)
    plan = load_plan(str(campaigns / "campaign.toml"))
    assert [plan.run(n).levels["record"] for n in range(plan.count)] == ["../records/a.csv", "../records/b.csv"]
    assert Path(plan.run(0).settings.record).samefile(reel / "a.csv")


def test_files_whose_names_the_table_could_not_hold_are_an_error(tmp_path):
    text = "title = 'reel'\n[run]\nexperiment = 'fit'\n[[vary]]\nrecords = '*.csv'\n"
    for folder in (tmp_path / "records", tmp_path / os.fsdecode(b"umlaut \xfc")):
        folder.mkdir()
        (folder / "campaign.toml").write_text(text)
        (folder / os.fsdecode(b"r\xff.csv")).write_text("temperature_c,displacement_mm\n20,0\n21,0\n")
        with pytest.raises(ConfigError) as caught:
            load_plan(str(folder / "campaign.toml"))
        assert caught.value.where.isascii()


@pytest.mark.parametrize("path", CAMPAIGNS, ids=lambda path: path.stem)
def test_campaigns_of_the_project_are_right(path):
    check_plan(load_plan(str(path)))


def test_an_unreadable_reference_is_an_error(planned, tmp_path):
    text = "[[vary]]\nreference = ['file']\n[references.file]\nfile = 'nowhere.csv'\n"
    with pytest.raises((ConfigError, DataError)) as caught:
        check_plan(planned(text))
    assert caught.value.where.endswith("nowhere.csv")
