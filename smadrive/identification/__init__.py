"""Models from measured records: excitation, Duhem and T-S fuzzy Duhem fits, and how good they are."""

from smadrive.identification.duhem import identify_duhem
from smadrive.identification.quality.fit import Fit
from smadrive.identification.quality.hold_out import HoldOut, hold_out
from smadrive.identification.tsfuzzy.fit import identify_tsfuzzy

__all__ = ["Fit", "HoldOut", "hold_out", "identify_duhem", "identify_tsfuzzy"]
