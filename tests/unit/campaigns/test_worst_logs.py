"""The logs of the worst runs of a campaign. An error costs a log, and not the report."""

import pytest
from distributed import Client, LocalCluster
from exact_wire import exact_wire

from smadrive.campaigns.campaign import LOGS, conduct, worst_numbers, write_worst_logs
from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.execution.scheduling import groups_of
from smadrive.campaigns.experiments.run import execute
from smadrive.campaigns.results.table import results_table

AXIS = '[[vary]]\nmodel = ["wire.json", "other.json"]\n[report]\nworst_logs = 4\n'


@pytest.fixture
def client():
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster, set_as_default=False) as client,  # a default one that a test closes stays in Dask's settings
    ):
        yield client


@pytest.fixture
def plan(short_campaign, tmp_path):
    """The plan of four runs. Runs 1 and 3 need other.json."""
    exact_wire().save(tmp_path / "other.json")
    return short_campaign(model="", vary=AXIS)


class Recorded:
    """The progress of a campaign as a list. `before_logs` is called before the logs of the worst runs."""

    def __init__(self, before_logs):
        self.events, self.before_logs = [], before_logs

    def finished(self, result):
        self.events.append("run")

    def begin(self, step, count):
        self.events.append(f"{step} {count}")
        if "logs" in step:
            self.before_logs()

    def advance(self):
        self.events.append("part")


def spoil(folder, logs):
    """Remove a model that two runs need, and leave files of an earlier command and of a user."""
    (folder / "other.json").unlink()
    logs.mkdir()
    (logs / "run-17.h5").write_text("earlier")
    (logs / "notes.txt").write_text("of the user")


@pytest.mark.exhaustive
def test_log_that_fails_is_a_reason_and_the_report_is_written(client, plan, tmp_path):
    """A log of an earlier command is removed: a run that was repeated may have changed the order of the worst runs."""
    logs = tmp_path / "folder" / LOGS
    progress = Recorded(lambda: spoil(tmp_path, logs))
    with Journal(tmp_path / "folder", plan, resume=False) as journal:
        result = conduct(client, plan, groups_of(plan, set()), journal, progress)
    assert progress.events == ["run"] * 4 + ["logs of the worst runs 4"] + ["part"] * 4 + ["report 1"]
    assert set(result.table["status"]) == {"done"}
    assert set(result.logs.missing) == {1, 3}
    assert all("other.json" in reason for reason in result.logs.missing.values())
    assert result.logs.files == {0: logs / "run-0.h5", 2: logs / "run-2.h5"}
    assert {path.name for path in logs.iterdir()} == {"run-0.h5", "run-2.h5", "notes.txt"}
    page = result.report_file.read_text()
    assert ("Run 0: tracking" in page, "Run 1: tracking" in page) == (True, False)


@pytest.mark.exhaustive
@pytest.mark.parametrize("cause", ["no scheduler", "a file in place of the folder"])
def test_error_that_stops_all_logs_is_the_reason_of_each(client, plan, tmp_path, cause):
    table = results_table(plan, {number: execute(plan.run(number)) for number in range(plan.count)})
    if cause == "no scheduler":
        client.close()
    else:
        (tmp_path / LOGS).write_text("a file")
    logs = write_worst_logs(client, plan, worst_numbers(plan, table), tmp_path / LOGS, lambda: None)
    assert sorted(logs.missing) == [0, 1, 2, 3]
    assert all(logs.missing.values())
    assert logs.files == {}
