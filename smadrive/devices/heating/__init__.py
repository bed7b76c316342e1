"""Heat sources: heater board, bench supply, TCLab, and the proof that no current flows.

May import devices and modbus. Never here: limits from a temperature or any decision to heat; `devices.heater` has them.
"""
