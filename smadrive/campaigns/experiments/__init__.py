"""One run of a campaign: its simulated rig, its identification, its tracking, its metrics. A worker imports only this.

It draws nothing and prints nothing. The same settings give the same result, to the last bit.
"""
