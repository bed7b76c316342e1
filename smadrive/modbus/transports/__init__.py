"""Transports: connections that carry bytes with an absolute deadline (serial port, TCP socket, in process).

This package may import `framing`, `files`, `clock`, `errors`, `posix` and pyserial. Requests, replies and devices do
not belong here.
"""
