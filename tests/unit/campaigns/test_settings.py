"""The settings of a run: a key without an effect is an error before the first run starts."""

import pytest

from smadrive.campaigns.campaign import check_plan
from smadrive.campaigns.plan.plan import load_plan
from smadrive.errors import ConfigError

REFERENCES = """
[references.slow]
shape = "sine:period_s=56"
[[disturbances.draft]]
name = "draft"
at_s = 1.0
factor = 1.6
for_s = 5.0
[[disturbances.stuck]]
name = "stick_displacement"
at_s = 1.0
"""
TRACK = 'reference = "slow"\n'
IDENTIFY = 'experiment = "identify"\n'
FIT = 'experiment = "fit"\nrecord = "a.csv"\n'


@pytest.fixture
def checked(tmp_path):
    """`checked(run, vary)` checks a campaign with these keys in [run], and with this axis."""
    (tmp_path / "a.csv").write_text("temperature_c,displacement_mm\n20,0\n21,0\n")
    (tmp_path / "wire.json").write_text("{}")

    def check(run, vary=""):
        axis = f"[[vary]]\n{vary}\n" if vary else ""
        (tmp_path / "campaign.toml").write_text(f'title = "x"\n[run]\n{run}\n{axis}{REFERENCES}', encoding="utf-8")
        check_plan(load_plan(str(tmp_path / "campaign.toml")))

    return check


USELESS = [
    (TRACK, "wire.alloy", '"HT"'),
    (TRACK, "wire.length_m", "0.6"),
    (TRACK, "wire.kind", '"preisach"'),
    (TRACK, "record", '"a.csv"'),
    (TRACK, "rig.feedback.adapt", "true"),
    (TRACK, "rig.model", '"wire.json"'),
    (TRACK + 'model = "wire.json"\n', "rig.model", '"wire.json"'),
    (TRACK, "rig.off_by_mqtt", "true"),
    (TRACK, "sim.devices", '[{profile = "tclab"}]'),
    (TRACK + "wire.seed = 3\n", "sim.transformation.kind", '"duhem"'),
    (TRACK + 'controller = "feedback-only"\n', "rig.feedback", "{closed_loop_s = 0.5}"),
    (TRACK + 'controller = "feedback-only"\ndisplacement_sensor = false\n', "rig.feedback.feedforward_share", "0.5"),
    (TRACK + "displacement_sensor = false\n", "disturbance", '"stuck"'),
    (TRACK, "fit.input", '"a"'),
    (IDENTIFY, "fit.output", '"a"'),
    (TRACK + "wire.diameter_mm = 0.15\n", "rig.wire", '"flexinol-lt-0.15mm"'),
    (TRACK + 'model = "wire.json"\n', "fit", '{kind = "duhem"}'),
    (TRACK + 'model = "wire.json"\n', "rig.excitation", "{reversals = 3}"),
    (IDENTIFY, "controller", '"inverse"'),
    (IDENTIFY, "reference", '"slow"'),
    (IDENTIFY, "disturbance", '"draft"'),
    (IDENTIFY, "displacement_sensor", "false"),
    (IDENTIFY, "rig.displacement_from", '"none"'),
    (IDENTIFY, "rig.feedback.adapt", "false"),
    (FIT, "controller", '"inverse"'),
    (FIT, "sim", "{thermocouple = {noise_c = 0.1}}"),
    (FIT, "seed", "3"),
]


@pytest.mark.parametrize(("run", "key", "value"), USELESS)
def test_key_without_an_effect_is_an_error(checked, run, key, value):
    with pytest.raises(ConfigError) as caught:
        checked(f"{run}{key} = {value}\n")
    assert caught.value.where == f"[run]: {key}"
    assert caught.value.cure


@pytest.mark.parametrize(("run", "key", "value"), USELESS)
def test_axis_without_an_effect_is_an_error(checked, run, key, value):
    with pytest.raises(ConfigError) as caught:
        checked(run, f'labels = ["a"]\n{key} = [{value}]')
    assert caught.value.where == f"[[vary]] 1: {key}"
    assert caught.value.cure


