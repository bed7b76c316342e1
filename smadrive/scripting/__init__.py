"""smadrive for scripts and notebooks: an open rig whose loop runs in a process of its own, runs, wires, progress.

`import smadrive` offers the public names. May import tuning/link for the scheduling of the loop, and runs and
everything below it. Experiments themselves belong to runs: the commands share them.
"""
