"""The board's firmware in C: `core/` for every target, `native/` for this computer, `atmega328p/` for an Arduino.

`emulator/` runs the program of the ATmega328P. This package may import `devices`, `sensors`, `bus` and `config`.
Importing this package needs no C compiler: the C code is built when the first board needs it. The Python
implementation of the board is `firmware_sim.devices.board`.
"""
