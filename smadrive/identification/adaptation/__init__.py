"""Online adaptation of the rules of a wire: the filter, the adapted rules, the adapted plane, the likely changes.

May import what identification may import. The running session that puts adapted rules in force belongs to tuning.
"""
