"""Checks of the settings of a run: they are complete, they agree, and every key has an effect.

A key without an effect is an error. Otherwise the table would name a setting that no run had, for example
`wire.alloy = "HT"` for runs on the wire of the sim file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from smadrive.campaigns.plan.axes import Axis
from smadrive.campaigns.plan.config import Experiment, RunSettings
from smadrive.errors import ConfigError

NEEDED = {"wire.alloy": "wire.diameter_mm", "wire.length_m": "wire.diameter_mm", "wire.kind": "wire.seed"}
"""Keys that have an effect only together with another key: the key to the key that it needs."""

OF_TRACKING = ("controller", "reference", "disturbance", "displacement_sensor", "rig.displacement_from")
OF_RECORDS = ("record", "fit.input", "fit.output")
UNUSED: dict[Experiment, tuple[str, ...]] = {
    "track": OF_RECORDS,
    "identify": (*OF_RECORDS, *OF_TRACKING),
    "fit": ("model", "rig", "sim", "wire", "seed", *OF_TRACKING),
}
"""The keys that have no effect in an experiment."""

EXCLUDED = {
    "fit": ("model", "the run identifies no wire"),
    "rig.excitation": ("model", "the run identifies no wire"),
    "rig.wire": ("wire.diameter_mm", "its wire has a data sheet of its own"),
    "sim.transformation.kind": ("wire.seed", "a random wire has a kind of its own, which `wire.kind` sets"),
}
"""Keys that have no effect together with another key: the other key, and the reason."""

IN_NO_CAMPAIGN = {
    "rig.feedback.adapt": ("only `smadrive tune` adapts the rules", "remove it"),
    "rig.model": ("its runs use the key `model` of [run]", "remove it, or write `model` in its place"),
    "rig.off_by_mqtt": ("it publishes nothing to a broker", "remove it"),
    "sim.devices": ("its devices are those of the rig", "remove it, or change `rig.devices`"),
}
"""The keys of rig and simulated wire that have no effect in any campaign: reason and cure."""

OF_SENSOR = "_displacement"
"""The end of the names of the faults of a displacement sensor."""

Table = Mapping[str, Any]
"""The keys that a campaign file sets for a run."""


class _Useless(NamedTuple):
    """A key without an effect, why it has none, and the cure."""

    key: str
    why: str
    cure: str


def check_seeds(table: Table, axes: Sequence[Axis]) -> None:
    """Raise ConfigError if `table`, the table [run], sets a seed that random wires or repeats count up."""
    for number, axis in enumerate(axes, 1):
        for key in filter(lambda path: axis.is_sample and _is_set(table, path), axis.settings[0]):
            why = f"because [[vary]] {number} counts up from the seed of the campaign"
            cure = "remove it, or set the seed of the campaign: the key `seed` before [run]"
            raise ConfigError(f"has no effect, {why}", where=f"[run]: {key}", value=_value(table, key), cure=cure)


def check_settings(table: Table, settings: RunSettings, axes: Sequence[Axis], faults: Sequence[str]) -> None:
    """Raise ConfigError for a run that lacks a setting, or whose settings contradict each other or have no effect.

    `settings` are the settings of the run, and `table` the keys that the file sets for it, in [run] or on `axes`.
    `faults` are the faults of its disturbance.
    """
    _check_complete(settings)
    varied = frozenset(path for axis in axes for path in axis.settings[0])
    for useless in (*_useless(table, settings), *_useless_unless_varied(table, settings, varied, faults)):
        where = f"{_table_of(useless.key, axes)}: {useless.key}"
        raise ConfigError(f"has no effect {useless.why}", where=where, cure=useless.cure)


def _check_complete(settings: RunSettings) -> None:
    if settings.experiment == "track" and settings.reference is None:
        cure = 'write reference = "NAME" in [run], and [references.NAME] with its shape'
        raise ConfigError('experiment = "track" needs a reference', where="[run]", cure=cure)
    if settings.experiment == "fit" and settings.record is None:
        cure = 'write record = "FILE" in [run], or records = "*.h5" in [[vary]]'
        raise ConfigError('experiment = "fit" needs a record', where="[run]", cure=cure)
    if settings.experiment == "identify" and settings.model is not None:
        cure = 'remove `model`, or write experiment = "track"'
        raise ConfigError('experiment = "identify" fits a model, and `model` gives one', where="[run]", cure=cure)
    if settings.model is not None and settings.controller in ("plain-map", "duhem-inverse"):
        what = f"controller = '{settings.controller}' is fitted to an excitation, and 'model' leaves the excitation out"
        raise ConfigError(what, where="[run]", cure="remove one of the two keys")


def _useless(table: Table, settings: RunSettings) -> Iterator[_Useless]:
    """Yield the keys of the run that have no effect."""
    experiment = settings.experiment
    for key in UNUSED[experiment]:
        if _is_set(table, key):
            other = "fit" if key in OF_RECORDS else "track"
            cure = f'remove it, or write experiment = "{other}" in [run]'
            yield _Useless(key, f'with experiment = "{experiment}"', cure)
    for key, needed in NEEDED.items():
        if _is_set(table, key) and not _is_set(table, needed):
            more = ", or random_wires in [[vary]]" if needed == "wire.seed" else ""
            yield _Useless(key, f"without {needed}", f"remove it, or write {needed}{more}")
    for key, (other, why) in EXCLUDED.items():
        if _is_set(table, key) and _is_set(table, other):
            yield _Useless(key, f"with {other}: {why}", "remove one of the two keys")
    for key, (why, cure) in IN_NO_CAMPAIGN.items():
        if _is_set(table, key):
            yield _Useless(key, f"in a campaign: {why}", cure)


def _useless_unless_varied(
    table: Table, settings: RunSettings, varied: frozenset[str], faults: Sequence[str]
) -> Iterator[_Useless]:
    """Yield the keys that the run cannot use, unless the setting on which this depends varies between the runs."""
    if settings.controller == "feedback-only" and "controller" not in varied:
        by_sensor = settings.displacement_sensor and settings.rig.get("displacement_from", "sensor") == "sensor"
        by_sensor = by_sensor and varied.isdisjoint({"displacement_sensor", "rig.displacement_from"})
        key = "rig.feedback" if by_sensor else "rig.feedback.feedforward_share"
        if _is_set(table, key):
            yield _Useless(key, 'with controller = "feedback-only": it has gains of its own', "remove it")
    of_sensor = [fault for fault in faults if fault.endswith(OF_SENSOR)]
    if of_sensor and not settings.displacement_sensor and "displacement_sensor" not in varied:
        why = f"without a displacement sensor: '{of_sensor[0]}' is a fault of this sensor"
        yield _Useless("disturbance", why, "remove this fault, or the key `displacement_sensor`")


def _is_set(table: Table, key: str) -> bool:
    """Return True if the file sets the key, a path such as `wire.alloy`."""
    return _value(table, key) is not None


def _value(table: Table, key: str) -> Any:
    """Return the value of a key, a path such as `wire.alloy`; None if the file does not set it."""
    first, _, rest = key.partition(".")
    inner = table.get(first)
    if not rest:
        return inner
    return _value(inner, rest) if isinstance(inner, Mapping) else None


def _table_of(key: str, axes: Sequence[Axis]) -> str:
    """Return the name of the table that sets the key: an axis or [run]."""
    for number, axis in enumerate(axes, 1):
        for path in axis.settings[0]:
            shorter, longer = sorted((key, path), key=len)
            if f"{longer}.".startswith(f"{shorter}."):
                return f"[[vary]] {number}"
    return "[run]"
