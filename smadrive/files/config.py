"""Loading of TOML files as typed sections: rigs, wires, profiles, simulated devices, fault scripts and campaigns."""

from __future__ import annotations

from pathlib import Path
from types import NoneType
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from smadrive.errors import ConfigError
from smadrive.files.config_problems import COPIED, config_problems
from smadrive.files.kinds import check_regular
from smadrive.files.number_text import shortened
from smadrive.files.spelling import NO_TEXT, NO_TEXT_CURE, missing_file_cure
from smadrive.files.toml.mistakes import TomlMistakeError
from smadrive.files.toml.parsing import parse_toml

MOST_WHOLE = 1 << 63
"""Whole numbers of a config file are smaller than this in absolute value: TOML guarantees 64 bits."""


class Section(BaseModel):
    """A table of a config file. A Section object is immutable, and an unknown key is an error.

    pydantic builds the validator of a section at its first use, so a command that reads few sections starts sooner.
    """

    source_of_keys: ClassVar[str] = COPIED
    """The cure for a missing key of this table."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _a_number_is_a_number(cls, values: Any) -> Any:
        """Raise ValueError for a text or a boolean in place of a number, and for a whole number of more than 64 bits.

        pydantic would convert the text or the boolean to a number.
        """
        for name, field in cls.model_fields.items() if isinstance(values, dict) else ():
            allowed = set(getattr(field.annotation, "__args__", (field.annotation,)))
            if allowed <= {int, float, NoneType} and isinstance(values.get(name), str | bool):
                given = values[name]
                text = str(given).lower() if isinstance(given, bool) else shortened(given)
                raise ValueError(f"{name} = {text}: put a number there, without quotes")
            if isinstance(values.get(name), int) and abs(values[name]) >= MOST_WHOLE:
                raise ValueError(f"{name} = {shortened(values[name])}: the number needs more than 64 bits")
        return values


ConfigT = TypeVar("ConfigT", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file.

    ConfigError when the file is missing, unreadable, not a regular file or not valid TOML.
    """
    return _tables(read_config_text(path), path)


def _tables(text: str, path: Path) -> dict[str, Any]:
    try:
        return parse_toml(text)
    except (ValueError, RecursionError) as error:
        raise invalid_toml(error, path) from None


def read_config_text(path: Path) -> str:
    """Return the text of a config file.

    ConfigError when the file is missing, unreadable, not a regular file or not text in UTF-8.
    """
    check_regular(path, ConfigError)
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ConfigError("no such file", where=path, cure=missing_file_cure(path)) from None
    except UnicodeDecodeError:
        raise ConfigError(NO_TEXT, where=path, cure=NO_TEXT_CURE) from None
    except OSError as error:
        raise ConfigError(f"cannot be read: {error}", where=path) from None


def invalid_toml(error: ValueError | RecursionError, path: Path) -> ConfigError:
    """Return the ConfigError for the error that `parse_toml` raised for the text of the file `path`."""
    if isinstance(error, TomlMistakeError):
        mistake = error.mistake
        where = f"{path}, line {mistake.line}"
        return ConfigError(mistake.what, where=where, value=mistake.value, cure=mistake.cure)
    if isinstance(error, RecursionError):
        return ConfigError("nested too deeply for a config file", where=path, cure="remove the inner brackets")
    return ConfigError(f"not valid TOML: {error}", where=path)


def load_config(path: Path, kind: type[ConfigT]) -> ConfigT:
    """Return the content of the file as an object of `kind`, a subclass of Section.

    ConfigError when the file is missing or wrong; the error names file, key, value and cure in one line.
    """
    return parse_config(read_config_text(path), path, kind)


def parse_config(text: str, path: Path, kind: type[ConfigT]) -> ConfigT:
    """Return the content of `text`, which is that of the file `path`, as an object of `kind`, a subclass of Section.

    ConfigError when the text is wrong; the error names file, key, value and cure in one line.
    """
    return validate(_tables(text, path), kind, where=str(path))


def validate(tables: dict[str, Any], kind: type[ConfigT], where: str) -> ConfigT:
    """Return `tables` as an object of `kind`, a subclass of Section.

    ConfigError for wrong tables. The error begins with `where`; `config_problems` describes all problems in one line.
    """
    try:
        return kind.model_validate(tables)
    except ConfigError as error:  # of a check that is also used without a file
        error.where = where
        raise
    except ValidationError as error:
        raise ConfigError(config_problems([dict(problem) for problem in error.errors()], kind), where=where) from None
