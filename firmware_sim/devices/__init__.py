"""The devices: firmware (board, supply, instrument, TCLab), register bank, Modbus responder, replay of a trace.

May import bus, sensors and physics, and smadrive.devices.profile and smadrive.modbus. Sockets, pseudo-terminals and
real time do not belong here.
"""
