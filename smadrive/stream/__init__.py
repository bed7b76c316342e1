"""The stream of a running loop: samples and a status in shared memory.

Also the start, supervision and restart of the loop's child processes. The tuning page and the telemetry use this
package. It may import the table of log columns, the tick of the loop, and everything below them. Requests to the loop
do not belong here. Nothing here makes the loop wait.
"""
