"""The wire: heat balance, resistance, model that steps heat and hysteresis together, file, data sheet.

May import hysteresis, numerics, files, display, posix and errors. Fits, controllers and devices do not belong here.
"""
