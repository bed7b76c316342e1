"""The calibration of a rig's sensors: the readings at known values, and the storage of the result.

This package may import everything that `rig` may import. The fit belongs to `identification`. The section of the rig
file belongs to `devices`.
"""
