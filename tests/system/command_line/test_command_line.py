"""The commands as a user types them: files in, files out, and one line for each error."""

import json
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import programs
import pytest

from smadrive.cli.views.fit_view import certificate_rows
from smadrive.control.references.shapes import SHAPES
from smadrive.hysteresis import DuhemModel, save_model
from smadrive.hysteresis.certificate import Certificate
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_metadata import excitation_of
from smadrive.safety.shutdown import CONFIRMED

ROOT = Path(__file__).parents[3]
CONFIGS = ROOT / "configs"
SHARED = ROOT.parent / "shared" / "data"
LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=-0.04, offset=0.04, input_range=(20, 140)
)


def smadrive(*arguments, cwd, stdout=subprocess.PIPE, env=None, is_from_scratch=False):
    command = [sys.executable, "-m", "smadrive", *map(str, arguments)]
    run = subprocess.run if is_from_scratch else programs.run
    return run(command, cwd=cwd, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False, env=env)


def succeed(*arguments, cwd):
    done = smadrive(*arguments, "--json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def data(tmp_path):
    """A CSV with an extra column; its output falls with the input and has reversals."""
    sweep = np.concatenate(
        [np.linspace(a, b, 150) for a, b in [(25, 130), (130, 75), (75, 95), (95, 40), (40, 130), (130, 25)]]
    )
    rows = [f"{t},{y},x" for t, y in zip(sweep, LOOP.simulate(sweep), strict=True)]
    (tmp_path / "wire.csv").write_text("temperature_c,strain,note\n" + "\n".join(rows) + "\n")
    return tmp_path


def test_identify_simulate_and_invert_work_on_files(data):
    found = succeed("identify", "wire.csv", "--output", "strain", "-o", "model.json", cwd=data)
    assert {"kind", "rules", "memory", "rms_percent", "max_percent", "model_file", "certificate"} <= found.keys()
    assert found["rules"] == 22
    assert found["rms_percent"] < 1.0
    assert found["certificate"]["holds"] is True
    assert found["memory"]["sets"] == 1

    plotted = succeed(
        "identify",
        "wire.csv",
        "--output",
        "strain",
        "--kind",
        "duhem",
        "-o",
        "duhem.json",
        "--plot",
        "fit.html",
        cwd=data,
    )
    assert plotted["plot_file"] == "fit.html"
    page = (data / "fit.html").read_text()
    assert page.count("<img") == 2
    assert "with standard errors" in page

    simulated = succeed("simulate", "model.json", "wire.csv", "--output", "strain", "-o", "simulated.csv", cwd=data)
    assert "'strain' replaces" in simulated["caveats"][0]
    header = (data / "simulated.csv").read_text().splitlines()[0]
    assert header == "temperature_c,note,strain"

    inverted = succeed("invert", "model.json", "simulated.csv", "--output", "strain", "-o", "inverted.csv", cwd=data)
    assert inverted["unreachable"] == 0
    twice = succeed("invert", "model.json", "inverted.csv", "--output", "strain", "-o", "twice.csv", cwd=data)
    assert [len(one["caveats"]) for one in (inverted, twice)] == [1, 2]  # `temperature_c`, then `reachable`, too
    again = succeed("simulate", "model.json", "inverted.csv", "--output", "again", "-o", "again.csv", cwd=data)
    assert not again["caveats"]
    expected, got = (column(data / "again.csv", name) for name in ("strain", "again"))
    np.testing.assert_allclose(got, expected, atol=1e-8 * 0.04)


def test_input_outside_the_range_of_the_model_is_a_caveat_of_simulate(data):
    save_model(LOOP, data / "loop.json")
    (data / "partly.csv").write_text("temperature_c\n30\n393\n")
    simulated = succeed("simulate", "loop.json", "partly.csv", "-o", "partly-simulated.csv", cwd=data)
    (caveat,) = simulated["caveats"]
    assert caveat.endswith("1 value of the input")


@pytest.mark.exhaustive
def test_column_in_another_unit_is_a_caveat_of_fit_model_and_page(data):
    lines = (data / "wire.csv").read_text().splitlines()[1:]
    cells = [line.split(",") for line in lines]
    rows = [f"{float(celsius) + 273.15},{strain}" for celsius, strain, _ in cells]
    (data / "other.csv").write_text("temperature_c,displacement_mm\n" + "\n".join(rows) + "\n")
    found = succeed("identify", "other.csv", "-o", "other.json", "--plot", "other.html", cwd=data)
    kelvin, metres = found["caveats"]
    assert "looks like kelvin" in kelvin
    assert "looks like metres" in metres
    assert json.loads((data / "other.json").read_text())["provenance"]["caveats"] == [kelvin, metres]
    page = (data / "other.html").read_text()
    assert kelvin in page
    assert metres in page
    assert succeed("identify", "wire.csv", "--output", "strain", "-o", "strain.json", cwd=data)["caveats"] == []


def column(path, name):
    lines = [line.split(",") for line in path.read_text().splitlines()]
    at = lines[0].index(name)
    return np.array([float(line[at]) for line in lines[1:]])


@pytest.mark.exhaustive
def test_duhem_model_has_no_rules(data):
    found = succeed("identify", "wire.csv", "--output", "strain", "--kind", "duhem", "-o", "model.json", cwd=data)
    assert found["kind"] == "duhem"
    assert found["rules"] == 0
    assert found["rms_percent"] < 1.0


@pytest.mark.exhaustive
def test_duhem_model_has_the_given_number_of_gaussians_per_branch(data):
    fit = ("identify", "wire.csv", "--output", "strain", "-o", "model.json", "--kind", "duhem")
    for options, count in ((), 2), (("--components", "1"), 1):
        assert succeed(*fit, *options, cwd=data)["rms_percent"] < 1.0
        model = json.loads((data / "model.json").read_text())
        assert len(model["heating"]["weights"]) == len(model["cooling"]["weights"]) == count


def test_every_figure_of_a_certificate_has_a_meaning_and_a_verdict():
    good = {name: (value, note) for name, value, note in certificate_rows(LOOP.certificate())}
    assert list(good) == ["contraction", "left after a loop", "bounded", "invertible", "turns back", "certified"]
    assert all(len(note) > 20 for _, note in good.values())
    assert "good: an initial error decays" in good["contraction"][1]
    assert good["certified"] == ("yes", "may drive a feedforward")
    bad = {name: (value, note) for name, value, note in certificate_rows(Certificate(-0.1, 2.0, False, 0.5, 0.3))}
    assert "not above 0, bad" in bad["contraction"][1]
    assert bad["bounded"] == ("no", "bad: the output leaves the stroke")
    assert "a branch reverses by 30 %" in bad["certified"][1]


@pytest.mark.exhaustive
@pytest.mark.parametrize("stress", ["100MPa", "172MPa"])
def test_measured_flexinol_is_identified(tmp_path, stress):
    source = SHARED / "flexinol_isobaric" / f"{stress}.csv"
    if not source.exists():
        pytest.skip("measured wires are not on this machine")
    found = succeed("identify", source, "--output", "strain", "-o", "model.json", cwd=tmp_path)
    assert found["rules"] == 22
    assert found["rms_percent"] <= 1.0


def test_probe_and_off_answer_in_json(tmp_path):
    probed = succeed("probe", "in-process", cwd=tmp_path)
    assert probed["temperature_c"] == pytest.approx(22.0, abs=1.0)
    assert probed["device_faults"] == []
    assert succeed("off", "in-process", cwd=tmp_path)["safe"] is True


@pytest.fixture
def track(tmp_path):
    """A function that tracks a reference on the in-process rig. It returns the JSON result of `run`, and the log."""
    wire = DuhemModel.gaussian(
        mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
    )
    save_model(wire, tmp_path / "wire.json")

    def track(reference, *options, rig="in-process"):
        run = ("run", rig, "--model", "wire.json", "--reference", reference, "-o", "run.h5", *options)
        return succeed(*run, cwd=tmp_path), read_log(tmp_path / "run.h5")

    return track


def test_run_reports_the_caveats_of_its_model(track, tmp_path):
    document = json.loads((tmp_path / "wire.json").read_text())
    document["provenance"]["caveats"] = ["it misses its own record"]
    (tmp_path / "wire.json").write_text(json.dumps(document))
    ran, log = track("sine:low_mm=4,high_mm=5,period_s=20,cycles=1")
    assert ran["caveats"] == log.json("caveats") == ["wire.json: it misses its own record"]


def test_run_warns_of_a_reference_within_the_noise(track):
    ran, _ = track("sine:low_mm=0.002,high_mm=0.009,period_s=5,cycles=1")
    assert "is it in mm?" in ran["caveats"][0]


@pytest.mark.exhaustive
def test_smoothed_run_reports_its_distance_from_the_given_reference_and_logs_it(track, tmp_path, identified):
    (tmp_path / "wire.json").write_bytes(identified.wire_file.read_bytes())
    ran, log = track("sine:low_mm=2,high_mm=9,period_s=3.5,cycles=2", "--smooth")
    caveat = re.match(r"the reference was smoothed, .* the error is ([\d.]+) mm \(\d\d %", ran["caveats"][0])
    assert ran["rms_percent"] < 1.0
    given, run = (log.json(name) for name in ("given_reference", "reference"))
    given_mm = np.interp(run["times_s"], given["times_s"], given["displacement_mm"])
    distance_mm = np.abs(given_mm - run["displacement_mm"]).max()
    assert distance_mm > 1.0
    assert distance_mm == pytest.approx(float(caveat[1]), abs=0.1)


@pytest.mark.exhaustive
def test_tripped_run_prints_its_metrics_until_the_trip_and_the_trip(track, tmp_path):
    ran, _ = track(ANY_SINE)
    assert ran["tripped"] is None
    tight = "watchdog_s = 0.5\ndisplacement_max_mm = 9.0"  # the noise at the top of the reference exceeds it
    (tmp_path / "tight.toml").write_text(rig_text("watchdog_s = 0.5", tight, rig="in-process"))
    run = ("run", "tight.toml", "--model", "wire.json", "--reference", ANY_SINE, "-o", "short.h5")
    done = smadrive(*run, "--json", cwd=tmp_path)
    assert done.returncode == 4, done.stderr
    result, log = json.loads(done.stdout), read_log(tmp_path / "short.h5")
    assert result.keys() == ran.keys()
    assert result["trips"] == 1
    assert result["tripped"].startswith("fault 11:")
    assert result["tripped"] in done.stderr
    assert result["ticks"] == log.column("time_s").size < ran["ticks"]
    assert 0.0 < result["rms_percent"] < 2.0
    with Path("/dev/full").open("w") as full:
        unread = smadrive(*run[:-1], "unread.h5", "--json", cwd=tmp_path, stdout=full)
    assert unread.returncode == 4
    tripped, outcome = unread.stderr.splitlines()
    assert "fault 11" in tripped
    assert CONFIRMED in outcome


@pytest.mark.parametrize("limit", ["displacement_max_mm = 5.0", "displacement_min_mm = 5.0"])
def test_tripped_excitation_prints_its_metrics_until_the_trip_and_the_trip(limit, tmp_path):
    (tmp_path / "tight.toml").write_text(rig_text("watchdog_s = 0.5", f"watchdog_s = 0.5\n{limit}", rig="in-process"))
    done = smadrive("excite", "tight.toml", "-o", "short.h5", "--json", cwd=tmp_path)
    assert done.returncode == 4, done.stderr
    result = json.loads(done.stdout)
    assert (result["trips"], result["ticks"]) == (1, read_log(tmp_path / "short.h5").column("time_s").size)
    assert result["tripped"].startswith("fault 11:")
    assert result["tripped"] in done.stderr
    assert (result["plan"], result["reversal_curves"]) == ("nested", 20)


@pytest.mark.exhaustive
def test_excitation_is_announced_with_plan_curves_and_duration(tmp_path):
    planned = 'rate_c_per_s = 6.0\nplan = "forc"\nduration_s = 300.0'
    (tmp_path / "forc.toml").write_text(rig_text("rate_c_per_s = 6.0", planned, rig="in-process"))
    done = smadrive("excite", "forc.toml", "-o", "forc.h5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    excitation = excitation_of(read_log(tmp_path / "forc.h5"))
    assert excitation.plan == "forc"
    assert excitation.duration_s <= 300.0
    announced = done.stdout.splitlines()[1]
    assert re.findall(r"forc|\d+", announced) == [
        "forc",
        str(excitation.reversal_curves),
        f"{excitation.duration_s:.0f}",
    ]


@pytest.mark.exhaustive
def test_run_warns_that_only_tune_adapts_the_rules(track, tmp_path):
    adapting = rig_text("[excitation]", "[feedback]\nadapt = true\n\n[excitation]", rig="in-process")
    (tmp_path / "adapting.toml").write_text(adapting)
    ran, log = track("sine:low_mm=2,high_mm=9,period_s=20,cycles=1", rig="adapting.toml")
    assert "only in `smadrive tune`" in ran["caveats"][0]
    assert log.json("caveats") == ran["caveats"]


@pytest.mark.exhaustive
@pytest.mark.parametrize("encoding", ["ascii", "ascii:strict"])
def test_output_in_another_encoding_has_substitutes(tmp_path, encoding):
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    probed = smadrive("probe", "in-process", cwd=tmp_path, env=environment, is_from_scratch=True)
    assert probed.returncode == 0, probed.stderr
    assert probed.stderr == ""
    assert "deg C" in probed.stdout
    table = [line for line in probed.stdout.splitlines() if line[0] in "+|"]
    assert len({len(line) for line in table}) == 1
    assert len(table) > 6


@pytest.mark.exhaustive
@pytest.mark.parametrize("argument", ["nosüch", b"nos\xfcch"])
def test_error_in_ascii_has_substitutes(tmp_path, argument):
    command = [sys.executable, "-m", "smadrive", "probe", argument]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False, env=environment)
    assert done.returncode == 2
    assert done.stderr.startswith(b"smadrive: 'nos")
    assert b"neither a .toml file nor one of the shipped rigs" in done.stderr
    assert b"Traceback" not in done.stderr


def test_version_is_printed(tmp_path):
    assert smadrive("--version", cwd=tmp_path).stdout == f"smadrive {version('smadrive')}\n"


def test_help_of_run_names_every_shape_of_reference(tmp_path):
    help_text = smadrive("run", "--help", cwd=tmp_path).stdout
    assert all(shape in help_text for shape in SHAPES)


def rig_text(old, new, rig="simulated"):
    """Return the text of a shipped rig file in which one text is replaced."""
    text = (CONFIGS / "rigs" / f"{rig}.toml").read_text()
    assert old in text
    return text.replace(old, new)


ANY_SINE = "sine:low_mm=2,high_mm=9,period_s=56"
FAR = "sine:low_mm=2,high_mm=30,period_s=56"
FAST = "trapezoid:low_mm=0.01,high_mm=0.03,rise_s=0.5"
RUN = ("run", "in-process", "-o", "l.h5")
WIRE, BOARD, SIM = (
    CONFIGS / f"{name}.toml"
    for name in ("wires/flexinol-lt-0.15mm", "devices/sma-reference", "sims/flexinol-lt-0.15mm")
)
A_RIG = "Give a rig file (.toml), or the name of a shipped one: bench-supply, in-process, simulated, tclab."
FLAT = "sine:low_mm=5,high_mm=5,period_s=20"
WARM = ("--output", "temperature_c", "-o")
STRAIN = ("--output", "strain", "-o", "m.json")
WRONG = [
    # name of the case, command, exit code, a part of the line on stderr
    ("missing file", ("identify", "absent.csv", "-o", "m.json"), 2, "absent.csv: no such file"),
    ("missing column", ("identify", "wire.csv", "-o", "m.json"), 2, "no column 'displacement_mm'"),
    ("text in a cell", ("identify", "text.csv", *STRAIN), 2, "line 3, column 'strain': 'high'"),
    ("nan in a cell", ("identify", "nan.csv", *STRAIN), 2, "line 3, column 'strain': 'nan'"),
    ("Gaussians of a fuzzy model", ("identify", "wire.csv", *STRAIN, "--components", "2"), 2, "only a Duhem model has"),
    ("fuzzy sets of a Duhem model", ("identify", "wire.csv", *STRAIN, "--kind", "duhem", "--sets", "7"), 2, "--sets:"),
    ("too few fuzzy sets", ("identify", "wire.csv", *STRAIN, "--sets", "-3"), 2, "out of range (-3, limit 3 to"),
    ("no cycle", (*RUN, "--model", "loop.json", "--reference", ANY_SINE, "--repeat", "0"), 2, "(0, limit at least 1)"),
    ("no port", ("tune", "in-process", "--model", "loop.json", "--port", "99999"), 2, "(99999, limit 0 to 65535)"),
    ("an output out of reach", ("invert", "loop.json", "wire.csv", *WARM, "o.csv"), 2, "reaches no value"),
    ("equal levels", (*RUN, "--model", "loop.json", "--reference", FLAT), 2, "high_mm: the levels are equal (5 mm)."),
    ("a decimal comma in a shape", (*RUN, "--model", "loop.json", "--reference", "sine:low_mm=1,5"), 2, "Write 1.5"),
    ("columns of a log", ("identify", "kept.h5", *STRAIN), 2, "kept.h5: the columns of a log cannot be chosen (strain"),
    ("constant input", ("identify", "flat.csv", *STRAIN), 5, "constant"),
    ("an input in kelvin", ("simulate", "loop.json", "kelvin.csv", "-o", "o.csv"), 2, "describes no value of"),
    ("no such model", ("simulate", "absent.json", "wire.csv", "-o", "o.csv"), 2, "absent.json"),
    ("a model that is no JSON", ("simulate", "text.md", "wire.csv", "-o", "o.csv"), 2, "text.md: not a JSON file"),
    ("unwritable model", ("identify", "wire.csv", "--output", "strain", "-o", "no/m.json"), 2, "no/m.json"),
    ("unknown rig", ("probe", "nosuch"), 2, "'nosuch': neither a .toml file nor one of the shipped rigs"),
    ("missing rig", ("probe", "absent.toml"), 2, "absent.toml: no such file"),
    ("unknown key", ("probe", "key.toml"), 2, "limits.curent_max_a: unknown key; did you mean 'current_max_a'?"),
    ("limits that contradict", ("probe", "limits.toml"), 2, "must be below limits.temperature_max_c = 110"),
    ("milliamperes", ("probe", "milli.toml"), 2, "limits.current_max_a is far above"),
    ("a decimal comma", ("probe", "comma.toml"), 2, "line 4: a number has a decimal comma (20,0). Write 20.0."),
    ("a missing quote", ("probe", "unquoted.toml"), 2, 'a quote is missing (wire = "flexinol-lt-0.15mm). Put the te'),
    ("a wire in metres", ("probe", "metres.toml"), 2, "is not allowed; write 0.01 or more"),
    ("a number in quotes", ("probe", "quoted.toml"), 2, "limits: current_max_a = '0.6': put a number there, without"),
    ("a model that is a log", (*RUN, "--model", "kept.h5", "--reference", ANY_SINE), 2, "kept.h5: is a log, and a mod"),
    ("a model that is a rig", (*RUN, "--model", "rig.toml", "--reference", ANY_SINE), 2, "rig.toml: is a rig file, a"),
    ("a reference that is a log", (*RUN, "--model", "loop.json", "--reference", "kept.h5"), 2, "is a log, and a table"),
    ("a rig that is a wire", ("probe", WIRE), 2, f"is a wire file, and a rig file is needed here. {A_RIG}"),
    ("a rig that is a model", ("probe", "loop.json"), 2, "loop.json: is a model file, and a rig file is needed here"),
    ("a wire's name for a rig", ("probe", "flexinol-lt-0.15mm"), 2, "It is the name of a wire file and a simulat"),
    ("a misspelt rig", ("probe", "simulatd"), 2, "simulated, tclab). Did you mean 'simulated'?"),
    ("a log that is a model", ("report", "loop.json"), 2, "loop.json: is a model file, and a log is needed"),
    ("a log that is a page", ("report", "page.html"), 2, "page.html: is a page (HTML), and a log is needed here. Give"),
    ("a key of no reference", (*RUN, "--model", "loop.json", "--reference", "sine:low=2"), 2, "unknown key 'low'; did"),
    ("a model that is absent", (*RUN, "--model", "no.json", "--reference", ANY_SINE), 2, "no.json: no such file"),
    ("unknown wire", ("probe", "wire.toml"), 2, "'nitinol': neither a .toml file nor one of the shipped wires"),
    ("no device there", ("probe", "port.toml"), 3, "/dev/ttyNONE: no such port"),
    ("another device", ("probe", "other.toml"), 3, "is not of the type 'sma-reference' (device_id = 21325"),
    ("beyond the stroke", (*RUN, "--model", "loop.json", "--reference", FAR), 2, "limit 0 to 0.04 mm"),
    ("beyond cooling", (*RUN, "--model", "loop.json", "--reference", FAST), 2, "cools no faster. Check that the model"),
    ("model is a folder", ("identify", "wire.csv", *STRAIN[:-1], "folder.json"), 2, "folder.json: cannot be written"),
    ("log in no folder", ("excite", "in-process", "-o", "no/l.h5"), 2, "no/l.h5: cannot be written"),
    ("a log with the name of a table", ("excite", "in-process", "-o", "l.csv"), 2, "the name of a log ends in .h5"),
    ("a log over a log", ("excite", "in-process", "-o", "kept.h5"), 2, "kept.h5: exists, and a record is never"),
    ("a run over a log", (*RUN[:-1], "kept.h5", "--reference", ANY_SINE), 2, "kept.h5: exists, and a record is never"),
    ("a page over its log", ("report", "kept.h5", "-o", "kept.h5"), 2, "the name of a page (HTML) ends in .html"),
    ("a page over its log, linked", ("report", "kept.h5", "-o", "link.html"), 2, "link.html: is an input"),
    ("a model over its data", ("identify", "wire.csv", *STRAIN[:-1], "wire.csv"), 2, "a model file ends in .json"),
    ("a table over its input", ("simulate", "loop.json", "wire.csv", "-o", "wire.csv"), 2, "wire.csv: is an input"),
    ("a table over its input", ("invert", "loop.json", "wire.csv", "-o", "./wire.csv"), 2, "wire.csv: is an input"),
    ("data that is a page", ("identify", "link.html", *STRAIN), 2, "link.html: neither a log nor a CSV"),
    ("a demo among other files", ("demo", "-o", "."), 2, "is not empty"),
    ("tuning in virtual time", ("tune", "in-process", "--model", "loop.json"), 2, "the time of sim:// is virtual"),
    ("a model too long for the page", ("tune", "in-process", "--model", "long.json"), 2, "long.json: too long for"),
    ("tuning without a resistance", ("tune", "by.toml", "--model", "loop.json"), 2, "the model file has no resistance"),
    ("no model", (*RUN, "--reference", ANY_SINE), 2, "names no model"),
    ("a rig that is a pipe", ("probe", "pipe.toml"), 2, "pipe.toml: is a pipe, not a regular file. Give"),
    ("an endless table", ("simulate", "loop.json", "/dev/zero", "-o", "o.csv"), 2, "/dev/zero: is a device, not a reg"),
    ("a log that is a folder", ("report", "folder.json"), 2, "folder.json: is a folder, not a regular file"),
    ("a log that is this folder", ("report", "."), 2, ".: is a folder, not a regular file"),
    ("a reference that is a pipe", (*RUN, "--model", "loop.json", "--reference", "pipe.csv"), 2, "is a pipe, not"),
    ("no log to replay", ("replay", "absent.h5"), 2, "absent.h5: no such file"),
    ("a log that is a table", ("replay", "wire.csv"), 2, "wire.csv: is a table (CSV), and a log is needed here"),
    ("unknown option", ("probe", "in-process", "--nosuch"), 2, "No such option"),
    ("no command", ("prob",), 2, "No such command"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "code", "part"), [case[1:] for case in WRONG], ids=[case[0] for case in WRONG])
def test_error_is_one_line_with_its_exit_code_and_writes_nothing(data, arguments, code, part):
    (data / "text.csv").write_text("temperature_c,strain\n20,0.04\n21,high\n")
    (data / "nan.csv").write_text("temperature_c,strain\n20,0.04\n21,nan\n")
    (data / "flat.csv").write_text("temperature_c,strain\n" + "20,0.04\n" * 100)
    (data / "kelvin.csv").write_text("temperature_c\n293\n393\n")
    (data / "key.toml").write_text(rig_text("current_max_a", "curent_max_a"))
    (data / "milli.toml").write_text(rig_text("current_max_a = 0.6", "current_max_a = 600"))
    (data / "quoted.toml").write_text(rig_text("current_max_a = 0.6", "current_max_a = '0.6'"))
    (data / "comma.toml").write_text(rig_text("rate_hz = 20.0", "rate_hz = 20,0"))
    (data / "unquoted.toml").write_text(rig_text('"flexinol-lt-0.15mm"', '"flexinol-lt-0.15mm'))
    (data / "metres.toml").write_text(rig_text('"flexinol-lt-0.15mm"', '"metres-wire.toml"'))
    wire = (CONFIGS / "wires" / "flexinol-lt-0.15mm.toml").read_text()
    (data / "metres-wire.toml").write_text(wire.replace("diameter_mm = 0.15", "diameter_mm = 0.15e-3"))
    (data / "limits.toml").write_text(rig_text("temperature_max_c = 135.0", "temperature_max_c = 110.0"))
    by_resistance = 'rate_hz = 20.0\ndisplacement_from = "resistance"'
    (data / "by.toml").write_text(rig_text("rate_hz = 20.0", by_resistance, rig="in-process"))
    (data / "rig.toml").write_text((CONFIGS / "rigs" / "simulated.toml").read_text())
    (data / "text.md").write_text("# Notes\n\nNo, nothing.\n")
    (data / "wire.toml").write_text(rig_text('"flexinol-lt-0.15mm"', '"nitinol"'))
    (data / "port.toml").write_text(rig_text("/tmp/smadrive-sim", "/dev/ttyNONE"))  # noqa: S108
    (data / "other.toml").write_text(
        rig_text('profile = "sma-reference"', 'profile = "board.toml"', rig="in-process").replace(
            '0.15mm"\nunit', '0.15mm?profile=sma-reference"\nunit'
        )
    )
    board = (CONFIGS / "devices" / "sma-reference.toml").read_text()
    (data / "board.toml").write_text(board.replace("[[0x534D, 0x534D]]", "[[7, 7]]"))
    (data / "folder.json").mkdir()
    for name in ("pipe.toml", "pipe.csv"):
        os.mkfifo(data / name)
    (data / "kept.h5").write_bytes(b"\x89HDF\r\n\x1a\n, a record")
    (data / "link.html").symlink_to(data / "kept.h5")
    (data / "page.html").write_text("<!doctype html>\n<title>a run</title>\n")
    save_model(LOOP, data / "loop.json")
    save_model(LOOP, data / "long.json", provenance={"caveats": ["long"] * 20_000})
    before = contents(data)
    done = smadrive(*arguments, cwd=data)
    assert done.returncode == code, done.stderr
    assert part in done.stderr
    assert "Traceback" not in done.stderr
    if "No such" not in part:
        assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == ""
    assert contents(data) == before


def contents(folder):
    return {file.name: file.read_bytes() if file.is_file() else None for file in folder.iterdir()}


@pytest.mark.exhaustive
def test_linear_algebra_starts_no_threads(tmp_path):
    script = (
        "import os, sys\n"
        "from smadrive.cli import main\n"
        "sys.argv = ['smadrive', 'identify', '--help']\n"
        "try:\n"
        "    main()\n"
        "except SystemExit:\n"
        "    print('numpy' in sys.modules, len(os.listdir('/proc/self/task')))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True, env={"HOME": "/"}
    )
    assert done.stdout.splitlines()[-1] == "True 1"


def test_signal_during_the_first_imports_is_an_interruption():
    script = (
        "import signal, sys\n"
        "class Press:\n"
        "    def find_spec(name, path=None, target=None):\n"
        "        if name == 'typer':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Press)\n"
        "from smadrive.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "Traceback" not in done.stderr


def test_signal_ends_the_command_although_python_swallowed_an_earlier_one():
    script = (
        "import signal, sys\n"
        "class Press:\n"
        "    def __del__(self):\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "    def find_spec(name, path=None, target=None):\n"
        "        if name == 'typer':\n"
        "            Press()\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Press)\n"
        "from smadrive.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert "Exception ignored" in done.stderr
    assert done.returncode == 130


def test_off_and_version_import_no_maths_and_no_tables(tmp_path):
    (tmp_path / "rig.toml").write_text(rig_text("/tmp/smadrive-sim", "/dev/ttyNONE"))  # noqa: S108
    script = (
        "import sys\n"
        "from smadrive.cli import main\n"
        "sys.argv = ['smadrive', *sys.argv[1:]]\n"
        "try:\n"
        "    main()\n"
        "finally:\n"
        "    heavy = {'numpy', 'scipy', 'h5py', 'matplotlib', 'pymodbus', 'rich', 'asyncio', 'smadrive.control'}\n"
        "    print(sorted(heavy & sys.modules.keys()), file=sys.stderr)\n"
    )
    off = subprocess.run(
        [sys.executable, "-c", script, "off", tmp_path / "rig.toml"], capture_output=True, text=True, check=False
    )
    assert off.returncode == 3
    assert off.stderr.splitlines()[-1] == "[]"
    version = subprocess.run([sys.executable, "-c", script, "--version"], capture_output=True, text=True, check=True)
    assert version.stderr == "[]\n"
