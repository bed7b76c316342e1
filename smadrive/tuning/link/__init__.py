"""The connection between the processes of the tuning page: shared memory, requests, supervised processes.

May import the ground, numpy and pydantic. Knows neither session nor page: both stand on it. Nothing here ever waits.
"""
