"""OFF while no reply arrives: the loop checks OFF before every exchange, so no later frame commands current."""

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.trace import content_of, read_trace

SILENT_S, OFF_S, STALE_S = 20.0, 20.4, 2.0
EXCHANGE = 0x17


def commands(trace):
    """Return time and current of every command that was sent."""
    codec = load_profile("sma-reference").register("heater_current").codec
    for time_s, direction, frame in read_trace(trace)[1]:
        _, pdu = content_of(frame, numbered=False) if direction == "sent" else (0, b"")
        if pdu[:1] == bytes([EXCHANGE]):
            words = [int.from_bytes(pdu[at : at + 2], "big") for at in range(10, len(pdu), 2)]
            yield time_s, codec.decode(words[1:2]).value


@pytest.mark.parametrize("way", ["counter", "message"])
def test_no_frame_carries_current_after_off_although_every_reply_is_lost(rig, tmp_path, way):
    rig.trace_folder, rig.stale_after_s = tmp_path, STALE_S
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    pressed_s = []

    def press(time_s):
        if time_s >= OFF_S and not pressed_s:
            pressed_s.append(time_s)
            rig.page.request_off() if way == "counter" else rig.page.send({"number": 99, "act": "off"})

    rig.do(SILENT_S, lambda: rig.device.faults.drop(for_s=1.9))
    rig.clock.follow(press)
    rig.run(until_s=24.0)
    sent = list(commands(tmp_path / "board.trace"))
    assert sum(current_a > 0.1 for time_s, current_a in sent if SILENT_S < time_s < OFF_S) >= 2
    assert [current_a for time_s, current_a in sent if time_s > pressed_s[0] and current_a] == []
    assert rig.status["mode"] == "off"
    assert rig.device.firmware.current_a == 0.0
