"""Ports that belong to no rig yet: the devices on them, and the check of a board.

This package may import `devices` and `modbus`.
"""
