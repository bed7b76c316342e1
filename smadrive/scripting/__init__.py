"""smadrive for scripts and notebooks: the open rig, runs, wires, progress. The loop runs in a separate process.

`import smadrive` gives the public names. May import tuning/link for the scheduling of the loop, and runs and
everything below it. The experiments belong to runs, because the commands use them, too.
"""