@pytest.mark.parametrize(("counted", "key"), [("random_wires = 2", "wire"), ("repeats = 2", "seed")])
def test_random_wires_and_repeats_have_no_effect_on_a_fit(checked, counted, key):
    with pytest.raises(ConfigError) as caught:
        checked(FIT, counted)
    assert caught.value.where == f"[[vary]] 1: {key}"


@pytest.mark.parametrize(
    ("run", "vary"),
    [
        (TRACK + "wire.diameter_mm = 0.15\n", 'wire.alloy = ["LT", "HT"]'),
        (TRACK + "wire.length_m = 0.6\n", "wire.diameter_mm = [0.15, 0.2]"),
        (TRACK + 'wire.kind = "duhem"\n', "random_wires = 2"),
        (TRACK + 'wire.kind = "duhem"\nwire.seed = 3\n', ""),
        (TRACK, 'labels = ["0.15 mm, HT"]\nwire = [{diameter_mm = 0.15, alloy = "HT"}]'),
        (TRACK + 'controller = "feedback-only"\ndisturbance = "draft"\n', "displacement_sensor = [true, false]"),
        (TRACK + 'fit.kind = "duhem"\nrig.displacement_from = "none"\n', "repeats = 2"),
        (IDENTIFY + "rig.rate_hz = 20.0\nsim.thermocouple.noise_c = 0.2\n", "random_wires = 2"),
        (TRACK, 'rig.wire = ["flexinol-lt-0.15mm"]'),
        (TRACK + "rig.feedback.closed_loop_s = 0.5\n", 'controller = ["inverse", "feedback-only"]'),
        (TRACK + 'disturbance = "stuck"\n', "displacement_sensor = [true, false]"),
        (
            TRACK + 'controller = "feedback-only"\nrig.feedback.closed_loop_s = 0.5\n',
            'rig.displacement_from = ["sensor", "none"]',
        ),
        (FIT + 'fit.output = "displacement_mm"\n', 'fit.kind = ["duhem", "tsfuzzy"]'),
    ],
)
def test_keys_with_an_effect_are_accepted(checked, run, vary):
    checked(run, vary)


@pytest.mark.parametrize("text", ['shape = "sine:period_s=56,low_mm=2,high_mm=9"', 'file = "a.csv"'])
@pytest.mark.parametrize("key", ["low", "high"])
def test_share_of_the_travel_without_an_effect_is_an_error(tmp_path, text, key):
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(f'title = "x"\n[run]\nreference = "a"\n[references.a]\n{text}\n{key} = 0.4\n')
    with pytest.raises(ConfigError) as caught:
        load_plan(str(campaign))
    assert f"{key} has no effect" in str(caught.value)


@pytest.mark.parametrize("times", ["at_s = 1000.0", "between_s = [5.0, 1000.0]"])
def test_disturbance_after_the_end_of_the_reference_is_an_error(checked, times):
    late = f'[[disturbances.late]]\nname = "draft"\n{times}\nfactor = 1.6\nfor_s = 5.0\n'
    with pytest.raises(ConfigError) as caught:
        checked(f'{TRACK}disturbance = "late"\n{late}')
    assert caught.value.where == "disturbance 'draft'"
    assert caught.value.limit


MODEL = TRACK + 'model = "wire.json"\n'


@pytest.mark.parametrize(
    ("run", "key", "column"),
    [
        (FIT, "by", "wire_kind"),
        (FIT, "by", "smoothed"),
        (FIT, "metric", "rms_percent"),
        (IDENTIFY, "by", "smoothed"),
        (IDENTIFY, "metric", "energy_j"),
        (MODEL, "by", "certified"),
    ],
)
def test_column_that_no_run_has_is_an_error_in_the_report(checked, run, key, column):
    value = f'["{column}"]' if key == "by" else f'"{column}"'
    with pytest.raises(ConfigError) as caught:
        checked(f"{run}[report]\n{key} = {value}\n")
    assert (caught.value.where, caught.value.value) == (f"[report] {key}", column)
    assert caught.value.cure


@pytest.mark.parametrize(
    ("run", "column"),
    [(FIT, "certified"), (FIT, "error_type"), (IDENTIFY, "wire_kind"), (TRACK, "certified"), (MODEL, "smoothed")],
)
def test_column_that_a_run_can_have_is_accepted_in_the_report(checked, run, column):
    checked(f'{run}[report]\nby = ["{column}"]\n')
