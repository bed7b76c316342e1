"""Frames around a PDU: Modbus RTU with its CRC, Modbus TCP with its header.

This package may import `errors`, fastcrc and pymodbus; no other package imports pymodbus. Ports, clocks and the
meaning of a PDU do not belong here.
"""
