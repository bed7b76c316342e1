"""Before a run: can the wire follow the reference?"""
