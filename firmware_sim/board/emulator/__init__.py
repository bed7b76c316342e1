"""The firmware of the ATmega328P on an emulated microcontroller, as the firmware of a simulated device.

May import what firmware_sim.board may. The emulator itself is written in C, in `chips/`.
"""
