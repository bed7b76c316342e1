"""Files that change while a campaign runs: no run has another content than that at the start."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from exact_wire import exact_wire

from smadrive.campaigns.experiments.run import execute, identify, logged_run
from smadrive.campaigns.plan.files import ChangedFileError, RunFile, content_digest, of_unchanged_files
from smadrive.campaigns.plan.plan import load_plan
from smadrive.errors import DataError
from smadrive.files.csv_table import write_table
from smadrive.files.shipped import configs_dir

TABLE = '[references.table]\nfile = "table.csv"\n'


@pytest.fixture
def campaign(short_campaign, tmp_path):
    """A plan whose runs read a model, a table and a profile in this folder. Its fingerprint was written down."""
    write_table(tmp_path / "table.csv", {}, {"time_s": np.array([0.0, 4.0]), "phase": np.array([0.2, 0.6])})
    rig = (configs_dir() / "rigs" / "in-process.toml").read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(rig.replace('"sma-reference"', '"board.toml"'), encoding="utf-8")
    shutil.copy(configs_dir() / "devices" / "sma-reference.toml", tmp_path / "board.toml")
    plan = short_campaign(run='rig.file = "rig.toml"', vary='[[vary]]\nreference = ["table", "up"]\n', more=TABLE)
    assert plan.fingerprint
    return plan


def append(path, text="\n"):
    with path.open("a", encoding="utf-8") as file:
        file.write(text)


def test_run_with_another_model_than_at_the_start_fails_and_is_repeated(campaign, tmp_path):
    model, wire = (tmp_path / "wire.json").read_bytes(), exact_wire()
    other = replace(wire, heat_balance=replace(wire.heat_balance, latent_heat_j=0.0))
    other.save(tmp_path / "wire.json")
    result = execute(campaign.run(1))
    assert (result.row["status"], result.row["error_type"]) == ("failed", "ChangedFileError")
    assert result.row["error"].startswith("wire.json: ")
    assert not result.is_final
    (tmp_path / "wire.json").write_bytes(model)
    assert execute(campaign.run(1)).row["rms_percent"] > 0.0


@pytest.mark.parametrize("name", ["table.csv", "board.toml"])
@pytest.mark.parametrize("change", [append, lambda path: path.unlink()])
def test_changed_or_missing_file_is_a_failure_that_is_not_final(campaign, tmp_path, name, change):
    change(tmp_path / name)
    result = execute(campaign.run(0))
    assert result.row["error_type"] == "ChangedFileError"
    assert result.row["error"].startswith(f"{name}: ")
    assert not result.is_final
    with pytest.raises(ChangedFileError):
        logged_run(campaign.run(0))


def test_record_that_changes_is_a_failure_that_is_not_final(tmp_path):
    (tmp_path / "a.csv").write_text("temperature_c,displacement_mm\n")
    (tmp_path / "reel.toml").write_text('title = "x"\n[run]\nexperiment = "fit"\n[[vary]]\nrecords = "*.csv"\n')
    plan = load_plan(str(tmp_path / "reel.toml"))
    assert execute(plan.run(0)).is_final
    append(tmp_path / "a.csv")
    result = execute(plan.run(0))
    assert result.row["error_type"] == "ChangedFileError"
    assert not result.is_final


def test_identification_reads_the_profile_alone(short_campaign, campaign, tmp_path):
    """A reference that has changed is no failure of the other runs that need the same wire."""
    limits = "rig.limits.current_max_a = 50.0"  # an error before the first tick
    run = short_campaign(run=f'rig.file = "rig.toml"\n{limits}', model="").run(0)
    assert identify(run).is_final
    append(tmp_path / "table.csv")
    assert identify(run).is_final
    append(tmp_path / "board.toml")
    assert not identify(run).is_final


def test_changed_sim_file_does_not_change_later_runs(short_campaign, tmp_path):
    sim = tmp_path / "sim.toml"
    shutil.copy(configs_dir() / "sims" / "flexinol-lt-0.15mm.toml", sim)
    vary = "[[vary]]\nsim.thermocouple.noise_c = {low = 0.1, high = 0.4, number = 1100}\n"  # more than a plan keeps
    plan = short_campaign(run='sim.file = "sim.toml"', vary=vary)
    assert plan.fingerprint
    text = sim.read_text(encoding="utf-8")
    sim.write_text(text.replace("stroke_mm = 12.0", "stroke_mm = 11.0"), encoding="utf-8")
    assert [plan.run(number).documents.sim.wire.stroke_mm for number in range(2)] == [12.0, 12.0]


@pytest.mark.parametrize("error", [None, DataError("malformed")])
def test_file_that_changes_while_a_task_reads_it_is_an_error(tmp_path, error):
    path = tmp_path / "file"
    path.touch()
    files = (RunFile(str(path), content_digest(path)),)

    def task():
        append(path)
        if error is not None:
            raise error

    with pytest.raises(ChangedFileError) as caught:
        of_unchanged_files(files, task)
    assert caught.value.where == str(path)
    assert caught.value.value != caught.value.limit
