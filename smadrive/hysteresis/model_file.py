"""Models as JSON files: schema version, kind, parameters, provenance.

A file is written completely or not at all. Reading accepts only a complete, finite, certified model; an error names
file, key, value and cure.
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
from smadrive.files.spelling import missing_file_cure
from smadrive.hysteresis.duhem import DuhemModel
from smadrive.hysteresis.fuzzy import FuzzySets, GaussianSets, TrapezoidSets, TriangularSets
from smadrive.hysteresis.mixture import GaussianMixture
from smadrive.hysteresis.model import HysteresisModel
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem

SCHEMA_VERSION = 1
MOST_BYTES = 1 << 20
"""The largest model file, bytes. A model of 200 sets takes about 20,000 bytes."""

CURE = "give a model file, which `smadrive identify` or save_model writes"
UNCERTIFIED_CURE = "identify the wire again, or pass allow_uncertified=True only to simulate the model"
_LAWS = ("a_heating", "b_heating", "a_cooling", "b_cooling")


def save_model(
    model: HysteresisModel, path: str | os.PathLike[str], *, provenance: Mapping[str, Any] | None = None
) -> None:
    """Write `model` to `path`. `provenance` is any JSON object, such as source file, date and metrics of the fit.

    ModelError for a type of model without a file format and for values that JSON cannot hold; DataError when the file
    cannot be written.
    """
    _check_path(path)
    text = model_text(model, provenance or {}, place=str(path))
    with replacing(Path(path)) as partial:
        partial.write_text(text, encoding="utf-8")


def load_model(path: str | os.PathLike[str], *, allow_uncertified: bool = False) -> DuhemModel | TSFuzzyDuhem:
    """Load a model from a file.

    Raises ModelError for a malformed file, and CertificateError for an uncertified model unless `allow_uncertified`.
    """
    return parse_model(read_model(path), place=str(path), allow_uncertified=allow_uncertified)


def _check_path(path: object) -> None:
    """Raise ModelError when `path` is not of a type that names a file."""
    if not isinstance(path, str | os.PathLike):
        cure = "pass the path of a model file"
        raise ModelError("of the wrong type", where="path", value=type(path).__qualname__, cure=cure)


def read_model(path: str | os.PathLike[str]) -> str:
    """Return the text of a model file.

    ModelError when the file cannot be read, is of another kind, or is larger than `MOST_BYTES`.
    """
    _check_path(path)
    check_kind(Path(path), MODEL)
    try:
        size = Path(path).stat().st_size
        if size > MOST_BYTES:
            raise ModelError("too large", where=path, value=f"{size} bytes", limit=MOST_BYTES, cure=CURE)
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        cure = missing_file_cure(Path(path))
        raise ModelError(f"cannot be read: {error.strerror}", where=path, cure=cure) from error
    except UnicodeDecodeError as error:
        raise ModelError("binary, not a JSON file", where=path, cure=CURE) from error


def model_text(model: HysteresisModel, provenance: Mapping[str, Any], *, place: str) -> str:
    """Return the text of a model file. Raises the ModelErrors of `save_model`, which name `place`."""
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
        what, cure = f"cannot be written as JSON: {error}", "use plain strings and finite numbers"
        raise ModelError(what, where=f"{place}: provenance", cure=cure) from error


def parse_model(text: str, *, place: str, allow_uncertified: bool = False) -> DuhemModel | TSFuzzyDuhem:
    """Return the model in the text of a file; errors name `place`. Raises the errors of `load_model`."""
    try:
        fields = Fields(place, json.loads(text))
    except ValueError as error:
        damage = f": {error}" if text.lstrip().startswith(("{", "[")) else ""
        raise ModelError(f"not a JSON file{damage}", where=place, cure=CURE) from error
    except RecursionError:
        raise ModelError("nested too deeply for a model file", where=place, cure=CURE) from None
    schema = fields.value("schema")
    if schema != SCHEMA_VERSION:
        where, cure = f"{place}: schema", f"identify the wire again: this smadrive reads version {SCHEMA_VERSION}"
        raise ModelError("unknown version", where=where, value=shortened(schema), cure=cure)
    model = _build(fields)
    certificate = model.certificate()
    if not (certificate.holds or allow_uncertified):
        what = f"not certified: {', '.join(certificate.shortcomings)}"
        raise CertificateError(what, where=place, cure=UNCERTIFIED_CURE)
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
    cure = "save a DuhemModel or a TSFuzzyDuhem"
    raise ModelError("no file format for this type", value=type(model).__name__, cure=cure)


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
    """A JSON object and its place in the file. Every ModelError of this class names file and key."""

    def __init__(self, place: str, document: Any) -> None:
        """Take a JSON object; errors name `place`. ModelError when `document` is not an object."""
        if not isinstance(document, dict):
            raise ModelError("not a JSON object", where=place, value=type(document).__name__, cure=CURE)
        self.place, self.document = place, document

    def value(self, key: str) -> Any:
        """Return the value at `key`, of any type. ModelError when the key is missing."""
        if key not in self.document:
            raise ModelError("missing", where=f"{self.place}: {key}", cure=CURE)
        return self.document[key]

    def number(self, key: str) -> float:
        """Return the number at `key`. ModelError for any other value."""
        value = self.value(key)
        if not _is_finite(value):
            raise self._wrong(key, "not a finite number")
        return float(value)

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return the list of numbers at `key`. ModelError for any other value."""
        values = self.value(key)
        if not isinstance(values, list) or not all(map(_is_finite, values)):
            raise self._wrong(key, "not a list of finite numbers")
        return tuple(map(float, values))

    def texts(self, key: str) -> tuple[str, ...]:
        """Return the list of texts at `key`. ModelError for any other value."""
        values = self.value(key)
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            raise self._wrong(key, "not a list of texts")
        return tuple(values)

    def _wrong(self, key: str, what: str) -> ModelError:
        return ModelError(what, where=f"{self.place}: {key}", value=shortened(self.document[key]))

    def inner(self, key: str) -> Fields:
        """Return the object at `key`. ModelError for any other value."""
        return Fields(f"{self.place}: {key}", self.value(key))


def _is_finite(value: Any) -> bool:
    """Return True if a JSON value is a number within the range of a float. JSON integers may be larger."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _build(fields: Fields) -> DuhemModel | TSFuzzyDuhem:
    ends = fields.numbers("input_range")
    if len(ends) != 2:
        where, cure = f"{fields.place}: input_range", "give the lower and the upper end"
        raise ModelError("not two numbers", where=where, value=f"{len(ends)} numbers", cure=cure)
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
        if not error.where.startswith(fields.place):
            error.where = f"{fields.place}: {error.where}"
        raise
    where = f"{fields.place}: kind"
    raise ModelError("unknown kind", where=where, value=shortened(kind), cure="write 'duhem' or 'tsfuzzy'")


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
    where, cure = f"{fields.place}: shape", "write 'triangular', 'trapezoid' or 'gaussian'"
    raise ModelError("unknown shape", where=where, value=shortened(shape), cure=cure)
