"""A board that runs the C core in this process: bytes, readings and times in; replies and outputs out.

`CoreBoard` calls the functions of `core/board.h`, as the program of a microcontroller does. It owns the storage. Its
caller gives the time, in ms since power-up.
"""

from __future__ import annotations

import ctypes

from firmware_sim.board.library import WORDS, Hardware, Inputs, Outputs, View, board_library

RECORD_BYTES = 14
REPLY_BYTES = 40
"""The largest size of a reply, in bytes."""
REPLY_BYTES_PER_BYTE = 5
"""A request to which `receive` returns a reply has at least 8 bytes, and 40 / 8 = 5."""


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
        """Start the firmware at the time 0 ms, with the calibration record in `storage`."""
        record = ctypes.create_string_buffer(self.storage, RECORD_BYTES)
        self._library.board_power_up(self._board, ctypes.byref(hardware), record)
        self._observe()

    def receive(self, data: bytes, now_ms: int) -> bytes:
        """Pass bytes from the line to the core, and return the bytes of its replies; empty if there is none."""
        replies = ctypes.create_string_buffer(REPLY_BYTES + REPLY_BYTES_PER_BYTE * len(data))
        length = self._library.native_receive(self._board, data, len(data), now_ms, replies, len(replies))
        self._save_calibration()
        self._observe()
        return replies.raw[:length]

    def pause(self, now_ms: int) -> bytes:
        """Tell the core that the line is silent, which ends a frame, and return the reply; empty if there is none."""
        length = self._library.native_pause(self._board, now_ms, self._reply, len(self._reply))
        self._observe()
        return self._reply.raw[:length]

    def tick(self, inputs: Inputs, now_ms: int) -> Outputs:
        """Run the safety interrupt, and return its outputs."""
        self._library.board_tick(self._board, ctypes.byref(inputs), now_ms, ctypes.byref(self._outputs))
        self._observe()
        return self._outputs

    def poll(self, now_ms: int) -> None:
        """Tell the core that the main loop runs. `tick` sets the fault `self_test` after 100 ms without this call."""
        self._library.board_poll(self._board, now_ms)

    def registers(self, now_ms: int) -> list[int]:
        """Return the words of the addresses 0 to 70; 0 for an address without a register."""
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
