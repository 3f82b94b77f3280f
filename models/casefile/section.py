"""What every section of the case file has in common.

A section is a frozen pydantic model that refuses unknown keys.  Its fields carry their own
ranges (`models.casefile.quantity`); checks between fields raise `problems`, each with the path of
the field it is about, so that the message can name the line.
"""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, PrivateAttr, ValidationError
from pydantic_core import PydanticCustomError

from ..basics import InputError
from .quantity import custom_error


class Section(BaseModel):
    """A frozen part of a case; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Groups of fields of which one is given: replacing one drops the others of its group."""

    _derived: frozenset[str] = PrivateAttr(default=frozenset())
    """Fields that were not given but follow from the others; they are not written to a file."""

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            from .messages import describe  # messages knows the sections, not the reverse

            raise InputError(describe(error, type(self), source=type(self).__name__)) from error

    # Without this mark pydantic would call __init__ for nested sections too, and the error of
    # a nested section would arrive as one text without its paths.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]


def problems(*found: tuple[str, str]) -> PydanticCustomError:
    """Return the error that a section's own check raises.

    Parameters
    ----------
    *found
        Pairs of a field's name in the section (dotted for deeper ones, empty for the section
        itself) and the sentence about it.
    """
    return custom_error("; ".join(text for _, text in found), problems=tuple(found))
