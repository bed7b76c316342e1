"""The stream of a running loop: samples and a status in shared memory, and the child processes that read them.

Tuning page and telemetry stand on this package. It may import the table of log columns, the tick of the loop, and
everything below them. Requests to the loop do not belong here. Nothing here makes the loop wait.
"""
