"""The sensors on the wire: lag, noise, quantisation, drift, and sensor faults.

May import physics and config. Registers of devices do not belong here.
"""
