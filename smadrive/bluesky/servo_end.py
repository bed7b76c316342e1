"""The end of a servo, after which the heater is off or an error has been raised."""

from __future__ import annotations

from contextlib import suppress

from smadrive.errors import ConfigError
from smadrive.safety.shutdown import shutdown_of
from smadrive.scripting.open_rig import OpenRig
from smadrive.scripting.servo import Servo


def end_servo(servo: Servo, rig: OpenRig) -> None:
    """Stop a servo. Switch the heater off again if its run ended without a confirmation and the rig is open.

    The error of the run is not raised: the status of the interrupted motion has failed with it. StoppedError is not an
    Exception: raised here, it would keep a run engine from stopping its other devices. `close()` of the rig raises it.
    """
    with suppress(ConfigError):  # in a forked child
        servo.end()
    outcome = None if servo.error is None else shutdown_of(servo.error)
    is_confirmed = servo.error is None or (outcome is not None and outcome.confirmed)
    if not is_confirmed and rig.is_open:
        rig.off()
