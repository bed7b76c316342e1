"""The board with the sma-reference map, in Python: firmware, checks, readings, calibration.

This package may import `config`, `sensors` and `bus`. `firmware_sim.board` implements the same board in C.
"""
