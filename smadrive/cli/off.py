"""`smadrive off`: put every device of a rig into its safe state, confirmed by read-back."""

from __future__ import annotations

from smadrive.cli.output import AsJson, Output
from smadrive.cli.probe import RigFile
from smadrive.rig import Rig
from smadrive.rigconfig import load_rig


def main(rig: RigFile, as_json: AsJson = False) -> None:
    """Switch the heater of RIG off and confirm it by reading back."""
    output = Output(as_json)
    config = load_rig(rig)
    with Rig(config):
        pass  # entering a rig confirms its safe state, leaving it does so again
    names = [device.name for device in config.devices]
    output.say(f"{config.name}: heater off, confirmed by read-back ({', '.join(names)})")
    output.result({"rig": config.name, "devices": names, "safe": True})
