"""Models from measured records: excitation; fits of heat, hysteresis, memory and resistance; quality; adaptation.

May import wire, hysteresis, numerics and files. Controllers, devices and log files do not belong here.
"""

from smadrive.identification.duhem import identify_duhem
from smadrive.identification.quality.metrics import Fit
from smadrive.identification.tsfuzzy.fit import identify_tsfuzzy

__all__ = ["Fit", "identify_duhem", "identify_tsfuzzy"]
