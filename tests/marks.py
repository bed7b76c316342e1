"""Parameters of tests that only `pytest -m exhaustive` runs."""

import pytest


def exhaustive(*values):
    """Return the `pytest.param` of a case that is left out by default. Another case tests the same behaviour."""
    return pytest.param(*values, marks=pytest.mark.exhaustive)
