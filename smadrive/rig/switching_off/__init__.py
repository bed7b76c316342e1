"""Switching a rig off from outside: stop its drivers, confirm the safe state of its devices, show waiting guardians.

This package may import the devices, and the rig's plan and connections. Controllers, wires and limits do not belong
here, because switching off must work without them.
"""
