"""A simulated device behind real ports. It replaces the hardware in demos, tests and development.

It may import these parts of smadrive: `devices.profile`, `modbus`, `hysteresis`, `numerics`, `files`, `clock`,
`real_time`, `posix` and `errors`. It must not import `wire`, `control`, `identification`, `safety` or anything above
them, so that the simulator does not share the decisions of the driver.
"""
