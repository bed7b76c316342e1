"""The calibration of a rig's sensors: the readings at known values, and the storage of the result.

May import what `rig` may. The fit belongs to `identification`, the section of the rig file to `devices`.
"""
