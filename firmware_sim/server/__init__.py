"""The served process: listen addresses, endpoints (pseudo-terminal, TCP) and the loop that moves bytes and time.

May import everything below it. What a device answers never belongs here.
"""
