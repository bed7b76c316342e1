"""Heat sources (heater board, bench supply, TCLab), and the proof that no current flows.

This package may import `devices` and `modbus`. Limits that depend on a temperature, and every decision to heat, belong
to `devices.heater`.
"""
