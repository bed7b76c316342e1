"""The wire as one object: heat balance, hysteresis and heat stepped together, its file, its data sheet.

May import hysteresis, numerics and files. Fits, controllers and devices do not belong here.
"""
