"""The firmware of the ATmega328P on an emulated microcontroller, as the firmware of a simulated device.

This package may import the same packages as firmware_sim.board. The emulator itself is written in C, in `chips/`.
"""
