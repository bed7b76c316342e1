"""Models as JSON files: schema version, kind, parameters, provenance.

A file is written completely or not at all. Reading accepts only a complete file with finite numbers, and by default
only a certified model. An error names the file, the key, the value and the cure.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from smadrive.errors import CertificateError, ModelError
from smadrive.files.atomic import replacing
from smadrive.files.json_fields import CURE, Fields
from smadrive.files.kinds import MODEL, check_kind
from smadrive.files.number_text import shortened
from smadrive.files.spelling import missing_file_cure
from smadrive.hysteresis.duhem import DuhemModel
from smadrive.hysteresis.fuzzy import FuzzySets, GaussianSets, TrapezoidSets, TriangularSets
from smadrive.hysteresis.memory.model import TSFuzzyPreisach
from smadrive.hysteresis.memory.plane import PreisachPlane
from smadrive.hysteresis.mixture import GaussianMixture
from smadrive.hysteresis.model import HysteresisModel
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem

SCHEMA_VERSION = 3
"""The version that is written. Versions 1 and 2 can be read, too: 1 has no memory, 1 and 2 have no resistance."""

MOST_BYTES = 1 << 20
"""The largest model file, bytes. A model of 200 sets takes about 20,000 bytes."""

UNCERTIFIED_CURE = "identify the wire again, or pass allow_uncertified=True only to simulate the model"
IdentifiedModel = DuhemModel | TSFuzzyDuhem | TSFuzzyPreisach
"""The models that have a file format."""

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


def load_model(path: str | os.PathLike[str], *, allow_uncertified: bool = False) -> IdentifiedModel:
    """Load a model from a file.

    Raises ModelError for a malformed file. Raises CertificateError for a model whose certificate does not hold, unless
    `allow_uncertified` is True.
    """
    return parse_model(read_model(path), place=str(path), allow_uncertified=allow_uncertified)


def _check_path(path: object) -> None:
    """Raise ModelError when `path` is not of a type that names a file."""
    if not isinstance(path, str | os.PathLike):
        cure = "pass the path of a model file"
        raise ModelError("of the wrong type", where="path", value=type(path).__qualname__, cure=cure)


def read_model(path: str | os.PathLike[str]) -> str:
    """Return the text of a model file.

    Raises ModelError when the file cannot be read, is not a model file, or is larger than `MOST_BYTES`.
    """
    _check_path(path)
    check_kind(Path(path), MODEL)
    try:
        size = Path(path).stat().st_size
        if size > MOST_BYTES:
            raise ModelError("too large", where=path, value=f"{size} bytes", limit=MOST_BYTES, cure=CURE)
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise ModelError("no such file", where=path, cure=missing_file_cure(Path(path))) from error
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", where=path, cure="check the path") from error
    except UnicodeDecodeError as error:
        raise ModelError("binary, not a JSON file", where=path, cure=CURE) from error


def model_text(model: HysteresisModel, provenance: Mapping[str, Any], *, place: str) -> str:
    """Return the text of a model file with `model` and `provenance`.

    Raises ModelError for a type of model without a file format, and for values that JSON cannot hold. `place` is the
    path of the file, for the error.
    """
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


def parse_model(text: str, *, place: str, allow_uncertified: bool = False) -> IdentifiedModel:
    """Return the model that the text of a model file describes.

    `place` is the path of the file, which the errors name. Raises ModelError for a malformed text. Raises
    CertificateError for a model whose certificate does not hold, unless `allow_uncertified` is True.
    """
    try:
        fields = Fields(place, json.loads(text))
    except ValueError as error:
        damage = f": {error}" if text.lstrip().startswith(("{", "[")) else ""
        raise ModelError(f"not a JSON file{damage}", where=place, cure=CURE) from error
    except RecursionError:
        raise ModelError("nested too deeply for a model file", where=place, cure=CURE) from None
    schema = fields.value("schema")
    if schema not in range(1, SCHEMA_VERSION + 1):
        where, cure = f"{place}: schema", f"identify the wire again: this smadrive reads up to version {SCHEMA_VERSION}"
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
    if isinstance(model, TSFuzzyPreisach):
        return {**_describe(model.local), "memory": _memory_json(model)}
    if isinstance(model, TSFuzzyDuhem):
        laws = (*model.heating_law, *model.cooling_law)
        return {
            "kind": "tsfuzzy",
            "sets": _sets_json(model.sets),
            **{k: v.tolist() for k, v in zip(_LAWS, laws, strict=True)},
        }
    cure = "save a DuhemModel, a TSFuzzyDuhem or a TSFuzzyPreisach"
    raise ModelError("no file format for this type", value=type(model).__name__, cure=cure)


def _mixture_json(mixture: GaussianMixture) -> dict[str, Any]:
    return {"weights": list(mixture.weights), "means": list(mixture.means), "sigmas": list(mixture.sigmas)}


def _memory_json(model: TSFuzzyPreisach) -> dict[str, Any]:
    plane = model.plane
    return {
        "share": model.share,
        "up_thresholds": plane.up_thresholds.tolist(),
        "down_thresholds": plane.down_thresholds.tolist(),
        "mass": plane.mass.ravel().tolist(),
    }


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


def _build(fields: Fields) -> IdentifiedModel:
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
            rules = TSFuzzyDuhem(sets, **laws, scale=scale, offset=offset, input_range=input_range)
            return _with_memory(rules, fields.inner("memory")) if "memory" in fields.document else rules
    except ModelError as error:
        if not error.where.startswith(fields.place):
            error.where = f"{fields.place}: {error.where}"
        raise
    where = f"{fields.place}: kind"
    raise ModelError("unknown kind", where=where, value=shortened(kind), cure="write 'duhem' or 'tsfuzzy'")


def _with_memory(rules: TSFuzzyDuhem, fields: Fields) -> TSFuzzyPreisach:
    up, down, mass = (np.array(fields.numbers(key)) for key in ("up_thresholds", "down_thresholds", "mass"))
    shape = len(up) - 1, len(down) - 1
    if min(shape) < 1 or len(mass) != shape[0] * shape[1]:
        where = f"{fields.place}: mass"
        raise ModelError("not one number per cell", where=where, value=len(mass), limit=f"{shape[0]} × {shape[1]}")
    return TSFuzzyPreisach(rules, PreisachPlane(up, down, mass.reshape(shape)), fields.number("share"))


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
