"""A simulated device behind real ports: the stand-in for hardware in demos, tests and development.

May import devices.profile, modbus, hysteresis, clock and files of smadrive. Control, identification, safety and
anything above them never belong here: the simulator must not share the driver's decisions.
"""
