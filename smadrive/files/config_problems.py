"""The problems of a config file in one line: key, what is wrong, value, limit and cure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel

from smadrive.files.number_text import shortened
from smadrive.files.spelling import suggestion_or_list

_CURES = {
    "greater_than": "write a number greater than {gt:g}",
    "greater_than_equal": "write {ge:g} or more",
    "less_than": "write a number less than {lt:g}",
    "less_than_equal": "write {le:g} or less",
    "finite_number": "write a finite number",
    "int_from_float": "write a whole number",
    "literal_error": "write {expected}",
}
"""The cure of each type of problem that pydantic finds in a single value. The names are those of pydantic."""


def config_problems(problems: list[dict[str, Any]], kind: type[BaseModel]) -> str:
    """Return one line that describes the problems that pydantic found in a section of the class `kind`.

    A misspelled key also makes the correct key missing, so unknown keys come first, then missing keys. All keys with
    this kind of problem are named; of other problems only the first. The line ends with the number of the others.
    """
    named = _of_type("extra_forbidden", problems) or _of_type("missing", problems) or problems[:1]
    keys: dict[str, list[str]] = {}
    for problem in named:
        keys.setdefault(_message(problem, kind), []).append(_key(problem))
    line = "; ".join(f"{', '.join(same)}: {message}" for message, same in keys.items())
    return line + (f" (and {len(problems) - len(named)} more)" if len(problems) > len(named) else "")


def _of_type(name: str, problems: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [problem for problem in problems if problem["type"] == name]


def _key(problem: dict[str, Any]) -> str:
    return ".".join(str(part) for part in problem["loc"]) or "the file"


def _message(problem: dict[str, Any], kind: type[BaseModel]) -> str:
    if problem["type"] == "extra_forbidden":
        *path, key = problem["loc"]
        return f"unknown key; {suggestion_or_list(str(key), _known_keys(kind, path))}"
    if problem["type"] == "missing":
        return "missing; copy this part from a complete file (`smadrive list` names them)"
    value = problem["input"]
    if cure := _CURES.get(problem["type"]):
        return f"{shortened(value)} is not allowed; {cure.format(**problem.get('ctx', {}))}"
    message = str(problem["msg"]).removeprefix("Value error, ")
    return message if isinstance(value, dict) else f"{message} (it is {shortened(value)})"


def _known_keys(kind: type[BaseModel], path: Iterable[Any]) -> set[str]:
    """Return the keys allowed at `path` below the section `kind`, found from the annotations of the fields."""
    models = [kind]
    for part in path:
        models = [inner for model in models for inner in _models_below(model, part)] or models
    return {field.alias or name for model in models for name, field in model.model_fields.items()}


def _models_below(model: type[BaseModel], part: Any) -> list[type[BaseModel]]:
    field = model.model_fields.get(part) if isinstance(part, str) else None
    return [] if field is None else _models_in(field.annotation)


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models_in(part)]
