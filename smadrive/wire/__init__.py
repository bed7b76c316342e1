"""The wire: heat balance, resistance, model that steps heat and hysteresis together, file, data sheet.

May import hysteresis, numerics and files. Fits, controllers and devices do not belong here.
"""
