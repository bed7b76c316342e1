"""The sensors on the wire: lag, noise, quantisation, drift, and sensor faults.

May import physics and config. How a device shows a reading in its registers never belongs here.
"""
