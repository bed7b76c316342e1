"""The types of the parameters of faults. They also define which values a fault script may contain."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

Seconds = Annotated[float, Field(gt=0)]
Delay = Annotated[float, Field(ge=0)]
Replies = Annotated[int, Field(ge=1)]
Pieces = Annotated[int, Field(ge=2)]
ExceptionCode = Annotated[int, Field(ge=1, le=0xFF)]
Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(gt=0, le=1)]
Fraction = Annotated[float, Field(ge=0, lt=1)]
