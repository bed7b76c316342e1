"""A rig whose devices are all on one simulated bench."""

from smadrive.devices.profile.profile import load_profile
from smadrive.rig.rig import Rig


def rig_on(bench, config, clock):
    """Attach the devices of `config` to `bench`, and return the rig that is connected to them on `clock`."""
    transports = {
        device.name: bench.attach(load_profile(device.profile), name=device.name).transport(clock)
        for device in config.devices
    }
    return Rig(config, transports=transports)
