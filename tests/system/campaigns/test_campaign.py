"""`smadrive campaign`: the same table for any number of workers, after kills and interruptions; mistakes."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from distributed import Client

from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.series import energy_j

pytestmark = pytest.mark.exhaustive


def test_the_table_does_not_depend_on_workers_kills_and_interruptions(campaign):
    whole = campaign.run("one-worker", "--workers", "1")
    assert (whole["runs"], whole["tripped"], whole["failed"]) == (20, 0, 0)

    process = campaign.start("killed-worker", "--workers", "2")
    campaign.wait_for_runs(process, "killed-worker", 3)
    for worker in campaign.workers_of(process):
        worker.kill()
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert whole["sha256"] in out

    process = campaign.start("interrupted", "--workers", "2")
    campaign.wait_for_runs(process, "interrupted", 3)
    campaign.workers_of(process)
    os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C in a terminal, which reaches the workers, too
    out, err = process.communicate()
    assert process.returncode == 130
    assert "campaign.toml -o interrupted --resume --workers 2 --json`" in err
    assert "Traceback" not in err
    assert campaign.run("interrupted", "--resume", "--workers", "3")["sha256"] == whole["sha256"]

    process = campaign.start("killed", "--workers", "2")
    campaign.wait_for_runs(process, "killed", 3)
    campaign.workers_of(process)
    process.kill()
    process.communicate()
    assert campaign.run("killed", "--resume")["sha256"] == whole["sha256"]


def test_the_worst_logs_are_those_of_their_runs(campaign):
    result = campaign.run("folder")
    table = campaign.table("folder").set_index("run")
    numbers = list(map(int, result["log_files"]))
    assert numbers == list(table["rms_percent"].sort_values(ascending=False).index[:2])
    for number, path in result["log_files"].items():
        log, row = read_log(campaign.folder / path), table.loc[int(number)]
        time_s, current_a, voltage_v = map(log.column, ("time_s", "current_a", "voltage_v"))
        assert energy_j(time_s, current_a, voltage_v) == row["energy_j"]  # it differs if the noise does
        assert np.nanmax(current_a) == row["current_max_a"]
        assert time_s.size == row["ticks"]
        assert log.text("title").startswith(f"run {number} ")
    page = (campaign.folder / result["report_file"]).read_text()
    assert all(f"Run {number}: tracking" in page for number in numbers)


@pytest.fixture
def scheduler(tmp_path):
    """A cluster that the command does not own: its address, and its scheduler's process.

    `start(port, environment)`: the workers have these further variables in their environment.
    """
    processes = []

    def start(port, environment=None):
        address = f"tcp://127.0.0.1:{port}"
        command = (sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port))
        processes.append(subprocess.Popen([*command, "--no-dashboard"], stderr=subprocess.DEVNULL, cwd=tmp_path))
        worker = (sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard")
        options = {"stderr": subprocess.DEVNULL, "cwd": tmp_path, "env": os.environ | (environment or {})}
        processes.append(subprocess.Popen([*worker, "--nworkers", "2"], **options))
        with Client(address, timeout=120) as client:
            client.wait_for_workers(2)
        return address, processes[-2]

    yield start
    for process in reversed(processes):
        process.terminate()
    for process in processes:
        process.wait()


def test_a_campaign_goes_on_after_its_scheduler_was_killed(campaign, scheduler, free_port):
    address, scheduler_process = scheduler(free_port())
    process = campaign.start("folder", "--scheduler", address)
    campaign.wait_for_runs(process, "folder", 3)
    scheduler_process.kill()
    _, err = process.communicate()
    assert process.returncode == 3
    assert f"--resume --scheduler {address}" in err
    assert "Traceback" not in err
    resumed = campaign.run("folder", "--resume")
    assert resumed["sha256"] == campaign.run("whole")["sha256"]


@pytest.mark.filterwarnings("ignore:Mismatched versions")  # the client of this test sees it, too
@pytest.mark.parametrize("package", ["numpy", "distributed"])
def test_workers_with_another_version_of_a_package_are_refused(campaign, scheduler, free_port, tmp_path, package):
    installed = tmp_path / "other" / f"{package}-1.0.dist-info"
    installed.mkdir(parents=True)
    (installed / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    path = os.pathsep.join((str(installed.parent), os.environ.get("PYTHONPATH", "")))
    address, _ = scheduler(free_port(), {"PYTHONPATH": path})
    process = campaign.start("folder", "--scheduler", address)
    _, err = process.communicate()
    assert process.returncode == 2
    assert package in err
    assert "1.0" in err
    assert "Traceback" not in err
    assert not (campaign.folder / "folder").exists()


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (("--scheduler", "tcp://127.0.0.1:1"), 3),
        (("--scheduler", "nowhere"), 2),
        (("--scheduler", "tcp://127.0.0.1:1", "--workers", "2"), 2),
        (("--resume",), 2),
    ],
)
def test_a_mistake_is_one_sentence_and_loses_nothing(campaign, options, code):
    (campaign.folder / "folder").mkdir()
    (campaign.folder / "folder" / "mine.txt").write_text("kept")
    process = campaign.start("new" if "--resume" in options else "other", *options)
    _, err = process.communicate()
    assert process.returncode == code
    assert "Traceback" not in err
    assert (campaign.folder / "folder" / "mine.txt").read_text() == "kept"
    assert not list((campaign.folder).glob("other/*"))


def test_a_folder_with_files_is_left_alone(campaign):
    (campaign.folder / "folder").mkdir()
    (campaign.folder / "folder" / "mine.txt").write_text("kept")
    process = campaign.start("folder")
    _, err = process.communicate()
    assert process.returncode == 2
    assert "--resume" in err
    assert [path.name for path in (campaign.folder / "folder").iterdir()] == ["mine.txt"]
