"""A model of client, bus and device: any order of late, lost, doubled and early frames.

The device puts the number of the request into its reply, so that no two replies are equal, and answers in order. A
reply that the client accepts must be the one to the request of that call. Plain RTU has one exception, which no client
can avoid: a second copy of a reply that arrives when the next request of the same kind is out. The reply whose place
the copy took is then such a copy itself, until it has arrived. A proved read, and an exchange whose sequence number is
echoed, must be right even then.
"""

from dataclasses import dataclass

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from smadrive.clock import VirtualClock
from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import mbap, rtu
from smadrive.modbus.transports.in_process import InProcessTransport

TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)
SECONDS = st.sampled_from((0.0, 0.001, 0.05, 0.099, 0.101, 0.15, 0.25, 0.4, 1.0))
CODES = st.sampled_from((1, 2, 4, 5, 6, 10, 11))
LENGTHS = st.integers(1, 3)


@dataclass
class Fault:
    """The fault that one reply meets on the bus."""

    deaf: bool = False
    lost: bool = False
    late_s: float = 0.0
    code: int | None = None
    answers_after_all_s: float | None = None
    copy_s: float | None = None
    early_s: float | None = None


class Device:
    """Register 0 holds the value that was last written. Every other register holds the number of the request."""

    def __init__(self, numbered):
        self.faults = []
        self.requests = 0
        self.answered = {}
        self.copies_until_s = 0.0
        self._numbered = numbered
        self._busy_until_s = 0.0

    def receive(self, data, time_s):
        fault = self.faults.pop() if self.faults else Fault()
        if fault.deaf:
            return []
        number = mbap.Header.of(data).transaction if self._numbered else None
        pdu = data[mbap.HEADER_SIZE :] if self._numbered else data[1:-2]
        self.requests += 1
        self.answered[pdu] = reply = self._reply(pdu)
        frames_ = [] if fault.lost else [(fault.late_s, self._frame(number, reply))]
        if fault.code is not None:
            refusal = self._frame(number, bytes((pdu[0] | 0x80, fault.code)))
            after_all = fault.answers_after_all_s
            frames_ = [(fault.late_s, refusal)]
            frames_ += [] if after_all is None else [(after_all, self._frame(number, reply))]
        if fault.copy_s is not None and frames_:
            frames_.append((fault.copy_s, frames_[0][1]))
        if fault.early_s is not None and self._numbered:
            frames_.append((fault.early_s, self._frame((number + 1) & 0xFFFF, reply)))
        return self._in_order(time_s, frames_, copied=len(frames_) > 1)

    def the_last_reply_is_a_copy(self):
        """Return True if a copy was accepted in place of the last reply, which may now answer a later request."""
        self.copies_until_s = self._busy_until_s

    def _reply(self, pdu):
        function, word = pdu[0], (self.requests & 0xFFFF).to_bytes(2, "big")
        match function:
            case 3 | 4:
                return bytes((function, 2 * pdu[4])) + word * pdu[4]
            case 23:
                return bytes((23, 2 * pdu[4])) + pdu[10:12] + word * (pdu[4] - 1)
            case 6:
                return pdu
            case 16:
                return pdu[:5]
        return bytes((function | 0x80, 1))

    def _frame(self, number, pdu):
        return mbap.seal(number, 1, pdu) if self._numbered else rtu.seal(1, pdu)

    def _in_order(self, time_s, deliveries, *, copied):
        arriving = []
        for later_s, data in deliveries:
            self._busy_until_s = max(time_s + later_s, self._busy_until_s)
            arriving.append((self._busy_until_s, data))
        if copied:
            self.copies_until_s = self._busy_until_s
        return arriving


class BusMachine(RuleBasedStateMachine):
    """The state machine of the test: requests and faults in any order."""

    numbered = False

    @initialize()
    def begin(self):
        self.device = Device(self.numbered)
        self.client = ModbusClient(
            InProcessTransport(self.device, VirtualClock(), None if self.numbered else 115200),
        )
        self.sequence = 0

    @rule(deaf=st.booleans())
    def lose(self, deaf):
        self.device.faults.append(Fault(deaf=deaf, lost=True))

    @rule(late_s=SECONDS)
    def delay(self, late_s):
        self.device.faults.append(Fault(late_s=late_s))

    @rule(copy_s=SECONDS, late_s=SECONDS)
    def double(self, copy_s, late_s):
        self.device.faults.append(Fault(late_s=late_s, copy_s=copy_s))

    @rule(code=CODES, late_s=SECONDS, after_all_s=st.none() | SECONDS, copy_s=st.none() | SECONDS)
    def refuse(self, code, late_s, after_all_s, copy_s):
        self.device.faults.append(Fault(code=code, late_s=late_s, answers_after_all_s=after_all_s, copy_s=copy_s))

    @precondition(lambda self: self.numbered)
    @rule(early_s=SECONDS)
    def send_early(self, early_s):
        self.device.faults.append(Fault(early_s=early_s))

    @rule(pause_s=SECONDS)
    def wait(self, pause_s):
        self.client.clock.sleep_until(self.client.clock.now_s() + pause_s)

    @rule(read=st.sampled_from((requests.read_holding, requests.read_input)), count=LENGTHS, proved=st.booleans())
    def read(self, read, count, proved):
        self._execute(read(1, count), proved=proved)

    @rule(word=st.integers(0, 3), count=LENGTHS)
    def write(self, word, count):
        self._execute(requests.write_register(0, word) if count == 1 else requests.write_registers(0, [word] * count))

    @rule(count=st.integers(2, 3))
    def exchange(self, count):
        """Exchange values as with a heater board: the echo of the sequence number proves the reply."""
        self.sequence += 1
        request = requests.exchange(0, [self.sequence], 0, count)
        payload = self._payload(request, proved=False)
        if payload is None:
            return
        if payload[:2] != self.sequence.to_bytes(2, "big"):
            self.client.distrust()
        else:
            assert payload == self.device.answered[request.pdu][2:]

    def _execute(self, request, *, proved=False):
        copies_may_come = not (self.numbered or proved) and self.device.copies_until_s > self.client.clock.now_s()
        payload = self._payload(request, proved=proved)
        if payload is not None and copies_may_come and payload != self.device.answered.get(request.pdu, b"")[2:]:
            self.device.the_last_reply_is_a_copy()
        if payload is None or copies_may_come:
            return
        assert request.pdu in self.device.answered, "accepted, but the device never heard the request"
        if not request.writes:
            assert payload == self.device.answered[request.pdu][2:], "accepted the reply to another request"

    def _payload(self, request, *, proved):
        """Return the payload that the client accepts, or None after an error of the bus. No other error is allowed."""
        self.device.answered.clear()
        try:
            return self.client.execute(1, request, TIMING, proved=proved)
        except (DeadlineError, ProtocolError, ExceptionReply, TransportError):
            return None


class NumberedBusMachine(BusMachine):
    """The same state machine over Modbus TCP."""

    numbered = True
