"""The live tuning page: a session in the driver, and three child processes.

session/ is the session, front/ answers OFF, page/ shows the run and sends requests, builder/ builds models, link/
connects the processes. The page of `smadrive watch` uses front/ and page/ without a session; watching.py sends its
data. This package may import runs, stream and everything below them. Device registers, identification algorithms and
anything that the loop would wait for do not belong here.
"""
