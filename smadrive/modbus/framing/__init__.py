"""Frames around a PDU: Modbus RTU with its CRC, Modbus TCP with its header.

May import errors; the one place that imports pymodbus. Never here: ports, clocks, the meaning of a PDU.
"""
