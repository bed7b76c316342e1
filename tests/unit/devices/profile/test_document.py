"""docs/device-profiles.md lists exactly the keys that a profile may have, and its example drives a supply."""

import re
import tomllib

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.devices.device import Device
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.profile import schema
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.devices.profile.register import Register
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir
from smadrive.modbus.client import ModbusClient

DOCUMENT = (configs_dir().parent / "docs" / "device-profiles.md").read_text(encoding="utf-8")
EXAMPLE = re.search(r"```toml\n(.*?)```", DOCUMENT, re.DOTALL)[1]
TABLES = {
    "## [profile]": schema.Head,
    "## [serial]": schema.Serial,
    "## [tcp]": schema.Tcp,
    "## [timing]": schema.DeviceTiming,
    "## [identify]": schema.IdentityRegister,
    "## [roles]": schema.Roles,
    "## [registers.NAME]": Register,
    "## [[variants]]": schema.Variant,
    "In `registers`:": schema.Override,
    "## [[forbidden]]": schema.Forbidden,
    "## [[write_order]]": schema.WriteOrder,
    "## [[safe_state]]": schema.SafeWrite,
    "## [[vectors]]": schema.GoldenFrame,
}


def rows(heading):
    start = DOCUMENT.index(heading) + len(heading)
    end = re.search(r"^(## |In `registers`)", DOCUMENT[start:] + "\n## ", re.MULTILINE).start()
    return re.findall(r"^\| `(\w+)` \| (.+) \| `(.+)` \|$", DOCUMENT[start : start + end], re.MULTILINE)


@pytest.mark.parametrize(("heading", "model"), TABLES.items(), ids=list(TABLES))
def test_document_lists_exactly_the_keys_of_the_schema(heading, model):
    assert [key for key, _, _ in rows(heading)] == [field.alias or name for name, field in model.model_fields.items()]


@pytest.mark.parametrize("heading", TABLES)
def test_the_examples_are_toml(heading):
    for key, _, example in rows(heading):
        assert key in tomllib.loads(f"{key} = {example}")


def test_document_lists_every_table():
    told = {re.search(r"\w+", heading)[0] for heading in TABLES if heading.startswith("##")}
    assert told | {"schema"} == {field.alias or name for name, field in Profile.model_fields.items()}


def test_the_example_is_a_supply_that_can_be_driven_and_simulated(tmp_path, clock):
    path = tmp_path / "my-supply.toml"
    path.write_text(EXAMPLE, encoding="utf-8")
    simulated = SimulatedBench(load_sim("flexinol-lt-0.15mm")).attach(load_profile(path))
    clock.follow(simulated.bench.advance_to)
    supply = BenchSupply(Device(load_profile(path), ModbusClient(simulated.transport(clock))))
    supply.connect()
    with pytest.raises(ConfigError) as error:
        supply.configure(HeaterLimits(0.4, 120.0, voltage_max_v=9.0), watchdog_s=1.0)
    assert (error.value.where, error.value.value) == ("voltage_max_v", "9 V")
    supply.configure(HeaterLimits(0.4, 120.0), watchdog_s=1.0)
    supply.arm()
    supply.exchange(0.2)
    clock.sleep_until(clock.now_s() + 1.0)
    assert supply.exchange(0.0).current_a == pytest.approx(0.2, abs=0.01)
