"""The health of a wire over its cycles: the record beside its file, its drift since the identification, its resistance.

May import what wire may import. Entries are made from logs in runs; faults belong to safety.
"""
