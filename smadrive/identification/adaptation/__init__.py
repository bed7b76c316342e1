"""Online adaptation of the model of a wire: the filter, the adapted rules, the adapted plane, the likely changes.

May import what identification may import. The session that puts an adapted model in force belongs to tuning.
"""
