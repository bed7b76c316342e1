"""The firmware for an Arduino Nano or Uno, in C, and the image of its EEPROM.

`eeprom.py` imports nothing of the project, because the Makefile runs it.
"""
