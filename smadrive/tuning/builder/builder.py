"""The workshop: models are changed and checked, controllers built, in a process beside the loop.

An order is complete in itself, so that a workshop that died is replaced by a new one. What a tick pays is the price of
handing over: an order is some kilobytes, what is built comes back as one parcel that needs only to be unpacked. One
order is worked on at a time.

    loop → workshop   models as their text: the tables of their branches are long, and the workshop keeps the last ones
    workshop → loop   what came with the order is only named, so that it stays the same thing in the loop
"""

from __future__ import annotations

import io
import pickle
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.reference import Reference
from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem
from smadrive.hysteresis.model_file import model_text, parse_model
from smadrive.identification.reshape import Model
from smadrive.rig.config import RigConfig
from smadrive.rig.controllers import tracking_controller
from smadrive.tuning.tuning import Change, Tuning
from smadrive.wire.heat_balance import HeatBalance

KEPT_MODELS = 16


@dataclass(frozen=True)
class Order:
    """A tuning, what is to be changed in it, and the reference that it has to track; None while the heater is off."""

    tuning: Tuning
    change: Change | None
    reference: Reference | None
    config: RigConfig
    balance: HeatBalance


class Prepared(NamedTuple):
    """What is ready to be put in force; no controller while the heater is off."""

    tuning: Tuning
    reference: Reference | None
    controller: TrackingController | None


class Refused(NamedTuple):
    """Why it may not be."""

    reason: str


Outcome = Prepared | Refused


class ModelBuilder(Protocol):
    """Works on one order at a time."""

    def begin(self, order: Order) -> None:
        """Take an order; only when the outcome of the one before has been fetched."""
        ...

    def outcome(self) -> Outcome | None:
        """What became of it; None while it is being worked on."""
        ...


def prepare(order: Order) -> Prepared:
    """Change, check, and build the controller that will take over. ConfigError, ModelError, CertificateError."""
    tuning = order.tuning if order.change is None else order.tuning.changed(order.change)
    order.config.check_feedback(tuning.feedback)
    tuning.check(order.config.limits, order.reference)
    if order.reference is None:
        return Prepared(tuning, None, None)
    controller = tuned_controller(tuning, order.reference, order.config, order.balance)
    return Prepared(tuning, order.reference, controller)


def tuned_controller(
    tuning: Tuning, reference: Reference, config: RigConfig, balance: HeatBalance
) -> TrackingController:
    """The controller of a tuning on a reference, as the rig's file has it otherwise."""
    tuned = config.model_copy(update={"feedback": tuning.feedback})
    return tracking_controller(tuned, reference, tuning.model, balance, HysteresisInverse(tuning.model))


class Models:
    """The last models by their text: parsing one again takes the time of tabulating its branches."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, Model] = OrderedDict()

    def keep(self, model: Model) -> None:
        """Keep it; the one that was used longest ago goes."""
        self._kept[_text(model)] = model
        while len(self._kept) > KEPT_MODELS:
            self._kept.popitem(last=False)

    def of(self, text: str) -> Model:
        """The model of a text."""
        if text not in self._kept:
            self.keep(parse_model(text, place="the tuning in force", allow_uncertified=True))
        self._kept.move_to_end(text)
        return self._kept[text]


class _OrderPickler(pickle.Pickler):
    def persistent_id(self, thing: object) -> str | None:
        return _text(thing) if isinstance(thing, DuhemModel | TSFuzzyDuhem) else None


class _OrderUnpickler(pickle.Unpickler):
    def __init__(self, parcel: bytes, models: Models) -> None:
        super().__init__(io.BytesIO(parcel))
        self._models = models

    def persistent_load(self, text: str) -> Model:
        return self._models.of(text)


class _OutcomePickler(pickle.Pickler):
    """By `reducer_override`, which is asked for objects only: `persistent_id` is asked for every number, too."""

    def __init__(self, file: io.BytesIO, order: Order) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._numbers = {id(thing): number for number, thing in enumerate(_known(order))}

    def reducer_override(self, thing: object) -> Any:
        number = self._numbers.get(id(thing))
        return NotImplemented if number is None else (_named, (number,))


class _OutcomeUnpickler(pickle.Unpickler):
    def __init__(self, parcel: bytes, order: Order) -> None:
        super().__init__(io.BytesIO(parcel))
        self._known = _known(order)

    def find_class(self, module: str, name: str) -> Any:
        return self._known.__getitem__ if name == _named.__name__ else super().find_class(module, name)


def packed_order(order: Order) -> bytes:
    """An order as it travels."""
    file = io.BytesIO()
    _OrderPickler(file, pickle.HIGHEST_PROTOCOL).dump(order)
    return file.getvalue()


def unpacked_order(parcel: bytes, models: Models) -> Order:
    """What `packed_order` packed."""
    order: Order = _OrderUnpickler(parcel, models).load()
    return order


def packed_outcome(outcome: Outcome, order: Order) -> bytes:
    """An outcome as it travels."""
    file = io.BytesIO()
    _OutcomePickler(file, order).dump(outcome)
    return file.getvalue()


def unpacked_outcome(parcel: bytes, order: Order) -> Outcome:
    """What `packed_outcome` packed; `order` is the one that was given."""
    outcome: Outcome = _OutcomeUnpickler(parcel, order).load()
    return outcome


def _known(order: Order) -> list[Any]:
    """What both sides have: it keeps its identity."""
    return [order.tuning, order.tuning.model, order.tuning.unmoved, order.reference]


def _named(number: int) -> object:
    """In a parcel, the thing of the order that has this number; the unpickler knows the order."""
    raise TypeError(f"thing {number} of an order is known to `unpacked_outcome` alone")


def _text(model: Model) -> str:
    return model_text(model, {}, place="model")
