"""The sensors on the wire: lag, noise, quantisation, drift, and sensor faults.

May import physics, config and fault_parameters. Registers of devices do not belong here.
"""
