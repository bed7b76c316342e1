"""The shipped rig in process, with an experiment of about a minute of virtual time."""

from pathlib import Path

SHIPPED = Path(__file__).parents[1] / "configs/rigs/in-process.toml"
BRIEF = {"low_c = 40.0": "low_c = 60.0", "rate_c_per_s = 6.0": "rate_c_per_s = 10.0\nreversals = 2"}
"""What the rig file has, and what replaces it."""


def brief_rig(folder):
    """Write the rig file into the folder and return its name: `brief.toml`."""
    text = SHIPPED.read_text()
    for shipped, brief in BRIEF.items():
        assert shipped in text
        text = text.replace(shipped, brief)
    (folder / "brief.toml").write_text(text)
    return "brief.toml"
