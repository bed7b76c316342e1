"""Campaigns: many simulated runs, or many fits of records, on a Dask cluster.

It may import runs and everything below it, and firmware_sim. It needs the extra `campaign`. The control of one run
never belongs here.
"""
