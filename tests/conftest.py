"""For all tests: no time limit on hypothesis' examples, since how fast a machine is says nothing of the code."""

from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
