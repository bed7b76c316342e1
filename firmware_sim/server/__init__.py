"""The simulator as a process: listen addresses, endpoints (pseudo-terminal, TCP), the loop that moves bytes and time.

May import all other packages of the simulator. The content of replies does not belong here.
"""
