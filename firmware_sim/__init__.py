"""A simulated device behind real ports. It replaces the hardware in demos, tests and development.

May import devices.profile, modbus, hysteresis, clock, real_time and files of smadrive. It must not import control,
identification, safety or anything above them, so that the simulator does not share the decisions of the driver.
"""
