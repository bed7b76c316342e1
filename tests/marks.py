"""Parameters of tests that only `pytest -m exhaustive` runs."""

import pytest


def exhaustive(*values):
    """`pytest.param` for a case that is left out by default, because another case stands for its behaviour."""
    return pytest.param(*values, marks=pytest.mark.exhaustive)
