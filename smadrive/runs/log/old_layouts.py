"""The layouts of older logs, and the present names of their columns.

smadrive 0.1 wrote layout 1: the metadata are in `/entry/about`, the setpoints in the columns `reference_mm` and
`wanted_c`. The checksums are computed from these old names, so they are verified before the names are translated.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import h5py

from smadrive.runs.log.errors import DamageError, NewerLayoutError

LAYOUT = 2
"""The layout that this version of smadrive writes."""

ValueT = TypeVar("ValueT")

COLUMNS_OF_1 = {"reference_mm": "setpoint_mm", "wanted_c": "setpoint_c"}
"""The columns that have another name in layout 1: name in layout 1 to present name."""


def layout_of(file: h5py.File) -> int:
    """Return the number of the file's layout. A file without a number has layout 1.

    DamageError when the number is not valid, NewerLayoutError when a later version of smadrive wrote the file.
    """
    if "layout" not in file.attrs:
        return 1
    attribute = file.attrs.get_id("layout")
    if not isinstance(attribute.get_type(), h5py.h5t.TypeIntegerID) or attribute.shape != ():
        raise DamageError("the layout number is not a whole number")
    layout = int(file.attrs["layout"])
    if layout < 1:
        raise DamageError(f"the layout number is {layout}, but layouts count from 1")
    if layout > LAYOUT:
        raise NewerLayoutError(layout)
    return layout


def metadata_group(layout: int) -> str:
    """Return the name of the group in `/entry` that holds the metadata of a log of `layout`."""
    return "about" if layout == 1 else "metadata"


def translated(columns: Mapping[str, ValueT], layout: int) -> dict[str, ValueT]:
    """Return the columns of a log of `layout` under their present names."""
    names = COLUMNS_OF_1 if layout == 1 else {}
    return {names.get(name, name): values for name, values in columns.items()}
