"""The Python exception that carries the exception code of a Modbus reply."""

from __future__ import annotations


class ModbusException(Exception):  # not an error of the simulator: a regular reply
    """Raised while a request is carried out: the device replies with the exception `code`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code
