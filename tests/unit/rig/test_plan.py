"""The plan of a rig follows from its file and the profiles. Devices that do not form a rig are an error."""

import pytest

from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.plan import plan_rig

SUPPLY = {"name": "supply", "profile": "riden-rd60xx", "url": "serial:///dev/a"}
READER = {"name": "reader", "profile": "delta-dtb", "url": "serial:///dev/b"}
LASER = {"name": "laser", "profile": "baumer-om20", "url": "serial:///dev/c"}
BOARD = {"name": "board", "profile": "sma-reference", "url": "serial:///dev/d"}
TCLAB = {"name": "board", "profile": "tclab", "url": "serial:///dev/d", "full_scale_a": 1.0, "full_scale_v": 16.5}
SIM = "sim://flexinol-lt-0.15mm"


def plan(*devices, given=(), rate_hz=4.0, **limits):
    document = load_rig("bench-supply").model_dump(exclude_none=True, exclude={"feedback"})
    document |= {"devices": devices, "rate_hz": rate_hz, "limits": document["limits"] | limits}
    config = RigConfig.model_validate(document)
    return plan_rig(config, {device.name: load_profile(device.profile) for device in config.devices}, given)


def error_of(*devices, **options):
    with pytest.raises(ConfigError) as caught:
        plan(*devices, **options)
    assert caught.value.cure or caught.value.limit
    return caught.value


def test_supply_heats_and_the_others_measure():
    found = plan(SUPPLY, READER, LASER)
    assert found.source.name == "supply"
    assert [(sensor.device.name, sensor.quantity) for sensor in found.sensors] == [
        ("reader", "temperature"),
        ("laser", "displacement"),
    ]
    assert [device.name for device in found.devices] == ["supply", "reader", "laser"]
    assert (found.limits.current_max_a, found.limits.voltage_max_v) == (0.4, 9.0)


@pytest.mark.parametrize(
    ("devices", "source_type"),
    [((SUPPLY, READER), BenchSupply), ((BOARD,), HeaterBoard), ((TCLAB,), TCLab)],
    ids=["supply", "board", "tclab"],
)
def test_profile_decides_the_type_of_the_source(devices, source_type):
    assert plan(*devices).source.source_type is source_type


@pytest.mark.parametrize(("device", "warnings"), [(BOARD, 1), (SUPPLY, 0)])
def test_voltage_limit_that_the_source_cannot_keep_gives_a_warning(device, warnings):
    sensors = () if device is BOARD else (READER,)
    caveats = plan(device, *sensors, voltage_max_v=9.0).caveats
    assert [caveat.startswith("voltage_max_v") for caveat in caveats] == [True] * warnings


@pytest.mark.parametrize(
    ("url", "warnings"),
    [
        ("serial:///dev/ttyX", 0),
        ("serial:///dev/ttyX?latency_ms=100", 0),
        ("serial:///dev/ttyX?latency_ms=200", 1),
        ("tcp://127.0.0.1:5020", 1),
    ],
)
def test_laser_whose_silence_would_end_a_run_gives_a_warning(url, warnings):
    board = BOARD | {"measures": ["temperature"]}
    found = plan(board, LASER | {"url": url}, rate_hz=20.0, stale_after_s=0.3, watchdog_s=0.5).caveats
    caveats = [caveat for caveat in found if not caveat.startswith("voltage_max_v")]
    assert len(caveats) == warnings
    assert all("'laser'" in caveat for caveat in caveats)


@pytest.mark.parametrize(("rate_hz", "slow"), [(2.5, 0), (4.0, 0), (10.0, 1)])
def test_sensor_that_is_slow_for_the_loop_gives_a_warning(rate_hz, slow):
    """The reader converts every 0.4 s, the laser is as fast as the loop."""
    caveats = plan(SUPPLY, READER, LASER, rate_hz=rate_hz).caveats
    assert len(caveats) == slow
    assert all("'reader'" in caveat and caveat.endswith(" 2.5") for caveat in caveats)


def test_board_measures_everything_itself():
    found = plan(BOARD)
    assert found.sensors == ()
    assert found.source.unit_id == load_profile("sma-reference").unit_id


def test_sensor_is_read_no_faster_than_it_converts():
    (slow, fast) = plan(SUPPLY, READER, LASER | {"rate_hz": 2.0}).sensors
    assert slow.period_s == max(0.25, load_profile("delta-dtb").timing.update_ms / 1e3)
    assert (fast.period_s, fast.stale_s) == (0.5, 2.0)
    assert plan(SUPPLY, READER, stale_after_s=0.1).sensors[0].stale_s == 3 * slow.period_s


def test_sensor_is_read_no_faster_than_the_loop_runs():
    (_, laser) = plan(SUPPLY, READER, LASER | {"rate_hz": 10.0}, rate_hz=2.0).sensors
    assert laser.period_s == 0.5


