"""Field types of a case file: quantities with their ranges, and texts, as pydantic annotations.

`Annotated[float, Quantity("length", 0.005, 0.3)]` is a field that takes a number in metres or a
text such as `44 mm`, holds a float in SI, refuses what lies outside the range, and knows how to
describe itself in an error message, in the JSON Schema and in the documentation.
"""

import math
import re
import unicodedata
from dataclasses import KW_ONLY, dataclass
from typing import Any

from pydantic import AfterValidator, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from ..basics import KINDS, InputError, range_text, read_quantity, units_of


@dataclass(frozen=True)
class Quantity:
    """A quantity of one kind within a range, as metadata of an annotated field."""

    kind: str  #: A key of `models.basics.units.KINDS`.
    low: float = -math.inf  #: Smallest value allowed [SI].
    high: float = math.inf  #: Largest value allowed [SI].
    _: KW_ONLY
    open_low: bool = False  #: Whether `low` itself is refused.
    open_high: bool = False  #: Whether `high` itself is refused.
    word: str = ""  #: A word that is accepted instead of a quantity, such as `auto`.
    unit: str = ""  #: The unit to show for a pure number, such as `m/m`.

    @property
    def wanted(self) -> str:
        """What the field wants, as in `a length in [0.005, 0.3] m`."""
        kind = KINDS[self.kind]
        word = f"{self.word!r} or " if self.word else ""
        if math.isinf(self.low) and math.isinf(self.high):
            return f"{word}{kind.label}{f' [{self.shown_unit}]' if self.shown_unit else ''}"
        of = "of " if self.range.startswith("at ") else ""
        return f"{word}{kind.label} {of}{self.range}"

    @property
    def range(self) -> str:
        """The range in words, with its unit."""
        return range_text(self.low, self.high, self.shown_unit, self.open_low, self.open_high)

    @property
    def shown_unit(self) -> str:
        """The SI unit, or what stands for it in a pure number."""
        return KINDS[self.kind].unit or self.unit

    def read(self, value: object) -> float | int | str:
        """Return the value in SI, or the word.

        Raises InputError if it is of another kind, or out of range.
        """
        if self.word and value == self.word:
            return self.word
        try:
            number = read_quantity(value, self.kind)
        except InputError as error:
            raise InputError(f"must be {self.wanted}, got {error}") from None
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        whole = self.kind != "count" or number == math.floor(number)
        if not (above and below and whole):
            si = f" ({f'{number:g} {self.shown_unit}'.rstrip()})" if isinstance(value, str) else ""
            raise InputError(f"must be {self.wanted}, got {value!r}{si}")
        return int(number) if self.kind == "count" else number

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Tell pydantic to validate with `read` alone."""
        del source, handler
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the field to editors: a number in range, or a text with a unit."""
        del schema, handler
        number: dict[str, Any] = {"type": "integer" if self.kind == "count" else "number"}
        if math.isfinite(self.low):
            number["exclusiveMinimum" if self.open_low else "minimum"] = self.low
        if math.isfinite(self.high):
            number["exclusiveMaximum" if self.open_high else "maximum"] = self.high
        choices = [number]
        if units_of(self.kind):
            choices.append({"type": "string", "pattern": _pattern(self.kind)})
        if self.word:
            choices.append({"const": self.word})
        return {"anyOf": choices, "x-range": self.range, "x-unit": self.shown_unit}


def _line(text: str) -> str:
    return _checked(text, "", "a line of text")


def _lines(text: str) -> str:
    return _checked(text, "\n\t", "text")


def _checked(text: str, but: str, wanted: str) -> str:
    """Return a text; what steers a terminal, or is half a character, is refused."""
    for character in text:
        if unicodedata.category(character) in ("Cc", "Cs") and character not in but:
            raise InputError(
                f"must be {wanted} without control characters, got U+{ord(character):04X}"
            )
    return text


LINE = AfterValidator(_line)  #: Of a field that is a line of text, without control characters.
LINES = AfterValidator(_lines)  #: The same, but for line ends and tabs.


def _pattern(kind: str) -> str:
    """Return a regular expression for the texts that a kind accepts."""
    units = []
    for name in units_of(kind):
        escaped = name.replace("(", r"\(").replace(")", r"\)")
        unit = re.sub(r"(?<=[A-Za-z])([23])", r"(?:\\^|\\*\\*)?\1", escaped)
        units.append(unit.replace(" ", "[ .*]"))
    optional = "?" if not KINDS[kind].unit else ""
    number = r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?"
    return rf"^\s*{number}\s*({'|'.join(units)}){optional}\s*$"
