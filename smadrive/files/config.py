"""TOML files into typed values: one loader, one kind of message, for rigs, wires, profiles and simulated devices."""

from __future__ import annotations

from pathlib import Path
from types import NoneType
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from smadrive.errors import ConfigError
from smadrive.files.kinds import check_regular
from smadrive.files.number_text import shortened
from smadrive.files.spelling import nearest
from smadrive.files.toml import parse_toml

MOST_WHOLE = 1 << 63
"""TOML promises whole numbers of 64 bits, and no config needs more."""


class Section(BaseModel):
    """A table of a config file: immutable; an unknown key is an error.

    A validator is built when it is first needed: a command that reads few sections starts sooner.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _a_number_is_a_number(cls, values: Any) -> Any:
        """Pydantic would also take a text that looks like one."""
        for name, field in cls.model_fields.items() if isinstance(values, dict) else ():
            allowed = set(getattr(field.annotation, "__args__", (field.annotation,)))
            if allowed <= {int, float, NoneType} and isinstance(values.get(name), str | bool):
                raise ValueError(f"{name} = {shortened(values[name])}: put a number there, without quotes")
            if isinstance(values.get(name), int) and abs(values[name]) >= MOST_WHOLE:
                raise ValueError(f"{name} = {shortened(values[name])}: is beyond 64 bits: correct it")
        return values


ConfigT = TypeVar("ConfigT", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of the file; ConfigError when it is missing, unreadable, no regular file or no TOML."""
    check_regular(path, ConfigError)
    try:
        return parse_toml(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    except ValueError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path}: nested too deeply for a config file: remove the inner brackets") from None


def load_config(path: Path, kind: type[ConfigT]) -> ConfigT:
    """The file as a validated `kind`; ConfigError names file, key, value and cure in one line."""
    return validate(read_toml(path), kind, where=str(path))


def validate(tables: dict[str, Any], kind: type[ConfigT], where: str) -> ConfigT:
    """`tables` as a validated `kind`; ConfigError tells what is wrong in one line.

    Unknown keys are all told, and nothing else besides them: a typo explains what is missing.
    """
    try:
        return kind.model_validate(tables)
    except ValidationError as error:
        problems = [dict(problem) for problem in error.errors()]
        told = [problem for problem in problems if problem["type"] == "extra_forbidden"] or problems[:1]
        places: dict[str, list[str]] = {}
        for problem in told:
            places.setdefault(_complaint(problem, kind), []).append(_place(problem))
        complaints = "; ".join(f"{', '.join(where)}: {complaint}" for complaint, where in places.items())
        more = f" (and {len(problems) - len(told)} more)" if len(problems) > len(told) else ""
        raise ConfigError(f"{where}: {complaints}{more}") from None


def _place(problem: dict[str, Any]) -> str:
    return ".".join(str(part) for part in problem["loc"]) or "the file"


def _complaint(problem: dict[str, Any], kind: type[BaseModel]) -> str:
    if problem["type"] == "extra_forbidden":
        return "unknown key" + nearest(str(problem["loc"][-1]), _known_keys(kind, problem["loc"][:-1]))
    if problem["type"] == "missing":
        return "is missing"
    message = str(problem["msg"]).removeprefix("Value error, ")
    value = problem["input"]
    return message if isinstance(value, dict) else f"{message} (it is {shortened(value)})"


def _known_keys(kind: type[BaseModel], path: tuple[Any, ...]) -> set[str]:
    """The keys allowed at `path` below `kind`, found by walking the field annotations."""
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
