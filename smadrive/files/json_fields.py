"""Typed access to the fields of a JSON model file."""

from __future__ import annotations

import sys
from typing import Any

from smadrive.errors import ModelError
from smadrive.files.number_text import shortened

CURE = "give a model file, which `smadrive identify` or save_model writes"


class Fields:
    """A JSON object, and its place: the file and the key that contain it. Every ModelError names this place."""

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
    """Return True if a JSON value is a finite number in the range of a float. An integer in JSON may be larger."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
