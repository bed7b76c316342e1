"""docs/safety.md agrees with the faults and limits of the driver."""

import re
from pathlib import Path

from smadrive.rig.config import LimitsConfig, RigConfig
from smadrive.safety.faults import Fault

DOCUMENT = (Path(__file__).parents[3] / "docs" / "safety.md").read_text()


def test_table_has_every_fault_with_cause_and_remedy():
    rows = re.findall(r"^\| (\d+) \| (.*?) \| (.*?) \| (.*?) \|$", DOCUMENT, re.MULTILINE)
    assert rows == [
        (str(fault.number), fault.name.lower().replace("_", " "), fault.cause, fault.remedy) for fault in Fault
    ]


def test_every_limit_is_in_the_table():
    table = DOCUMENT.partition("## Limits")[2].partition("## Faults")[0]
    assert set(re.findall(r"`(\w+_\w+)`", table)) == set(LimitsConfig.model_fields)


def test_keys_that_a_fault_names_are_those_of_a_rig_file():
    known = {*LimitsConfig.model_fields, *RigConfig.model_fields}
    named = re.findall(r"\b[a-z]+(?:_[a-z]+)+\b", " ".join(f"{fault.cause} {fault.remedy}" for fault in Fault))
    assert {"rate_hz", "stale_after_s"} <= set(named) <= known
