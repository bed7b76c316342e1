"""Device profiles: one TOML file per type of device, validated at load, and the conversion of its registers.

May import files and modbus. Never here: a connection, a request on its way, the state of a device.
"""
