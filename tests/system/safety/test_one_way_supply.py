"""A serial line that loses or spoils every reply, while requests still arrive: the supply is soon without current."""

from math import inf

import pytest
from marks import exhaustive

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.stopping.request import ANSWERS_WITHIN_S
from smadrive.errors import StoppedError, TripError
from smadrive.modbus.transports.in_process import InProcessTransport
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.plan import stale_after_s
from smadrive.rig.rig import Rig
from smadrive.safety.faults import Fault
from smadrive.safety.shutdown import shutdown_of

HEATS_FROM_S = 3.0
SUPPLIES = ("riden-rd60xx", "riden-rd60xx:model_id=60125,current_range=0", "hanmatek-hm30x", "juntek-dpm86xx")


def lose(replies):
    return []


def spoil(replies):
    return [(due_s, bytes((data[0] ^ 0x40, *data[1:]))) for due_s, data in replies]


class OneWayLine:
    """A rig whose supply is at a line that breaks while current flows: from then on, `damage` changes the replies.

    lost_s    time of the first lost reply
    off_s     time at which the supply was without current; None while current flows
    """

    def __init__(self, profile, damage, latency_s):
        bench, self.clock = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=3), VirtualClock()
        supply, reader = (bench.attach(load_profile(name), name=name) for name in (profile, "autonics-tk"))
        self.firmware, self._line, self._damage = supply.firmware, supply.line, damage
        self._broken, self._stops_after_s = False, inf
        self.lost_s = self.off_s = None
        self.clock.follow(bench.advance_to)
        self.clock.follow(self._look)
        url = "sim://flexinol-lt-0.15mm"
        document = load_rig("in-process").model_dump(exclude_none=True, exclude={"feedback"})
        document["devices"] = [
            {"name": "supply", "profile": profile.partition(":")[0], "url": url},
            {"name": "reader", "profile": "autonics-tk", "url": url},
        ]
        document["rate_hz"] = 1.5
        document["limits"] |= {"current_max_a": 0.4, "voltage_max_v": 15.0, "watchdog_s": 3.0}
        baudrate = load_profile(profile).serial_settings().baudrate
        port = InProcessTransport(self, self.clock, baudrate, latency_s)
        transports = {"supply": port, "reader": reader.transport(self.clock)}
        self.rig = Rig(RigConfig.model_validate(document), transports=transports)

    def stop_after(self, lost_for_s):
        """Interrupt the driver as `smadrive off` does, this time after the first lost reply."""
        self._stops_after_s = lost_for_s

    def receive(self, data, time_s):
        replies = self._line.receive(data, time_s)
        if not self._broken:
            return replies
        self.lost_s = time_s if self.lost_s is None else self.lost_s
        return self._damage(replies)

    def _look(self, time_s):
        if self._broken and self.off_s is None and self.firmware.current_a == 0.0:
            self.off_s = time_s
        if self.lost_s is not None and time_s >= self.lost_s + self._stops_after_s:
            self._stops_after_s = inf
            raise StoppedError("stopped by `smadrive off`")

    def heat_until_broken(self, tick):
        if tick.time_s > HEATS_FROM_S and self.firmware.current_a > 0.1:
            self._broken = True


def excite_until(error, line):
    with pytest.raises(error) as caught, line.rig as rig:
        rig.excite(rig.excitation(22.0), line.heat_until_broken)
    assert not shutdown_of(caught.value).confirmed
    return caught.value


@pytest.mark.parametrize("damage", [lose, exhaustive(spoil)])
@pytest.mark.parametrize("latency_s", [exhaustive(0.0), 0.5])
@pytest.mark.parametrize("profile", ["riden-rd60xx", *map(exhaustive, SUPPLIES[1:])])
def test_supply_is_off_soon_after_a_line_loses_every_reply(profile, latency_s, damage):
    line = OneWayLine(profile, damage, latency_s)
    assert excite_until(TripError, line).number == Fault.STALE_DATA.number
    assert line.off_s - line.lost_s <= 2.0 * stale_after_s(line.rig.config)


@pytest.mark.parametrize("stopped_after_s", [exhaustive(0.3), exhaustive(1.2), 1.8])
@pytest.mark.parametrize("profile", ["riden-rd60xx", *map(exhaustive, SUPPLIES[1:])])
def test_emergency_stop_on_a_line_without_replies_is_in_time(profile, stopped_after_s):
    """`smadrive off` kills a driver that needs longer."""
    line = OneWayLine(profile, lose, latency_s=0.5)
    line.stop_after(stopped_after_s)
    excite_until(StoppedError, line)
    assert line.off_s - line.lost_s < stopped_after_s + ANSWERS_WITHIN_S
