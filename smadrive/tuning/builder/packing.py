"""Build requests and results as bytes. The loop and the builder unpickle only bytes from each other.

A pickle leaves out what the receiver already has:

    request    holds a model as the text of its model file, because the tables of a model are long. The builder keeps
               the last models, and finds them again by their texts
    result     holds a new model as a whole. An object that is unchanged since the request is replaced by its index in
               `_shared`, so that the loop gets its own object back
"""

from __future__ import annotations

import io
import pickle
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any

from smadrive.hysteresis import IdentifiedModel
from smadrive.hysteresis.model_file import model_text, parse_model
from smadrive.tuning.builder.build import BuildRequest, BuildResult, Built

KEPT_MODELS = 16
"""Largest number of models that the builder keeps."""


class ModelCache:
    """The latest `KEPT_MODELS` models, each under the text of its model file.

    Parsing a text is slow, because the tables of the model are computed.
    """

    def __init__(self) -> None:
        self._models: OrderedDict[str, IdentifiedModel] = OrderedDict()

    def keep(self, model: IdentifiedModel) -> None:
        """Keep a model. If there are too many, the model that was used longest ago is dropped."""
        self._models[_text(model)] = model
        self._models.move_to_end(_text(model))
        while len(self._models) > KEPT_MODELS:
            self._models.popitem(last=False)

    def model(self, text: str) -> IdentifiedModel:
        """Return the model that `text` describes. The text is parsed only if its model is not kept."""
        if text not in self._models:
            self.keep(parse_model(text, place="the tuning in force", allow_uncertified=True))
        self._models.move_to_end(text)
        return self._models[text]


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, name: Callable[[object], Any]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._name = name

    def persistent_id(self, thing: object) -> Any:
        """Return the name of `thing` if the receiver can restore it from a name. Return None to send `thing` whole."""
        return self._name(thing)


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, find: Callable[[Any], object]) -> None:
        super().__init__(file)
        self._find = find

    def persistent_load(self, name: Any) -> object:
        """Return the object that `name` stands for, as the receiver has it."""
        return self._find(name)


def pack_request(request: BuildRequest) -> bytes:
    """Return a request as bytes. Models in it become the texts of their model files."""
    return _pickled(request, lambda thing: _text(thing) if isinstance(thing, IdentifiedModel) else None)


def unpack_request(content: bytes, cache: ModelCache) -> BuildRequest:
    """Return the request that `pack_request` packed. Models are taken from `cache`."""
    request: BuildRequest = _Unpickler(io.BytesIO(content), cache.model).load()
    return request


def pack_result(result: BuildResult, request: BuildRequest) -> bytes:
    """Return the result of `request` as bytes.

    A new model is pickled separately and first. In the pickle of the result, each object is looked up in the request.
    This would take long for all the objects of a new model.
    """
    shared = _shared(request)
    models = [result.tuning.model] if isinstance(result, Built) else []
    new = [model for model in models if not any(model is thing for thing in shared)]
    return pickle.dumps(new, pickle.HIGHEST_PROTOCOL) + _pickled(result, _places([*shared, *new]))


def unpack_result(content: bytes, request: BuildRequest) -> BuildResult:
    """Return the result that `pack_result` packed. `request` is the request that the loop has sent."""
    file, shared = io.BytesIO(content), _shared(request)
    new: list[object] = _Unpickler(file, shared.__getitem__).load()
    result: BuildResult = _Unpickler(file, [*shared, *new].__getitem__).load()
    return result


def _pickled(thing: object, name: Callable[[object], Any]) -> bytes:
    file = io.BytesIO()
    _Pickler(file, name).dump(thing)
    return file.getvalue()


def _shared(request: BuildRequest) -> list[object]:
    """Return the objects of a request that the builder does not change. A result refers to them by their indices."""
    tuning, wire = request.tuning, request.wire
    return [tuning, tuning.model, tuning.unmoved, request.reference, wire.balance, wire.resistance]


def _places(things: Sequence[object]) -> Callable[[object], int | None]:
    places = {id(thing): place for place, thing in enumerate(things)}
    return lambda thing: places.get(id(thing))


def _text(model: IdentifiedModel) -> str:
    return model_text(model, {}, place="model")
