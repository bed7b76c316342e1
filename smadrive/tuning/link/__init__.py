"""The connection between the processes of the tuning page: shared memory, requests, supervised processes.

It may import the table of log columns, the tick of the loop, files, numerics, errors, numpy, pydantic and pyzmq. It
must not import the session or the pages, which use this package. Nothing here makes the loop wait.
"""
