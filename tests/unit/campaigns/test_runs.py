"""The runs of a campaign, on a cluster of one worker in this process."""

import resource
import signal
import subprocess
import sys
from importlib.metadata import version

import pytest
from distributed import Client, LocalCluster

from smadrive.campaigns.execution.journal import JOURNAL, Journal
from smadrive.campaigns.execution.scheduling import groups_of, run_all
from smadrive.campaigns.experiments.run import Effort, RunResult, execute
from smadrive.campaigns.results.table import results_table, write_table
from smadrive.errors import DataError
from smadrive.files.checked_line import checked_line, fields_of_line

RESULT = RunResult({"rms_percent": 0.1 + 0.2, "max_percent": float("nan")}, Effort("", 1.0, 1.0, 0.0, "host:1"))


@pytest.fixture(scope="module")
def client():
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


def table_of(client, plan, folder, *, resume=False):
    with Journal(folder, plan, resume=resume) as journal:
        finished = []
        run_all(client, plan, groups_of(plan, set(journal.results)), journal, finished.append)
        return results_table(plan, journal.results), len(finished)


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


def test_an_interrupted_journal_goes_on(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(1, RESULT)
        journal.add(0, RESULT)
    path = folder / JOURNAL
    path.write_bytes(path.read_bytes()[:-7])  # the last line is cut, as by a kill
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [1]
        assert repr(journal.results[1]) == repr(RESULT)
        journal.add(0, RESULT)
    with Journal(folder, plan, resume=True) as journal:
        assert sorted(journal.results) == [0, 1]


DAMAGED = [
    b"\0" * 200 + b"\n",
    b'{"run": 3, "row"',
    b"\xff\xfe\n",
    b"[1]\n",
    b"[" * 200_000 + b"\n",
    b'{"run": 1, "row": {}, "effort": {}}\n',
]


@pytest.mark.parametrize("damaged", DAMAGED)
def test_damaged_end_of_a_journal_is_repeated(short_campaign, tmp_path, damaged):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
    whole = (folder / JOURNAL).read_bytes()
    (folder / JOURNAL).write_bytes(whole + damaged)
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [0]
    assert (folder / JOURNAL).read_bytes() == whole


def test_changed_digit_of_a_journal_is_damage(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
        first = (folder / JOURNAL).read_bytes()
        journal.add(1, RESULT)
    second = (folder / JOURNAL).read_bytes().removeprefix(first)
    (folder / JOURNAL).write_bytes(first + second.replace(b'"run": 1', b'"run": 2'))
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [0]


@pytest.mark.parametrize("damaged", [lambda _line: b"\0\0\n", lambda line: line[:-1]])
def test_damaged_first_line_is_named(short_campaign, tmp_path, damaged):
    plan = short_campaign()
    with Journal(tmp_path / "whole", plan, resume=False) as journal:
        journal.add(0, RESULT)
    (tmp_path / JOURNAL).write_bytes(damaged((tmp_path / "whole" / JOURNAL).read_bytes().splitlines(keepends=True)[0]))
    with pytest.raises(DataError) as caught, Journal(tmp_path, plan, resume=True):
        pass
    assert caught.value.where == str(tmp_path / JOURNAL)


def test_run_that_a_full_disk_lost_is_not_done(short_campaign, tmp_path):
    plan, folder = short_campaign(), tmp_path / "folder"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        with Journal(folder, plan, resume=False) as journal:
            journal.add(0, RESULT)
            resource.setrlimit(resource.RLIMIT_FSIZE, ((folder / JOURNAL).stat().st_size + 20, hard))
            with pytest.raises(DataError):
                journal.add(1, RESULT)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert list(journal.results) == [0]
    with Journal(folder, plan, resume=True) as journal:
        assert list(journal.results) == [0]


@pytest.mark.parametrize("resume", [False, True])
def test_two_commands_cannot_use_one_folder(short_campaign, tmp_path, resume):
    plan, folder = short_campaign(), tmp_path / "folder"
    with Journal(folder, plan, resume=False) as journal:
        journal.add(0, RESULT)
        with pytest.raises(DataError) as caught, Journal(folder, plan, resume=resume):
            pass
        assert caught.value.where == str(folder)
        journal.add(1, RESULT)
    with Journal(folder, plan, resume=True) as journal:
        assert sorted(journal.results) == [0, 1]


def test_another_campaign_does_not_go_on_in_the_folder(short_campaign, tmp_path):
    folder = tmp_path / "folder"
    with Journal(folder, short_campaign(), resume=False) as journal:
        journal.add(0, RESULT)
    other = short_campaign(run="seed = 8", name="other.toml")
    with pytest.raises(DataError) as caught, Journal(folder, other, resume=True):
        pass
    assert caught.value.where == str(folder)
    with Journal(folder, short_campaign(), resume=True) as journal:
        assert list(journal.results) == [0]


def test_a_campaign_does_not_go_on_with_other_versions(short_campaign, tmp_path):
    folder = tmp_path / "folder"
    with Journal(folder, short_campaign(), resume=False) as journal:
        journal.add(0, RESULT)
    head, *runs = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    fields = fields_of_line(head)
    assert fields["versions"]["numpy"] == version("numpy")
    fields["versions"]["numpy"] = "1.0"
    (folder / JOURNAL).write_bytes(b"".join([checked_line(fields), *runs]))
    with pytest.raises(DataError) as caught, Journal(folder, short_campaign(), resume=True):
        pass
    assert "numpy 1.0" in caught.value.value


def test_a_campaign_without_a_run_leaves_nothing(short_campaign, tmp_path):
    for _ in range(2):
        with Journal(tmp_path / "folder", short_campaign(), resume=False):
            pass
    assert not (tmp_path / "folder").exists()


def test_a_campaign_without_a_run_leaves_the_folder_of_the_user(short_campaign, tmp_path):
    (tmp_path / "folder").mkdir()
    with Journal(tmp_path / "folder", short_campaign(), resume=False):
        pass
    assert list((tmp_path / "folder").iterdir()) == []


def test_resume_needs_a_campaign(short_campaign, tmp_path):
    with pytest.raises(DataError), Journal(tmp_path / "nothing", short_campaign(), resume=True):
        pass


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
