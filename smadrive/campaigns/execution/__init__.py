"""The execution of a campaign: estimate, cluster, scheduling of the runs, and the journal in the output folder."""
