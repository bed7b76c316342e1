"""Checks of an `sma-reference` board on the desk: conformance frames, and the safety checks that need no wire.

This package may import the other packages of `devices`, and `modbus`.
"""
