"""The board's firmware in C: `core/` for every target, `native/` for this computer, and its simulated device.

This package may import `devices`, `sensors`, `bus` and `config`. It imports without a C compiler; the library is built
when the first board needs it. The Python implementation of the board is `firmware_sim.devices.board`.
"""