def test_guardian_watches_a_source_without_a_watchdog():
    task = plan(SUPPLY, READER, watchdog_s=1.5).guardian
    assert (task.device.profile, task.device.url, task.timeout_s) == ("riden-rd60xx", "serial:///dev/a", 1.5)
    assert plan(TCLAB, watchdog_s=1.5).guardian is not None


@pytest.mark.parametrize(
    ("devices", "given"),
    [((BOARD,), ()), ((SUPPLY | {"url": SIM}, READER), ()), ((SUPPLY, READER), ("supply",))],
    ids=["own watchdog", "simulated", "given connection"],
)
def test_other_sources_need_no_guardian(devices, given):
    assert plan(*devices, given=given).guardian is None


def test_guardian_that_could_not_await_a_reply_is_an_error():
    error = error_of(SUPPLY, READER, watchdog_s=0.6)
    assert (error.value, error.limit) == ("0.6 s", "0.75 s")
    slow_line = error_of(SUPPLY, READER | {"url": "tcp://host?latency_ms=2000"}, watchdog_s=3.0)
    assert float(slow_line.limit.split()[0]) > 3.0


def test_devices_at_one_port_need_the_same_line_settings():
    """The driver would open the port for the first device, and the guardian for the source."""
    line = "serial:///dev/a"
    error = error_of(READER | {"url": line, "unit_id": 2}, SUPPLY | {"url": line})
    assert error.value == f"115200 8N1, {load_profile('delta-dtb').serial_settings()}"
    line += "?baudrate=9600&parity=N&stopbits=1"
    assert plan(READER | {"url": line, "unit_id": 2}, SUPPLY | {"url": line}).source.name == "supply"


def test_one_port_has_one_url():
    error = error_of(SUPPLY, READER | {"url": SUPPLY["url"] + "?baudrate=115200", "unit_id": 2})
    assert error.where == "devices 'supply', 'reader'"


def test_rig_has_exactly_one_device_that_heats():
    assert error_of(READER, LASER).value == "none"
    assert error_of(SUPPLY, BOARD).value == "'supply', 'board'"


def test_rig_measures_the_temperature():
    assert "temperature" in error_of(SUPPLY, LASER).what


def test_rig_takes_from_the_source_only_what_the_rig_file_lists():
    assert plan(BOARD).source.source_measures == {"temperature", "displacement"}
    assert plan(BOARD | {"measures": ["temperature"]}).source.source_measures == {"temperature"}
    assert "temperature" in error_of(BOARD | {"measures": ["displacement"]}).what


def test_two_thermometers_need_a_choice():
    spare = READER | {"name": "spare", "url": "serial:///dev/e"}
    assert error_of(SUPPLY, READER, spare).value == "'reader', 'spare'"
    assert [sensor.device.name for sensor in plan(SUPPLY, READER | {"measures": []}, spare).sensors] == ["spare"]


def test_device_without_the_register_measures_nothing():
    error = error_of(SUPPLY, READER, LASER | {"measures": ["temperature"]})
    assert error.where == "device 'laser'"


@pytest.mark.parametrize(
    "devices",
    [
        ({k: v for k, v in TCLAB.items() if k != "full_scale_v"},),
        (BOARD | {"full_scale_a": 1.0},),
        (SUPPLY | {"full_scale_v": 1.0}, READER),
    ],
    ids=["duty without scale", "board with scale", "supply with scale"],
)
def test_full_scales_belong_to_a_source_that_is_commanded_by_duty(devices):
    assert error_of(*devices).where == f"device '{devices[0]['name']}'"


@pytest.mark.parametrize(
    "changes",
    [{"url": "serial:///dev/x"}, {"url": "tcp://host", "unit_id": 7}],
    ids=["factory ids", "given ids"],
)
def test_two_devices_of_one_unit_id_on_a_line_are_an_error(changes):
    error = error_of(SUPPLY, READER | changes, LASER | changes)
    assert error.where == "devices 'reader' and 'laser'"
    assert error.value == changes.get("unit_id", 1)


def test_devices_of_different_unit_ids_share_a_line():
    url = "serial:///dev/x?baudrate=9600&parity=N&stopbits=1"
    plan(SUPPLY, READER | {"url": url, "unit_id": 7}, LASER | {"url": url, "unit_id": 8})


def test_text_device_shares_no_line():
    assert error_of(TCLAB, LASER | {"url": TCLAB["url"]}).where == "device 'board'"


def test_simulated_devices_share_one_bench():
    devices = [SUPPLY | {"url": SIM}, READER | {"url": f"{SIM}?profile=delta-dtb"}, LASER | {"url": "sim://other"}]
    assert "sim://other" in error_of(*devices).value
    plan(*devices[:2])
    plan(*devices, given=("laser",))
