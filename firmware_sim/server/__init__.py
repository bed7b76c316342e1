"""The served process: listen addresses, endpoints (pseudo-terminal, TCP) and the loop that moves bytes and time.

May import all other packages of the simulator. The content of replies does not belong here.
"""
