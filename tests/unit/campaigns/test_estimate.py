"""The estimate of time and disk space before a campaign starts."""

import pytest

from smadrive.campaigns.execution.estimate import (
    DUHEM_TICKS,
    TYPICAL_TICK_S,
    WORKER_BYTES,
    check_disk,
    estimated,
    memory_caveats,
    tick_s,
)
from smadrive.campaigns.execution.scheduling import groups_of
from smadrive.campaigns.experiments.run import logged_run
from smadrive.campaigns.plan.plan import load_plan
from smadrive.errors import DataError


def estimate_of(plan, done=()):
    return estimated(plan, groups_of(plan, set(done)))


def test_the_estimate_grows_with_the_runs_and_their_length(short_campaign):
    plan = short_campaign(vary="[[vary]]\nrepeats = 5\n")
    all_runs, rest = estimate_of(plan), estimate_of(plan, done=range(5))
    assert (all_runs.runs, rest.runs, all_runs.identifications) == (10, 5, 0)
    assert 0.0 < rest.ticks < all_runs.ticks
    assert rest.disk_bytes < all_runs.disk_bytes
    logs_alone = estimate_of(plan, done=range(10))
    assert logs_alone.runs == 0
    assert 0.0 < logs_alone.ticks < rest.ticks
    assert all_runs.core_s == all_runs.ticks * all_runs.tick_s > 0.0


FIT = """title = "reel"
[run]
experiment = "fit"
record = "a.csv"
{fit}
"""


def ticks_of_fit(folder, fit):
    (folder / "a.csv").touch()
    (folder / "fit.toml").write_text(FIT.format(fit=fit))
    return estimate_of(load_plan(str(folder / "fit.toml"))).ticks


def test_fit_that_searches_for_memory_takes_longer(tmp_path):
    kinds = ('fit.kind = "duhem"', "fit.memory = 1", "", "fit.memory = 5")
    duhem, rules, search, plane = (ticks_of_fit(tmp_path, fit) for fit in kinds)
    assert rules > 2 * duhem
    assert plane > search > 2 * rules


def test_second_fit_of_a_controller_counts(short_campaign):
    controllers = ("inverse", "duhem-inverse")
    plans = [short_campaign(run=f'controller = "{one}"', model="") for one in controllers]
    inverse, duhem = (estimate_of(plan) for plan in plans)
    runs_and_logs = 2 * inverse.runs
    assert duhem.ticks - inverse.ticks == pytest.approx(runs_and_logs * DUHEM_TICKS)


@pytest.mark.exhaustive
def test_space_of_the_logs_is_that_of_their_ticks(short_campaign):
    """The smoothing takes time, but no space."""
    one_log, axis = "[report]\nworst_logs = 1\n", '[[vary]]\nreference = ["{}"]\n'
    smoothed = '[references.smoothed]\nshape = "trapezoid:rise_s=3,dwell_s=1,cycles=0.5"\n'
    plain, slow = (short_campaign(vary=axis.format(name), more=smoothed + one_log) for name in ("up", "smoothed"))
    assert estimate_of(slow).ticks > 1.5 * estimate_of(plain).ticks
    assert estimate_of(slow).disk_bytes == estimate_of(plain).disk_bytes
    without = short_campaign(more="[report]\nworst_logs = 0\n")
    log_bytes = estimate_of(plain).disk_bytes - estimate_of(without).disk_bytes
    assert 0.5 < log_bytes / len(logged_run(plain.run(0))) < 2.0


def test_a_shape_may_have_blanks(short_campaign):
    shapes = ("sine:low_mm=2,high_mm=9,period_s=56", "sine: low_mm = 2, high_mm = 9, period_s = 56")
    vary = '[[vary]]\nreference = ["sine"]\n'
    plans = [short_campaign(vary=vary, more=f'[references.sine]\nshape = "{shape}"\n') for shape in shapes]
    of_shape = [estimate_of(plan) for plan in plans]
    assert of_shape[0].disk_bytes == of_shape[1].disk_bytes


TOO_FAST = """
[[vary]]
rig.rate_hz = {rates}
"""
SUPPLY = 'rig.file = "bench-supply"'


@pytest.mark.parametrize("rates", ["[50.0, 4.0]", "[4.0, 50.0]"])
def test_run_that_cannot_be_driven_does_not_end_the_campaign(short_campaign, rates):
    """At 50 Hz, the supply is too slow."""
    plan = short_campaign(run=SUPPLY, vary=TOO_FAST.format(rates=rates))
    assert estimate_of(plan).core_s > 0.0


def test_rest_of_runs_that_cannot_be_driven_counts_with_a_typical_tick(short_campaign):
    plan = short_campaign(run=SUPPLY, vary=TOO_FAST.format(rates="[50.0]"))
    assert tick_s([plan.run(0)]) == TYPICAL_TICK_S
    assert estimate_of(plan).runs == plan.count


def test_wire_that_is_too_hot_to_excite_does_not_end_the_campaign(short_campaign):
    plan = short_campaign(model="", vary="[[vary]]\nsim.wire.ambient_c = [200.0, 21.0]")
    estimate = estimate_of(plan)
    assert (estimate.runs, estimate.identifications) == (4, 4)


def test_reference_that_cannot_be_planned_does_not_end_the_campaign(short_campaign):
    vary = '[[vary]]\nreference = ["up", "wrong"]\n'
    plan = short_campaign(vary=vary, more='[references.wrong]\nshape = "sine:period=56"\n')
    assert estimate_of(plan).core_s > 0.0


def test_a_full_disk_is_found_before_the_start(short_campaign, tmp_path):
    estimate = estimate_of(short_campaign())
    check_disk(tmp_path / "new", estimate)
    with pytest.raises(DataError) as caught:
        check_disk(tmp_path / "new", estimate._replace(disk_bytes=1e18))
    assert caught.value.where == str(tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_too_little_memory_for_the_workers_is_a_warning():
    memory_bytes = 4 * WORKER_BYTES
    assert memory_caveats(4, memory_bytes) == []
    (caveat,) = memory_caveats(5, memory_bytes)
    assert "--workers 4" in caveat
    (caveat,) = memory_caveats(1, WORKER_BYTES // 2)
    assert "--workers" not in caveat
