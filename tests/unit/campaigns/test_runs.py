"""The runs of a campaign, on a cluster of one worker in this process."""

import errno
import importlib
import operator
import os
import subprocess
import sys
import tempfile

import dask
import numpy as np
import pytest
from distributed import Client, LocalCluster, wait
from exact_wire import exact_wire

import smadrive.campaigns.experiments.run
from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.execution.scheduling import _result_of, groups_of, run_all
from smadrive.campaigns.experiments.identification import WireKnowledge
from smadrive.campaigns.experiments.run import execute, identify, logged_run
from smadrive.campaigns.experiments.tracking import tracking_row
from smadrive.campaigns.results.table import results_table, write_table
from smadrive.campaigns.versions import versions, with_versions
from smadrive.errors import ConfigError, DataError
from smadrive.hysteresis import DuhemModel
from smadrive.runs.log.reader import read_log
from smadrive.runs.replay import replay
from smadrive.runs.run_metadata import wire_of


@pytest.fixture(scope="module")
def client():
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster) as client,
    ):
        yield client


def table_of(client, plan, folder, *, resume=False):
    with Journal(folder, plan, resume=resume) as journal:
        finished = []
        run_all(client, plan, groups_of(plan, set(journal.results)), journal, finished.append)
        return results_table(plan, journal.results), len(finished)


@pytest.mark.exhaustive
def test_a_run_is_the_same_on_a_cluster_and_without(client, short_campaign, tmp_path):
    plan = short_campaign()
    table, finished = table_of(client, plan, tmp_path / "folder")
    assert finished == plan.count == len(table) == 2
    assert list(table["run"]) == [0, 1]
    assert set(table["status"]) == {"done"}
    for number in range(2):
        row = execute(plan.run(number)).row
        assert row["rms_percent"] == table["rms_percent"][number]
        assert row["energy_j"] == table["energy_j"][number]
    assert table["rms_percent"].between(0.01, 30.0).all()
    again, finished = table_of(client, plan, tmp_path / "folder", resume=True)
    assert finished == 0
    assert write_table(table, tmp_path / "a.parquet") == write_table(again, tmp_path / "b.parquet")


def test_a_failed_run_is_a_row_with_its_error(client, short_campaign, tmp_path):
    more = """
    [references.far]
    shape = "sine:low_mm=30,high_mm=40,period_s=20"
    [[disturbances.broken]]
    name = "break_wire"
    at_s = 0.0
    """
    plan = short_campaign(
        run='disturbance = "broken"', vary='[[vary]]\nname = "path"\nreference = ["up", "far"]', more=more
    )
    table, _ = table_of(client, plan, tmp_path / "folder")
    assert list(table["status"]) == ["tripped", "failed"] * 2
    assert list(table["error_type"]) == ["TripError", "ConfigError"] * 2
    assert (table["error"] != "").all()
    assert table["rms_percent"].isna().all()
    assert table["stroke_mm"].notna().all()
    assert list(table["energy_j"].notna()) == [True, False] * 2


def test_run_that_this_machine_could_not_execute_is_repeated(client, short_campaign, tmp_path):
    """The file of the model is missing where the run is executed, as on a machine without the shared disk."""
    plan = short_campaign()
    assert plan.fingerprint
    model = (tmp_path / "wire.json").read_bytes()
    (tmp_path / "wire.json").unlink()
    table, _ = table_of(client, plan, tmp_path / "folder")
    assert set(table["status"]) == {"failed"}
    (tmp_path / "wire.json").write_bytes(model)
    again, finished = table_of(client, plan, tmp_path / "folder", resume=True)
    assert finished == plan.count
    assert set(again["status"]) == {"done"}


@pytest.mark.parametrize(
    ("error", "is_final"),
    [
        (MemoryError(), False),
        (OSError(errno.EIO, "input/output error"), False),
        (ModuleNotFoundError("no module"), False),
        (np.linalg.LinAlgError("singular matrix"), True),
        (ZeroDivisionError(), True),
        (DataError("malformed"), True),
    ],
)
def test_failure_is_final_if_its_error_comes_from_the_run(short_campaign, monkeypatch, error, is_final):
    def failing_row(*_):
        raise error

    monkeypatch.setattr(smadrive.campaigns.experiments.run, "tracking_row", failing_row)
    result = execute(short_campaign().run(0))
    assert (result.row["status"], result.row["error_type"]) == ("failed", type(error).__name__)
    assert result.is_final is is_final
    assert bool(result.effort.trace) is not isinstance(error, DataError)


