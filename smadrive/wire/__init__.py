"""The wire: its heat balance, its model that steps heat and hysteresis together, its file, its data sheet.

May import hysteresis, numerics and files. Fits, controllers and devices do not belong here.
"""
