"""A tuning: all settings that can be tuned, as one immutable value. A change makes a new tuning."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from smadrive.control.references.limits import check_rig_limits
from smadrive.control.references.reference import Reference
from smadrive.errors import CertificateError, ConfigError, ModelError
from smadrive.files.config import validate
from smadrive.hysteresis import DuhemModel, IdentifiedModel, InverseFeedforward, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.hysteresis.model_file import model_text, parse_model
from smadrive.identification.adaptation.adaptation import ADAPTED, Adaptation
from smadrive.identification.reshape import BranchShape, reshaped, shape_of
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import FeedbackConfig, LimitsConfig
from smadrive.tuning.link.requests import SetFeedback, SetModel, SetRule, SetShape, SetSource
from smadrive.wire.wire_model import travel_mm


@dataclass(frozen=True)
class Adapted:
    """The change that puts the rules of `adaptation` into the tuning. They are read when the build request is sent."""

    adaptation: Adaptation


Change = SetShape | SetFeedback | SetSource | SetRule | SetModel | Adapted


@dataclass(frozen=True)
class Tuning:
    """A model, the settings of the feedback, and the source of the displacement.

    model      `unmoved` with its branches moved, widened and scaled to `shape`
    unmoved    the model as identified, fitted, adapted or edited
    shape      place and width of the branches, and scale of the displacement
    change     name of the change that made this tuning
    caveats    reasons to distrust the model. They stay until a SetModel replaces the model
    """

    model: IdentifiedModel
    unmoved: IdentifiedModel
    shape: BranchShape
    feedback: FeedbackConfig
    change: str
    caveats: tuple[str, ...] = ()
    displacement_from: DisplacementFrom = DisplacementFrom.SENSOR

    @classmethod
    def of(
        cls,
        model: IdentifiedModel,
        feedback: FeedbackConfig,
        change: str,
        caveats: tuple[str, ...] = (),
        displacement_from: DisplacementFrom = DisplacementFrom.SENSOR,
    ) -> Tuning:
        """Return a tuning of `model`, whose branches have not been moved."""
        return cls(model, model, shape_of(model), feedback, change, caveats, displacement_from)

    def drives_as(self, other: Tuning) -> bool:
        """Return True if both tunings drive a wire in exactly the same way. Names and caveats do not matter."""
        texts = [model_text(tuning.model, {}, place=tuning.change) for tuning in (self, other)]
        settings = [(tuning.feedback, tuning.displacement_from) for tuning in (self, other)]
        return settings[0] == settings[1] and texts[0] == texts[1]

    def changed(self, change: Change) -> Tuning:
        """Return the tuning after a change. ConfigError, ModelError or CertificateError for an invalid change."""
        match change:
            case SetShape(key=key, value=value):
                shape = self.shape._replace(**{key: value})
                return replace(self, model=reshaped(self.unmoved, shape), shape=shape, change=key)
            case SetFeedback(key=key, value=value):
                settings = {**self.feedback.model_dump(), key: value}
                return replace(self, feedback=validate(settings, FeedbackConfig, where="feedback"), change=key)
            case SetSource(displacement_from=source):
                return replace(self, displacement_from=source, change=change.key)
            case SetRule():
                return self._with_model(_with_rule(self.model, change), change.name, self.caveats)
            case SetModel(text=text, source=place, caveats=caveats):
                return self._with_model(parse_model(text, place=place), place, caveats)
            case Adapted(adaptation=adaptation):
                return self._with_model(adaptation.model, ADAPTED, self.caveats)

    def _with_model(self, model: IdentifiedModel, change: str, caveats: tuple[str, ...]) -> Tuning:
        return replace(self, model=model, unmoved=model, shape=shape_of(model), change=change, caveats=caveats)

    def check(self, limits: LimitsConfig, reference: Reference | None) -> None:
        """Raise an error when a wire must not be driven with this tuning.

        CertificateError when the certificate of the model does not hold. ConfigError when the centre μ of a branch is
        not below `temperature_max_c`, or when `reference` leaves the travel of the wire, leaves the displacement limits
        of the rig, or needs a temperature above `temperature_max_c`.
        """
        certificate = self.model.certificate()
        if not certificate.holds:
            shortcomings = ", ".join(certificate.shortcomings)
            raise CertificateError(
                "a model without a certificate may not drive a wire",
                where="changed model",
                value=shortcomings,
                cure="undo the change, or choose another value",
            )
        for name in ("mu_heating", "mu_cooling"):
            value = getattr(self.shape, name)
            if not value < limits.temperature_max_c:
                raise ConfigError(
                    "the centre of this branch is not below temperature_max_c, so the wire could not follow",
                    where=name,
                    value=f"{value:g} °C",
                    limit=f"{limits.temperature_max_c:g} °C",
                )
        if reference is not None:
            check_rig_limits(reference.scored_mm, limits.displacement_min_mm, limits.displacement_max_mm)
            reference.check_within(travel_mm(self.model))
            self._check_temperature(limits, reference)

    def _check_temperature(self, limits: LimitsConfig, reference: Reference) -> None:
        cold = self.model.initial_state(self.model.input_range[0])
        hot_mm = max(reference.displacement_mm.tolist(), key=lambda mm: abs(mm - cold.y))
        needed_c = InverseFeedforward(self.model).update(cold, hot_mm).v
        if needed_c > limits.temperature_max_c:
            raise ConfigError(
                f"this displacement needs {needed_c:.1f} °C, which is above temperature_max_c",
                where="reference",
                value=f"{hot_mm:.3g} mm",
                limit=f"{limits.temperature_max_c:g} °C",
                cure="choose a smaller reference, or another value of the tuning",
            )


def _with_rule(model: IdentifiedModel, change: SetRule) -> TSFuzzyDuhem | TSFuzzyPreisach:
    if isinstance(model, DuhemModel):
        raise ModelError(
            "a Duhem model has no rules",
            cure="move its branches, or identify the wire by `smadrive identify --kind tsfuzzy`",
        )
    if isinstance(model, TSFuzzyPreisach):
        return TSFuzzyPreisach(_changed_rules(model.local, change), model.plane, model.share)
    return _changed_rules(model, change)


def _changed_rules(model: TSFuzzyDuhem, change: SetRule) -> TSFuzzyDuhem:
    sets = len(model.sets.centres)
    if change.index >= sets:
        raise ModelError("the model has no rule with this index", where="index", value=change.index, limit=sets - 1)
    laws = {
        "a_heating": model.heating_law[0],
        "b_heating": model.heating_law[1],
        "a_cooling": model.cooling_law[0],
        "b_cooling": model.cooling_law[1],
    }
    branch = change.branch
    for symbol, value in (("a", change.a), ("b", change.b)):
        law = np.array(laws[f"{symbol}_{branch}"])
        law[change.index] = value
        laws[f"{symbol}_{branch}"] = law
    _check_rule(change)
    return TSFuzzyDuhem(model.sets, **laws, scale=model.scale, offset=model.offset, input_range=model.input_range)


def _check_rule(change: SetRule) -> None:
    """Raise ModelError when this rule alone breaks the certificate. The `where` of the error is "a" or "b".

    A heating rule needs a < 0 and 0 ≤ b ≤ -a, a cooling rule a > 0 and -a ≤ b ≤ 0.
    """
    sign = -change.direction
    if not sign * change.a > 0:
        raise ModelError(
            f"with this value the {change.branch} rule is not stable",
            where="a",
            value=f"{change.a:g}",
            limit=f"a {'<' if sign < 0 else '>'} 0",
            cure=f"enter a number {'below' if sign < 0 else 'above'} 0",
        )
    low, high = sorted((0.0, -change.a))
    if not low <= change.b <= high:
        raise ModelError(
            "with this value the state of the model leaves [0, 1]",
            where="b",
            value=f"{change.b:g}",
            limit=f"{low:g} to {high:g}",
            cure="enter a number within this limit",
        )
