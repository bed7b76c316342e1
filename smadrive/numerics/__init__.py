"""Numerics that no library has: samples as arrays, interpolation, bounded least squares, BLAS threads.

May import the ground (errors) and numpy and scipy. Nothing about hysteresis, wires or files belongs here.
"""
