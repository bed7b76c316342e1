"""The bus of a simulated device: ports that cut bytes into requests, faults of replies and of the line, line speed.

May import fault_parameters and smadrive.modbus. Registers, firmware, physics and sockets do not belong here.
"""
