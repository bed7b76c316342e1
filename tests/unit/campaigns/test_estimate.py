"""The estimate of time and disk space before a campaign starts."""

import pytest

from smadrive.campaigns.execution.estimate import check_disk, estimated
from smadrive.campaigns.execution.scheduling import groups_of
from smadrive.errors import DataError


def estimate_of(plan, done=()):
    return estimated(plan, groups_of(plan, set(done)))


def test_the_estimate_grows_with_the_runs_and_their_length(short_campaign):
    plan = short_campaign(vary="[[vary]]\nrepeats = 5\n")
    all_runs, rest = estimate_of(plan), estimate_of(plan, done=range(5))
    assert (all_runs.runs, rest.runs, all_runs.identifications) == (10, 5, 0)
    assert 0.0 < rest.core_s < all_runs.core_s
    assert rest.disk_bytes < all_runs.disk_bytes
    logs_alone = estimate_of(plan, done=range(10))
    assert logs_alone.runs == 0
    assert 0.0 < logs_alone.core_s < rest.core_s


def test_a_shape_may_have_blanks(short_campaign):
    shapes = ("sine:low_mm=2,high_mm=9,period_s=56", "sine: low_mm = 2, high_mm = 9, period_s = 56")
    vary = '[[vary]]\nreference = ["sine"]\n'
    plans = [short_campaign(vary=vary, more=f'[references.sine]\nshape = "{shape}"\n') for shape in shapes]
    of_shape = [estimate_of(plan) for plan in plans]
    assert of_shape[0].disk_bytes == of_shape[1].disk_bytes


def test_a_full_disk_is_found_before_the_start(short_campaign, tmp_path):
    estimate = estimate_of(short_campaign())
    check_disk(tmp_path / "new", estimate)
    with pytest.raises(DataError) as caught:
        check_disk(tmp_path / "new", estimate._replace(disk_bytes=1e18))
    assert caught.value.where == str(tmp_path / "new")
    assert not (tmp_path / "new").exists()
