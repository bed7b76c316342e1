"""A wire as a device of bluesky: `SmaWire`. bluesky itself is not imported; its protocols need no base class.

This package may import scripting and everything below it. Guide: docs/bluesky.md.
"""

from smadrive.bluesky.sma_wire import SmaWire

__all__ = ["SmaWire"]