@pytest.mark.parametrize("identifies", [True, False])
def test_random_wire_that_cannot_have_the_changes_of_the_run_is_a_final_failure(short_campaign, identifies):
    """Only a Preisach wire has a correlation, and the kind of these wires is random."""
    plan = short_campaign(
        run='sim.file = "flexinol-lt-0.38mm"\nrig.limits.current_max_a = 4.0',
        vary="[[vary]]\nsim.transformation.correlation = [0.4, 0.6]\n",
        **({"model": ""} if identifies else {}),
    )
    run = plan.run(0)
    result = execute(run, identify(run) if identifies else None)
    assert (result.row["status"], result.row["error_type"]) == ("failed", "ConfigError")
    assert result.is_final


def test_failure_that_dask_reports_has_its_text_and_is_not_final(client):
    future = client.submit(importlib.import_module, "no_such_module_of_python")
    wait(future)
    result = _result_of(future)
    assert (result.row["status"], result.row["error_type"]) == ("failed", "ModuleNotFoundError")
    assert "no_such_module_of_python" in result.row["error"]
    assert not result.is_final


def test_worker_with_other_versions_executes_no_task(client):
    """A worker can join the cluster after the versions of all others were compared."""
    own = versions()
    assert client.submit(with_versions, own, operator.add, 1, 2).result() == 3
    with pytest.raises(ConfigError) as caught:
        client.submit(with_versions, own | {"numpy": "0.1"}, operator.add, 1, 2).result()
    assert (caught.value.value, caught.value.limit) == (own["numpy"], "0.1")


def test_log_on_a_full_disk_is_one_sentence(short_campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(DataError) as caught:
        logged_run(short_campaign().run(0))
    assert caught.value.cure


@pytest.mark.exhaustive
def test_log_holds_the_model_that_drove_the_wire(short_campaign, tmp_path):
    """The identified wire has another model than the Duhem model that is fitted to its record."""
    heating_c, cooling_c = np.linspace(20.0, 130.0, 200), np.linspace(130.0, 20.0, 200)
    loop_c = np.concatenate((heating_c, cooling_c))
    recorded = DuhemModel.gaussian(
        mu_heating=87, mu_cooling=66, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20.0, 130.0)
    )
    knowledge = WireKnowledge(exact_wire(), loop_c, recorded.simulate(loop_c), {})
    run = short_campaign(run='controller = "duhem-inverse"', model="").run(0)
    tracking_row(run, knowledge, tmp_path / "run.h5")
    log = read_log(tmp_path / "run.h5")
    np.testing.assert_allclose(wire_of(log).model.simulate(loop_c), recorded.simulate(loop_c), atol=0.1)
    assert replay(log).exact


@pytest.mark.exhaustive
def test_run_whose_workers_died_is_not_final():
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster) as client,
    ):
        future = client.submit(os._exit, 1)
        wait(future)
        result = _result_of(future)
    assert (result.row["status"], result.row["error_type"]) == ("failed", "KilledWorker")
    assert not result.is_final


@pytest.mark.exhaustive
def test_noise_is_shared_by_the_runs_of_a_wire_and_changes_with_the_seed(short_campaign):
    plan = short_campaign(vary='[[vary]]\nname = "noise"\nseed = [1, 2]\n')
    first, second = (execute(plan.run(number)).row for number in (0, 1))
    assert first["stroke_mm"] == second["stroke_mm"]
    assert first["rms_percent"] != second["rms_percent"]
    assert execute(replaced(plan.run(1), seed=1)).row == first


def replaced(run, **settings):
    return run._replace(settings=run.settings.model_copy(update=settings))


@pytest.mark.exhaustive
def test_a_worker_imports_nothing_that_draws():
    code = (
        "import sys, smadrive.campaigns.experiments.run\n"
        "print(*{'matplotlib', 'rich', 'typer', 'bokeh', 'pandas', 'smadrive.cli'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_displacement_cannot_come_from_a_resistance_that_is_not_identified(short_campaign):
    plan = short_campaign(run='rig.displacement_from = "resistance"')
    row = execute(plan.run(0)).row
    assert (row["status"], row["error_type"]) == ("failed", "ConfigError")
    assert "displacement_from" in row["error"]


@pytest.mark.exhaustive
def test_displacement_by_the_resistance_follows_a_load(short_campaign):
    more = '[[disturbances.load]]\nname = "step_load"\nat_s = 0.5\nmpa = 60.0\nover_s = 1.0\n'
    sources = '[[vary]]\nrig.displacement_from = ["none", "resistance"]'
    plan = short_campaign(run='disturbance = "load"', vary=sources, more=more, model="")
    without, by_resistance = (execute(plan.run(number)).row["rms_percent"] for number in range(2))
    assert by_resistance < 0.2 * without
