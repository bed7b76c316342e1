"""Models as JSON files: schema version, kind, parameters, provenance. The only file access of the maths.

A reader never sees half a model: a file is written completely or not at all. Reading refuses whatever is not a
complete, finite, certified model, with one line that names file, key, value and cure.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from smadrive.errors import CertificateError, ModelError
from smadrive.files.atomic import replacing
from smadrive.files.kinds import MODEL, check_kind
from smadrive.files.number_text import shortened
from smadrive.hysteresis.duhem import DuhemModel
from smadrive.hysteresis.fuzzy import FuzzySets, GaussianSets, TrapezoidSets, TriangularSets
from smadrive.hysteresis.mixture import GaussianMixture
from smadrive.hysteresis.model import HysteresisModel
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem

SCHEMA_VERSION = 1
MOST_BYTES = 1 << 20
"""A model of 200 sets takes some 20,000."""

CURE = "give a model file, which `smadrive identify` or save_model writes"
_LAWS = ("a_heating", "b_heating", "a_cooling", "b_cooling")


def save_model(
    model: HysteresisModel, path: str | os.PathLike[str], *, provenance: Mapping[str, Any] | None = None
) -> None:
    """Write `model` to `path`; `provenance` is any JSON object (source file, date, fit figures).

    Raises ModelError for what has no JSON form, DataError when the file cannot be written.
    """
    text = model_text(model, provenance or {}, place=str(path))
    with replacing(Path(path)) as partial:
        partial.write_text(text, encoding="utf-8")


def load_model(path: str | os.PathLike[str], *, allow_uncertified: bool = False) -> DuhemModel | TSFuzzyDuhem:
    """Read a model. Raises ModelError for a file that is none, CertificateError for rules that are not certified."""
    return parse_model(read_model(path), place=str(path), allow_uncertified=allow_uncertified)


def read_model(path: str | os.PathLike[str]) -> str:
    """The text of a model file. Raises ModelError for what is none, or cannot be read."""
    check_kind(Path(path), MODEL)
    try:
        size = Path(path).stat().st_size
        if size > MOST_BYTES:
            raise ModelError(f"{path}: {size} bytes, at most {MOST_BYTES} are read; {CURE}")
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}; check the path") from error
    except UnicodeDecodeError as error:
        raise ModelError(f"{path}: not a JSON file but a binary one; {CURE}") from error


def model_text(model: HysteresisModel, provenance: Mapping[str, Any], *, place: str) -> str:
    """What a model file says; `place` is how errors call it. Raises ModelError for what has no JSON form."""
    document = {
        "schema": SCHEMA_VERSION,
        **_describe(model),
        "scale": model.scale,
        "offset": model.offset,
        "input_range": list(model.input_range),
        "provenance": dict(provenance),
    }
    try:
        return json.dumps(document, indent=2, allow_nan=False) + "\n"
    except (TypeError, ValueError) as error:
        raise ModelError(
            f"{place}: provenance cannot be written as JSON: {error}; use plain strings and finite numbers"
        ) from error


def parse_model(text: str, *, place: str, allow_uncertified: bool = False) -> DuhemModel | TSFuzzyDuhem:
    """The model that `model_text` wrote. Raises ModelError, CertificateError; `place` is how they call the text."""
    try:
        fields = Fields(place, json.loads(text))
    except ValueError as error:
        damage = f": {error}" if text.lstrip().startswith(("{", "[")) else ""
        raise ModelError(f"{place}: not a JSON file{damage}; {CURE}") from error
    except RecursionError:
        raise ModelError(f"{place}: nested too deeply for a model file; {CURE}") from None
    schema = fields.value("schema")
    if schema != SCHEMA_VERSION:
        raise ModelError(f"{place}: schema is {shortened(schema)}; this version reads {SCHEMA_VERSION}; identify again")
    model = _build(fields)
    certificate = model.certificate()
    if not (certificate.holds or allow_uncertified):
        raise CertificateError(
            f"{place}: not certified: {', '.join(certificate.shortcomings)}; identify it again, or pass "
            "allow_uncertified=True to simulate it only"
        )
    return model


def _describe(model: HysteresisModel) -> dict[str, Any]:
    if isinstance(model, DuhemModel):
        return {"kind": "duhem", "heating": _mixture_json(model.heating), "cooling": _mixture_json(model.cooling)}
    if isinstance(model, TSFuzzyDuhem):
        laws = (*model.heating_law, *model.cooling_law)
        return {
            "kind": "tsfuzzy",
            "sets": _sets_json(model.sets),
            **{k: v.tolist() for k, v in zip(_LAWS, laws, strict=True)},
        }
    raise ModelError(f"a {type(model).__name__} has no file format; save a DuhemModel or a TSFuzzyDuhem")


def _mixture_json(mixture: GaussianMixture) -> dict[str, Any]:
    return {"weights": list(mixture.weights), "means": list(mixture.means), "sigmas": list(mixture.sigmas)}


def _sets_json(sets: FuzzySets) -> dict[str, Any]:
    shape: dict[str, Any]
    match sets:
        case TrapezoidSets(flat=flat):
            shape = {"shape": "trapezoid", "flat": flat}
        case GaussianSets(width=width):
            shape = {"shape": "gaussian", "width": width}
        case _:
            shape = {"shape": "triangular"}
    return {**shape, "centres": list(sets.centres)}


class Fields:
    """A JSON object that knows where it stands, so that every refusal names file and key (ModelError)."""

    def __init__(self, place: str, document: Any) -> None:
        """`place` is how errors call the object."""
        if not isinstance(document, dict):
            raise ModelError(f"{place}: expected a JSON object, found {type(document).__name__}; {CURE}")
        self.place, self.document = place, document

    def value(self, key: str) -> Any:
        """Whatever stands at `key`."""
        if key not in self.document:
            raise ModelError(f"{self.place}: key '{key}' is missing; {CURE}")
        return self.document[key]

    def number(self, key: str) -> float:
        """The number at `key`."""
        value = self.value(key)
        if not _is_finite(value):
            raise ModelError(f"{self.place}: {key} = {shortened(value)} is not a number; put a finite number there")
        return float(value)

    def numbers(self, key: str) -> tuple[float, ...]:
        """The list of numbers at `key`."""
        values = self.value(key)
        if not isinstance(values, list) or not all(map(_is_finite, values)):
            raise ModelError(
                f"{self.place}: {key} = {shortened(values)} is not a list of finite numbers; put one there"
            )
        return tuple(map(float, values))

    def texts(self, key: str) -> tuple[str, ...]:
        """The list of texts at `key`."""
        values = self.value(key)
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            raise ModelError(f"{self.place}: {key} = {shortened(values)} is not a list of texts; put one there")
        return tuple(values)

    def inner(self, key: str) -> Fields:
        """The object at `key`."""
        return Fields(f"{self.place}: {key}", self.value(key))


def _is_finite(value: Any) -> bool:
    """Whether a value of JSON, whose whole numbers have no end, is a number that a float can be."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _build(fields: Fields) -> DuhemModel | TSFuzzyDuhem:
    ends = fields.numbers("input_range")
    if len(ends) != 2:
        raise ModelError(f"{fields.place}: input_range has {len(ends)} numbers; give lower and upper end")
    scale, offset, input_range = fields.number("scale"), fields.number("offset"), (ends[0], ends[1])
    kind = fields.value("kind")
    try:
        if kind == "duhem":
            return DuhemModel(
                _mixture(fields.inner("heating")), _mixture(fields.inner("cooling")), scale, offset, input_range
            )
        if kind == "tsfuzzy":
            laws = {key: fields.numbers(key) for key in _LAWS}
            sets = _sets(fields.inner("sets"))
            return TSFuzzyDuhem(sets, **laws, scale=scale, offset=offset, input_range=input_range)
    except ModelError as error:
        message = str(error)
        raise ModelError(message if message.startswith(fields.place) else f"{fields.place}: {message}") from error
    raise ModelError(f"{fields.place}: kind = {shortened(kind)} is unknown; it must be 'duhem' or 'tsfuzzy'")


def _mixture(fields: Fields) -> GaussianMixture:
    return GaussianMixture(fields.numbers("weights"), fields.numbers("means"), fields.numbers("sigmas"))


def _sets(fields: Fields) -> FuzzySets:
    shape, centres = fields.value("shape"), fields.numbers("centres")
    if shape == "triangular":
        return TriangularSets(centres)
    if shape == "trapezoid":
        return TrapezoidSets(centres, fields.number("flat"))
    if shape == "gaussian":
        return GaussianSets(centres, fields.number("width"))
    raise ModelError(
        f"{fields.place}: shape = {shortened(shape)} is unknown; it must be 'triangular', 'trapezoid' or 'gaussian'"
    )
