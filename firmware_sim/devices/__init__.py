"""The devices: firmware (board, supply, instrument, TCLab), register bank, Modbus responder, replay of a trace.

May import config, fault_parameters, bus, sensors and physics of the simulator, and clock, devices.profile, files,
modbus and errors of smadrive. Sockets, pseudo-terminals and real time do not belong here.
"""
