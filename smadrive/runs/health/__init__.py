"""The health record of a wire, made from logs: an entry for each run, and the assessment of the wire.

May import what runs may import. The format of the record and the drift belong to smadrive/wire/health.
"""
