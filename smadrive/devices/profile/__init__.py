"""Device profiles (one TOML file per type of device, validated at load), and the conversion of register values.

This package may import `files` and `modbus`. Connections, requests and the state of a device do not belong here.
"""
