"""The messages with live values: samples, state and faults of a rig, published to an MQTT broker.

The loop writes into shared memory and never waits. A separate process, the publisher process, sends the values to the
broker. This package may import `stream`, rig, the table of columns and everything below them. Only `broker.py` imports
paho-mqtt. Messages, topics and units: docs/telemetry.md.
"""
