"""The board of docs/sma-reference.md as a program in C: its core, its targets, and what runs it on this computer.

May import config, bus, sensors, physics and devices. Register maps and endpoints do not belong here.
"""
