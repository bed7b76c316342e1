"""The wire: heat balance, phase transformation, ageing, faults of the heater circuit; Flexinol and random wires.

May import config and fault_parameters of the simulator, and hysteresis, numerics and errors of smadrive. Registers,
frames, sensors and clocks do not belong here.
"""
