"""One board of the C core, in this process: bytes, readings and times in; replies and outputs out.

The calls are those of `core/board.h`. This class plays the target: it owns the storage and drives the clock.
"""

from __future__ import annotations

import ctypes

from firmware_sim.board.library import WORDS, Hardware, Inputs, Outputs, View, board_library

RECORD_BYTES = 14
REPLY_BYTES = 40
"""No reply is longer, and no request is shorter than 8 bytes, so 5 bytes of replies for each byte are enough."""
REPLY_BYTES_PER_BYTE = 5


class CoreBoard:
    """A board with this hardware. `storage` holds its calibration record."""

    def __init__(self, hardware: Hardware, storage: bytes) -> None:
        self._library = board_library()
        self._board = ctypes.create_string_buffer(self._library.native_size())
        self._view, self._outputs = View(), Outputs()
        self._reply = ctypes.create_string_buffer(REPLY_BYTES)
        self._words = (ctypes.c_uint16 * WORDS)()
        self.storage = storage
        self.power_up(hardware)

    def power_up(self, hardware: Hardware) -> None:
        """Start the firmware at the time 0 ms, with the record of the storage."""
        record = ctypes.create_string_buffer(self.storage, RECORD_BYTES)
        self._library.board_power_up(self._board, ctypes.byref(hardware), record)
        self._observe()

    def receive(self, data: bytes, now_ms: int) -> bytes:
        """Take bytes from the line, and return the bytes of the replies."""
        replies = ctypes.create_string_buffer(REPLY_BYTES + REPLY_BYTES_PER_BYTE * len(data))
        length = self._library.native_receive(self._board, data, len(data), now_ms, replies, len(replies))
        self._save_calibration()
        self._observe()
        return replies.raw[:length]

    def pause(self, now_ms: int) -> bytes:
        """Report a pause of the line, and return the bytes of the reply."""
        length = self._library.native_pause(self._board, now_ms, self._reply, len(self._reply))
        self._observe()
        return self._reply.raw[:length]

    def tick(self, inputs: Inputs, now_ms: int) -> Outputs:
        """Run the safety interrupt, and return its outputs."""
        self._library.board_tick(self._board, ctypes.byref(inputs), now_ms, ctypes.byref(self._outputs))
        self._observe()
        return self._outputs

    def poll(self, now_ms: int) -> None:
        """Show the firmware that its main loop runs."""
        self._library.board_poll(self._board, now_ms)

    def registers(self, now_ms: int) -> list[int]:
        """Return all words from address 0 on, and 0 where no register is."""
        self._library.native_registers(self._board, now_ms, ctypes.byref(self._words))
        return list(self._words)

    @property
    def view(self) -> View:
        """The state after the last call."""
        return self._view

    def _observe(self) -> None:
        self._library.native_observe(self._board, ctypes.byref(self._view))

    def _save_calibration(self) -> None:
        record = ctypes.create_string_buffer(RECORD_BYTES)
        if self._library.board_take_calibration(self._board, record):
            self.storage = record.raw
