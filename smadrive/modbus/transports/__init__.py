"""Transports: connections that carry bytes with an absolute deadline (serial port, TCP socket, in process).

May import framing, clock, errors and pyserial. Never here: requests, replies, devices.
"""
