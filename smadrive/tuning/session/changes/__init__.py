"""Changes of the model, the feedback and the reference: queued, built, put in force, undone, compared.

May import `tuning.builder`, `tuning.link` and `tuning.tuning`; never the session around it, and no device.
"""
