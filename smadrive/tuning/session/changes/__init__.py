"""Changes of the tuning and of the reference: queued, built, put in force, undone, compared.

It may import `tuning.builder`, `tuning.link`, `tuning.tuning`, the maths and the rig file; never the rest of the
session, and no device.
"""
