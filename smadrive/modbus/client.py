"""The only client of a bus. It sends one request at a time, and waits for its reply until an absolute deadline.

The line (bus_line.py) sends and receives. The protocol (protocol.py) judges the bytes that arrived. The client decides
which requests are sent. If a late reply could be taken for the answer, the client sends a probe first: a read whose
reply looks different. A device answers in order, so no older reply can follow the reply to the probe.

The client retries reads after a missed deadline or a wrong reply. It never retries writes: the caller reads the value
back, and decides if it writes again.
"""

from __future__ import annotations

from math import inf
from threading import Lock

from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, SmadriveError, TransportError
from smadrive.modbus.bus import BusTiming, Trace
from smadrive.modbus.bus_line import BusLine, Transaction
from smadrive.modbus.failure import COUNTED, failure
from smadrive.modbus.protocol import ClientProtocol
from smadrive.modbus.requests import Request
from smadrive.modbus.transports.transport import Transport
from smadrive.modbus.verdict import FINAL_CODES, Outcome, Verdict

PROBES = 3
"""The largest number of probes before one request. If none of them excludes an older reply, the request fails."""


class ModbusClient:
    """Sends requests to the devices of one bus, one at a time; threads wait for each other."""

    def __init__(self, transport: Transport, trace: Trace | None = None) -> None:
        """No other client may use `transport`. bus.py describes the calls of `trace(time_s, direction, bytes)`."""
        self.transport = transport
        self.clock = transport.clock
        self._protocol = ClientProtocol(transport.framing)
        self._line = BusLine(transport, self._protocol, trace)
        self.counters = self._line.counters
        self.trace = self._line.trace
        self._turn = Lock()

    @property
    def connection(self) -> int:
        """The number of the connection that the next request uses. It changes when the connection is lost."""
        return self._line.connection

    def attempt_s(self, timing: BusTiming) -> float:
        """Return the time in s of a request that a silent device does not answer: a pause, and a missed deadline."""
        return self._line.attempt_s(timing)

    def execute(
        self,
        unit_id: int,
        request: Request,
        timing: BusTiming,
        connection: int | None = None,
        *,
        proved: bool = False,
        retry_until_s: float = inf,
    ) -> bytes:
        """Send `request` to `unit_id` and return the payload of the reply.

        connection: the number of the connection that the request must use; None allows any connection.
        proved: True sends a sync first (see probes.py), so that a second copy of an earlier reply cannot be taken for
        the answer. Set it for a read on which a safety decision depends.
        retry_until_s: no retry and no quarantine begins that a silent device would prolong beyond this time of the
        clock, in s.

        DeadlineError or ProtocolError when no right reply arrives (a read is retried first); ExceptionReply when the
        device rejects the request; TransportError when the connection is lost, when the present connection has another
        number than `connection`, or when the bus is not silent in time.
        """
        transaction = Transaction(unit_id, request, timing, retry_until_s)
        retries = 0 if request.writes else timing.read_retries
        while True:
            try:
                with self._turn:
                    return self._execute_once(transaction, connection, proved=proved)
            except (DeadlineError, ProtocolError):
                if retries == 0 or self._is_late(transaction):
                    raise
            retries -= 1
            self.counters.retries += 1

    def broadcast(self, request: Request, timing: BusTiming) -> None:
        """Send a write to all devices at once; return after the turnaround delay of the standard. No device replies."""
        with self._turn:
            self._line.broadcast(request, timing)

    def send_unconfirmed(self, unit_id: int, request: Request, timing: BusTiming) -> None:
        """Send a request without waiting for its reply. The reply counts as outstanding.

        Send nothing if the connection is known to be lost. Use this when the request matters more than its reply.
        """
        with self._turn:
            self._line.send_unconfirmed(Transaction(unit_id, request, timing))

    def distrust(self) -> None:
        """Record that the last reply answers an older request, as its content shows. The right reply may follow."""
        self._protocol.distrust(self.clock.now_s())

    def _execute_once(self, transaction: Transaction, connection: int | None, *, proved: bool) -> bytes:
        """Send the necessary probes, a sync if `proved`, then the request; return the payload of its reply."""
        unit_id, request = transaction.unit_id, transaction.request
        self._line.settle(transaction)
        if self._protocol.needs_probe(unit_id, request, self.clock.now_s()):
            self._probe(transaction)
            self._line.settle(transaction)
        if proved:
            self._sync(transaction)
            self._line.settle(transaction)
        if connection is not None and connection != self._line.connection:
            raise TransportError(
                "not sent, because the connection was opened anew and the device is not identified yet",
                where=self._where(unit_id, request),
                cure="try again",
            )
        return self._transact(transaction)

    def _transact(self, transaction: Transaction) -> bytes:
        """Send one request and return the payload of its reply. Raise the error of any verdict other than ANSWERED."""
        outcome = self._line.exchange(transaction)
        if outcome.verdict is not Verdict.ANSWERED:
            raise self._failure(outcome, transaction)
        self.counters.replies += 1
        return outcome.data

    def _failure(self, outcome: Outcome, transaction: Transaction) -> SmadriveError:
        """Count the failure and return its error."""
        for counter in COUNTED[outcome.verdict]:
            setattr(self.counters, counter, getattr(self.counters, counter) + 1)
        return failure(outcome, self._where(transaction.unit_id, transaction.request))

    def _probe(self, transaction: Transaction) -> None:
        """Send up to `PROBES` probes, until no older reply can be taken for the answer.

        After the first probe, no probe is sent that a silent device would prolong beyond `retry_until_s`.

        DeadlineError at once if a probe gets no reply. If no probe excludes an older reply, raise the error of the last
        probe; ProtocolError if no read can serve as a probe.
        """
        unit_id, request = transaction.unit_id, transaction.request
        reason: SmadriveError = ProtocolError(
            "not sent, because a late reply to an earlier request could be taken for the answer",
            where=self._where(unit_id, request),
            cure="wait 10 s, or restart the device",
        )
        for attempt in range(PROBES):
            probe = self._protocol.probes.probe_request(unit_id, request, attempt, self.clock.now_s())
            if probe is None:
                break
            self.counters.probes += 1
            try:
                self._transact(transaction._replace(request=probe))
            except (ProtocolError, ExceptionReply) as error:
                reason = error
            if not self._protocol.may_be_mistaken(unit_id, request, self.clock.now_s()):
                return
            if self._is_late(transaction):
                break
            self._line.settle(transaction)
        raise reason

    def _sync(self, transaction: Transaction) -> None:
        """Make the device answer a request of another kind. After this answer, no copy of an older reply can arrive."""
        unit_id, request = transaction.unit_id, transaction.request
        sync = self._protocol.probes.sync_request(unit_id, request, self.clock.now_s())
        try:
            self._ask(transaction._replace(request=sync))
        except DeadlineError:
            if not self._protocol.probes.stays_silent(unit_id, sync):
                raise
            self._line.settle(transaction)
            self._sync_by_answered_read(transaction)

    def _sync_by_answered_read(self, transaction: Transaction) -> None:
        """Synchronise with a device that did not answer the sync of `_sync`; the device may not support that read.

        Send a read that the device has answered before. If no such read can be a sync, send nothing. Then
        DeadlineError if a copy of an earlier reply to `request` may still arrive.
        """
        unit_id, request = transaction.unit_id, transaction.request
        now_s = self.clock.now_s()
        sync = self._protocol.probes.answered_sync_request(unit_id, request, now_s)
        if sync is not None:
            self._ask(transaction._replace(request=sync))
        elif self._protocol.probes.copy_may_follow(unit_id, request, now_s):
            raise DeadlineError(
                "not sent, because an older reply could be taken for the answer",
                where=self._where(unit_id, request),
                cure="try again in 10 s",
            )

    def _ask(self, sync: Transaction) -> None:
        """Send `sync` and wait for its reply. An exception with a code of `FINAL_CODES` counts as a reply."""
        self.counters.probes += 1
        try:
            self._transact(sync)
        except ExceptionReply as error:
            if error.code not in FINAL_CODES:  # the real answer may still come, so this exception proves nothing
                raise

    def _is_late(self, transaction: Transaction) -> bool:
        """Return True if a retry now would end after its `retry_until_s` with a silent device."""
        with_quarantine_s = 2.0 * self._line.attempt_s(transaction.timing)
        return self.clock.now_s() + with_quarantine_s > transaction.retry_until_s

    def _where(self, unit_id: int, request: Request) -> str:
        return f"{self.transport.name}, unit {unit_id}, function {request.function} at {request.address}"
