"""Numerics that numpy and scipy do not offer: checks of samples, interpolation, bounded least squares, BLAS threads.

May import errors, numpy and scipy. Nothing about hysteresis, wires or files belongs here.
"""
