"""Runs and identifications on the cluster: their order and their number. The cluster is in this process."""

import asyncio

import pytest
from distributed import Client, LocalCluster, wait

from smadrive.campaigns.execution import scheduling
from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.execution.scheduling import (
    GROUPS_PER_THREAD,
    RUNS_PER_THREAD,
    _result_of,
    groups_of,
    run_all,
)
from smadrive.campaigns.experiments.run import execute
from smadrive.campaigns.plan.plan import load_plan

FITS = """
title = "damaged records"
[run]
experiment = "fit"
[[vary]]
records = "*.csv"
"""
WIRES = """
title = "six wires that no rig can identify, each with eight settings"
[run]
rig.limits.current_max_a = 50.0
reference = "sine"
[[vary]]
sim.thermocouple.noise_c = {low = 0.1, high = 0.6, number = 6}
[[vary]]
controller = ["inverse", "duhem-inverse", "plain-map", "feedback-only"]
[[vary]]
displacement_sensor = [true, false]
[references.sine]
shape = "sine:period_s=56"
"""
"""Runs and identifications that fail at once."""


@pytest.fixture
def planned(tmp_path):
    """`planned(text)` is the plan of a campaign in a folder with 30 damaged records."""
    for number in range(30):
        (tmp_path / f"{number}.csv").touch()

    def plan(text):
        (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
        return load_plan(str(tmp_path / "campaign.toml"))

    return plan


@pytest.fixture
def cluster():
    """`cluster(threads)` is a cluster of one worker."""
    clusters = []

    def started(threads):
        clusters.append(
            LocalCluster(n_workers=1, threads_per_worker=threads, processes=False, dashboard_address="127.0.0.1:0")
        )
        return clusters[-1]

    yield started
    for one in clusters:
        one.close()


def keys(client, name):
    """The keys of the runs or of the identifications that are on the cluster."""
    return {key for key in client.futures if key.startswith(f"{name}-")}


def conduct(client, plan, folder, finished):
    """Execute a plan. `finished` is called with each result."""
    with Journal(folder, plan, resume=False) as journal:
        run_all(client, plan, groups_of(plan, set()), journal, finished)
        assert sorted(journal.results) == list(range(plan.count))


def test_workers_that_join_later_get_runs(cluster, planned, tmp_path, monkeypatch):
    monkeypatch.setattr(scheduling, "COUNTED_S", 0.0)
    seen = []
    with cluster(1) as local, Client(local) as client:

        def finished(_):
            if not seen:
                local.scale(4)
                client.wait_for_workers(4)
            seen.append(len(keys(client, "run")))

        conduct(client, planned(FITS), tmp_path / "folder", finished)
    assert seen[0] <= RUNS_PER_THREAD + 1
    assert RUNS_PER_THREAD + 1 < max(seen) <= 4 * RUNS_PER_THREAD + 1


def test_identifications_are_sent_ahead_of_the_runs(cluster, planned, tmp_path):
    """Otherwise all workers wait for the identification of one wire, because its runs fill the queue."""
    threads, seen = 2, []
    with cluster(threads) as local, Client(local) as client:

        def finished(_):
            seen.append((len(keys(client, "identification")), len(keys(client, "run"))))

        conduct(client, planned(WIRES), tmp_path / "folder", finished)
    assert seen[0][0] > threads
    assert max(identifications for identifications, _ in seen) <= GROUPS_PER_THREAD * threads + 1
    assert max(runs for _, runs in seen) <= RUNS_PER_THREAD * threads + 1


def test_result_that_was_lost_with_its_worker_is_waited_for(cluster, planned):
    run = planned(FITS).run(0)
    with cluster(1) as local, Client(local) as client:
        future = client.submit(execute, run)
        wait(future)
        local.scale(0)
        while future.status == "finished":
            local.sync(asyncio.sleep, 0.01)
        local.scale(1)
        assert _result_of(future).row == execute(run).row
