"""The health of a wire over its cycles: the record beside its file, its drift since the identification, its resistance.

May import what wire may import. The package runs makes the entries from logs. Faults belong to safety.
"""
