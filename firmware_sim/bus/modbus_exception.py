"""Exception codes of the Modbus standard, and the Python exception that carries such a code."""

from __future__ import annotations

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
DEVICE_FAILURE = 4
NO_SUCH_UNIT = 11


class ModbusException(Exception):  # not an error of the simulator: a regular reply
    """Raised while a request is carried out: the device replies with the exception `code`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code
