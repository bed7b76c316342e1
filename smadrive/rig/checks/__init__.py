"""Checks of a rig before the heat: its limits against its wire, and its sensors against the chosen displacement."""
