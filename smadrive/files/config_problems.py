"""The problems of a config file in one line: key, what is wrong, value, limit and cure."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel

from smadrive.files.number_text import shortened
from smadrive.files.spelling import suggestion, suggestion_or_list

MOST_DESCRIBED = 6
"""The largest number of different problems that a line describes."""

_UNKNOWN, _MISSING, _SHORT = "extra_forbidden", "missing", "too_short"
"""pydantic's names of these types of problems."""

_ENTRY = re.compile(r"\]\] \d+$")

COPIED = "copy this part from a complete file (`smadrive list` names them)"
"""The cure for a missing key, unless the section has another cure as `source_of_keys`."""

_LIST = {"tuple_type", "list_type"}
"""pydantic's names of the problem that a value should be a list."""

_CURES = {
    "greater_than": "write a number greater than {gt:g}",
    "greater_than_equal": "write {ge:g} or more",
    "less_than": "write a number less than {lt:g}",
    "less_than_equal": "write {le:g} or less",
    "finite_number": "write a finite number",
    "int_from_float": "write a whole number",
    "literal_error": "write {expected}",
    "enum": "write {expected}",
}
"""The cure of each type of problem that pydantic finds in a single value. The names are those of pydantic."""


def config_problems(problems: list[dict[str, Any]], kind: type[BaseModel]) -> str:
    """Return one line that describes the problems that pydantic found in a section of the class `kind`.

    Unknown keys come first, then missing keys, then wrong values. A misspelled key also makes the correct key missing;
    the correct key is then not named as missing. Keys with the same problem share one message. The line has at most
    `MOST_DESCRIBED` messages; if there are more, it ends with the number of the messages that were left out.
    """
    unknown = [problem for problem in problems if problem["type"] == _UNKNOWN]
    missing = [problem for problem in problems if problem["type"] == _MISSING and not _is_misspelled(problem, unknown)]
    others = [one for one in problems if one["type"] not in {_UNKNOWN, _MISSING} and not _is_consequence(one, problems)]
    keys: dict[str, list[str]] = {}
    for problem in (*unknown, *missing, *others):
        keys.setdefault(_message(problem, kind), []).append(_key(problem))
    lines = [": ".join(filter(None, (", ".join(same), message))) for message, same in keys.items()]
    more = len(lines) - MOST_DESCRIBED
    return "; ".join(lines[:MOST_DESCRIBED]) + (f" (and {more} more)" if more > 0 else "")


def _is_misspelled(missing: dict[str, Any], unknown: Iterable[dict[str, Any]]) -> bool:
    """Return True if the spelling of an unknown key of the same table is similar to the missing key."""
    *place, key = missing["loc"]
    typed = (problem["loc"] for problem in unknown)
    return any([*table] == place and suggestion(str(name), [str(key)]) for *table, name in typed)


def _is_consequence(problem: dict[str, Any], problems: Iterable[dict[str, Any]]) -> bool:
    """Return True for a list that is too short only because pydantic does not count its wrong entries."""
    place = problem["loc"]
    inner = (one["loc"] for one in problems if len(one["loc"]) > len(place))
    return problem["type"] == _SHORT and any(loc[: len(place)] == place for loc in inner)


def _key(problem: dict[str, Any]) -> str:
    """Return the path of the key, such as `[[vary]] 1: repeats`; "" for a problem of the whole file."""
    path = ""
    for place, part in enumerate(problem["loc"], 1):
        if isinstance(part, int):
            is_table = place < len(problem["loc"]) or isinstance(problem["input"], dict)
            path = f"[[{path}]] {part + 1}" if is_table else f"{path}, entry {part + 1}"
        else:
            separator = ": " if _ENTRY.search(path) else "." if path else ""
            path = f"{path}{separator}{part}"
    return path


def _message(problem: dict[str, Any], kind: type[BaseModel]) -> str:
    if problem["type"] == _UNKNOWN:
        *path, key = problem["loc"]
        names = suggestion_or_list(str(key), _known_keys(kind, path))
        if path and key in _known_keys(kind, ()) and not _models_below(kind, key):
            return f"unknown here; {names}; or write it at the beginning of the file, before the first [section]"
        return f"unknown key; {names}"
    if problem["type"] == _MISSING:
        sources = {getattr(model, "source_of_keys", COPIED) for model in _models_at(kind, problem["loc"][:-1])}
        return f"missing; {' or '.join(sorted(sources))}"
    value = problem["input"]
    if cure := _CURES.get(problem["type"]):
        return f"{shortened(value)} is not allowed; {cure.format(**problem.get('ctx', {}))}"
    if problem["type"] in _LIST and isinstance(value, dict):
        return f"one table instead of a list of tables; write [[{_key(problem)}]] in double brackets"
    message = str(problem["msg"]).removeprefix("Value error, ")
    return message if isinstance(value, dict) else f"{message} (it is {shortened(value)})"


def _known_keys(kind: type[BaseModel], path: Iterable[Any]) -> set[str]:
    """Return the keys allowed at `path` below the section `kind`."""
    return {field.alias or name for model in _models_at(kind, path) for name, field in model.model_fields.items()}


def _models_at(kind: type[BaseModel], path: Iterable[Any]) -> list[type[BaseModel]]:
    """Return the sections possible at `path` below the section `kind`, found from the annotations of the fields."""
    models = [kind]
    for part in path:
        models = [inner for model in models for inner in _models_below(model, part)] or models
    return models


def _models_below(model: type[BaseModel], part: Any) -> list[type[BaseModel]]:
    field = model.model_fields.get(part) if isinstance(part, str) else None
    return [] if field is None else _models_in(field.annotation)


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models_in(part)]
