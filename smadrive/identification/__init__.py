"""Models from measured records: excitation, Duhem and T-S fuzzy Duhem fits, and how good they are."""

from smadrive.identification.duhem_fit import identify_duhem
from smadrive.identification.quality import Fit
from smadrive.identification.tsfuzzy_fit import identify_tsfuzzy
from smadrive.identification.validation import HoldOut, hold_out

__all__ = ["Fit", "HoldOut", "hold_out", "identify_duhem", "identify_tsfuzzy"]
