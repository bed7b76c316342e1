"""A rig file of a supply and a reader, whose ports are filled in, and a driver that heats through a rig."""

RIG = """
name = "supply and reader"
wire = "flexinol-lt-0.15mm"
rate_hz = 4.0
[[devices]]
name = "supply"
profile = "riden-rd60xx"
url = "{supply}"
[[devices]]
name = "reader"
profile = "delta-dtb"
url = "{reader}"
[limits]
current_max_a = 0.4
temperature_max_c = 135.0
voltage_max_v = 15.0
watchdog_s = 1.0
stale_after_s = 1.0
[excitation]
low_c = 40.0
high_c = 120.0
rate_c_per_s = 6.0
"""

DRIVER = """
import sys, time
from smadrive.rig.rig import Rig
from smadrive.rig.config import load_rig
with Rig(load_rig(sys.argv[1])) as rig:
    rig.heater.arm(rig.config.limits.watchdog_s)
    for tick in range(10_000):
        rig.heater.exchange(0.3)
        if tick == 2:
            print("heating", flush=True)
        if tick == 4 and "crash" in sys.argv:
            raise ZeroDivisionError
        while tick == 4 and "hangs" in sys.argv:
            pass
        time.sleep(0.1)
"""
"""Code of a driver. Its arguments are the rig file, and "crash" or "hangs" if that is its fate."""


def patient(rig):
    """Return the rig file with limits so long that only an ended driver exceeds them, even on a busy machine."""
    return rig.replace("watchdog_s = 1.0", "watchdog_s = 10.0").replace("stale_after_s = 1.0", "stale_after_s = 10.0")
