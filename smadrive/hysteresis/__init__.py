"""Rate-independent hysteresis: Duhem, T-S fuzzy Duhem and Preisach models, exact steps, inverse, certificates.

May import numerics, files, display, errors, numpy and scipy. Heat, time, identification and control do not belong
here.
"""

from smadrive.hysteresis.certificate import Certificate
from smadrive.hysteresis.duhem import DuhemModel
from smadrive.hysteresis.fuzzy import GaussianSets, Rule, TrapezoidSets, TriangularSets
from smadrive.hysteresis.inverse import InverseFeedforward, InverseTrajectory, Inversion
from smadrive.hysteresis.memory.model import TSFuzzyPreisach
from smadrive.hysteresis.memory.plane import PreisachPlane
from smadrive.hysteresis.mixture import GaussianMixture
from smadrive.hysteresis.model import HysteresisModel, HysteresisState
from smadrive.hysteresis.model_file import IdentifiedModel, load_model, save_model
from smadrive.hysteresis.reversal import DeadBand, filter_reversals
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem

__all__ = [
    "Certificate",
    "DeadBand",
    "DuhemModel",
    "GaussianMixture",
    "GaussianSets",
    "HysteresisModel",
    "HysteresisState",
    "IdentifiedModel",
    "InverseFeedforward",
    "InverseTrajectory",
    "Inversion",
    "PreisachPlane",
    "Rule",
    "TSFuzzyDuhem",
    "TSFuzzyPreisach",
    "TrapezoidSets",
    "TriangularSets",
    "filter_reversals",
    "load_model",
    "save_model",
]
