"""Sea of a case file: one section for each kind of spectrum, told apart by `spectrum`.

A section holds what the user gave; `models.sea.sea.SeaSpectrum`, which `to_spectrum` makes, is
what everything downstream asks.  What follows from other fields (the height of a measured sea, the
period of a sea by its wind) is the default of its field, made from them: so every sea has a
`significant_height` and a `spectral_peak_period`, and what was not given is not written to a file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ..basics import GRAVITY, InputError, file_stamp, range_text
from ..casefile import DataFile, Quantity, Section, problems
from .sea import FIELDS, SHALLOWEST, SHORTEST, SeaSpectrum, takes
from .shapes import breaking_steepness, fully_arisen, gaussian_widths, jonswap_gamma
from .spreading import Spreading
from .table import SpectrumTable, row_faults

# T_p of the 1975 form over its T_S: it peaks at f T_mean = 0.54^(1/4) with T_mean = 0.9 T_S.
_PEAK_OF_SIGNIFICANT = 0.9 / math.sqrt(math.sqrt(0.54))

_LOWEST, _HIGHEST = 0.001, 30.0  # of significant heights [m]: from a ripple
_MOST_PARTS = 10

# Files written before each kind had its own fields carry these under every kind.
_IDLE = ("gamma", "order")


def _on_the_table(wind_speed: float) -> float:
    fully_arisen(wind_speed)
    return wind_speed


def _readable(file: str) -> str:
    from .records import read_seas  # here, as most cases have no file

    read_seas(file)
    return file


_Height = Annotated[
    float,
    Quantity("length", _LOWEST, _HIGHEST),
    Field(
        description="Significant wave height H_s (4 standard deviations of the surface elevation; "
        "the 1975 form takes H_mean = 0.625 H_s). May be left out where `wind_speed`, the measured "
        "spectrum or the parts have it; they are scaled to it where it is given."
    ),
]
_PeakPeriod = Annotated[
    float,
    Quantity("time", SHORTEST, 60.0),
    Field(
        description="Period of the spectrum's peak; not for `bretschneider-1975`, "
        "`pierson-moskowitz`, `measured` and `sum`."
    ),
]
_Gamma = Annotated[
    float | Literal["auto"],
    Quantity("ratio", 1.0, 7.0, word="auto"),
    Field(
        description="Peak enhancement of `jonswap` and `tma`; `auto` takes it from T_p and H_s "
        "(DNV-RP-C205). The other spectra do not use it."
    ),
]


def _kind(section: type[SeaSection]) -> str:
    return str(get_args(section.model_fields["spectrum"].annotation)[0])


class SeaTable(Section):
    """A spectrum as a table, linear between its rows."""

    omega: Annotated[
        tuple[Annotated[float, Quantity("frequency", 0.0, 60.0)], ...],
        Field(min_length=3, max_length=1000),
    ]
    """Frequencies, strictly ascending."""
    density: tuple[Annotated[float, Quantity("spectral density", 0.0, 1e6)], ...]
    """Variance density of the elevation at each frequency."""

    def _faults(self) -> list[tuple[str, str]]:
        return row_faults(np.array(self.omega), np.array(self.density))


class SeaSpreading(Section):
    """How the energy of a short-crested sea divides over headings."""

    kind: Literal["cos-2s", "cos-n"]
    """The law: cos^2s of half the angle from the mean heading, or cos^n of that angle."""
    exponent: Annotated[float, Quantity("number", 0.0, 500.0)]
    """s or n: wind seas have s of 5 to 15 or n of 2 to 6, swell s of 30 and more."""


class SeaSection(Section):
    """What the seas of every kind have in common."""

    spectrum: str
    """Shape of the wave spectrum."""
    spreading: SeaSpreading | None = None
    """Spreading of the energy over headings; without it the sea is long-crested."""
    if TYPE_CHECKING:
        # Each kind has this field behind those that it may follow from.
        significant_height: float

    alternatives = (("peak_period", "significant_period", "wind_speed"), ("table", "file"))
    forgets = False

    period_field: ClassVar[str] = ""
    """Field of the period that sets the peak, if the kind has one."""

    @model_validator(mode="before")
    @classmethod
    def _fields(cls, data: Any) -> Any:
        """Tell which fields are missing and which are another kind's, before any is read."""
        if not isinstance(data, Mapping):
            return data
        kind, own = _kind(cls), set(cls.model_fields)
        given = {name for name, value in data.items() if value is not None}
        foreign = {name for one in KINDS_OF_SEA for name in one.model_fields} - own
        if "wind_speed" in given & foreign:
            names = ", ".join(_kind(one) for one in KINDS_OF_SEA if issubclass(one, _SeaByWind))
            raise problems(("wind_speed", f"is not for the {kind} spectrum: it is for {names}"))
        wanted = "a table or a file" if kind == "measured" else takes(kind)
        found = [
            (name, f"is missing: the {kind} spectrum needs it")
            for name in cls._needs(data)
            if name not in given
        ]
        found += [
            (name, f"is not for the {kind} spectrum, which takes {wanted}")
            for name in data
            if name in given & foreign and name not in _IDLE
        ]
        if found:
            raise problems(*found)
        empty = (own | foreign) - given
        return {name: value for name, value in data.items() if name not in foreign | empty}

    @classmethod
    def _needs(cls, data: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the fields that have to be given."""
        del data
        fields = cls.model_fields.items()
        return tuple(n for n, field in fields if field.is_required() and n != "spectrum")

    @property
    def spectral_peak_period(self) -> float:
        """Period of the spectrum's peak [s], also where it is not a field."""
        return 2.0 * math.pi / self.to_spectrum().peak_frequency

    def peaking_at(self, period: float) -> dict[str, float]:
        """Return the changes of a case that put the peak of its sea at a period T_p [s].

        The height stays, also where it came from the wind.

        Raises InputError if the spectrum has no period of its own.
        """
        if not self.period_field:
            raise InputError(
                f"sea: the {self.spectrum} spectrum has no peak_period to vary; use jonswap, or "
                "leave the periods out"
            )
        ratio: float = getattr(self, self.period_field) / self.spectral_peak_period
        return {
            "sea.significant_height": self.significant_height,
            f"sea.{self.period_field}": ratio * period,
        }

    @property
    def steepness(self) -> float:
        """Significant steepness, H_s over the deep-water length of the peak's wave [-]."""
        length: float = GRAVITY * self.spectral_peak_period**2 / (2.0 * math.pi)
        return self.significant_height / length

    @property
    def breaking_steepness(self) -> float:
        """Significant steepness above which seas are not observed [-]."""
        return float(breaking_steepness(self.spectral_peak_period))

    def to_spectrum(self) -> SeaSpectrum:
        """Return the spectrum.

        Raises InputError if the form is not defined for these values, or a file of spectra cannot
        be read.
        """
        return _spectrum(self, tuple(file_stamp(file) for file in self._files()))

    def _form(self) -> dict[str, Any]:
        """Return what the kind hands to :class:`SeaSpectrum`, besides height and spreading."""
        return {name: getattr(self, name) for name in FIELDS[self.spectrum]}

    def _files(self) -> tuple[str, ...]:
        return ()


class _SeaByPeak(SeaSection):
    """A sea of given height and peak period."""

    significant_height: _Height
    peak_period: _PeakPeriod

    period_field = "peak_period"

    @property
    def spectral_peak_period(self) -> float:
        """Period of the spectrum's peak [s]."""
        return self.peak_period


class _SeaOfLimitedFetch(_SeaByPeak):
    """A growing sea, whose peak is enhanced."""

    gamma: _Gamma = 3.3

    def _form(self) -> dict[str, Any]:
        gamma = self.gamma
        if gamma == "auto":
            gamma = jonswap_gamma(self.peak_period, self.significant_height)
        return {**super()._form(), "gamma": gamma}


class JonswapSea(_SeaOfLimitedFetch):
    """A sea of limited fetch in deep water."""

    spectrum: Literal["jonswap"]
    """`jonswap`: a growing sea of limited fetch."""


class TmaSea(_SeaOfLimitedFetch):
    """A sea of limited fetch in shallow water."""

    spectrum: Literal["tma"]
    """`tma`: the JONSWAP sea in shallow water."""
    depth: Annotated[float, Quantity("length", SHALLOWEST, 12e3)]
    """Water depth, for `tma` only."""


class TorsethaugenSea(_SeaByPeak):
    """A wind sea and a swell together."""

    spectrum: Literal["torsethaugen"]
    """`torsethaugen`: a wind sea and a swell, as in the northern North Sea."""


class OchiHubbleSea(_SeaByPeak):
    """A sea of one Ochi-Hubble hump."""

    spectrum: Literal["ochi-hubble"]
    """`ochi-hubble`: one hump of adjustable width."""
    order: Annotated[float, Quantity("ratio", 0.5, 20.0)] = 2.0
    """Shape parameter of `ochi-hubble`; 1 gives `bretschneider`. The other spectra do not use
    it."""

    def _form(self) -> dict[str, Any]:
        return {**super()._form(), "order": self.order}


class GaussianSwell(_SeaByPeak):
    """A swell whose energy is normally distributed over frequency."""

    spectrum: Literal["gaussian-swell"]
    """`gaussian-swell`: a swell from far away."""
    width: Annotated[float, Quantity("frequency", 0.0, 10.0, open_low=True)]
    """Standard deviation of the frequency of `gaussian-swell`, 1/200 to 1/6 of the peak's."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        low, high = gaussian_widths(2.0 * math.pi / self.peak_period)
        if not low <= self.width <= high:
            yield ("width", f"must be {range_text(low, high, 'rad/s')}, got {self.width!r}")


class _SeaByWind(SeaSection):
    """A sea of given height and period, or fully arisen in a given wind."""

    wind_speed: (
        Annotated[
            float, Quantity("speed", 0.0, 100.0, open_low=True), AfterValidator(_on_the_table)
        ]
        | None
    ) = None
    """Wind of a fully arisen sea, 18 to 24.5 knots (1975 thesis, Table 3), instead of a height
    and a period, for `bretschneider-1975`, `bretschneider` and `pierson-moskowitz`."""
    significant_height: _Height = Field(
        default_factory=lambda data: fully_arisen(data["wind_speed"])[0]
    )

    @classmethod
    def _needs(cls, data: Mapping[str, Any]) -> tuple[str, ...]:
        if data.get("wind_speed") is not None:
            return ()
        return (
            (cls.period_field, "significant_height")
            if cls.period_field
            else ("significant_height",)
        )

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.wind_speed is not None and self.period_field in self.model_fields_set:
            yield (self.period_field, "is not for a sea by its wind_speed, which gives the period")


class Bretschneider1975Sea(_SeaByWind):
    """A sea in the variables of the 1975 thesis."""

    spectrum: Literal["bretschneider-1975"]
    """`bretschneider-1975`: Bretschneider's in the variables of the 1975 thesis."""
    significant_period: Annotated[float, Quantity("time", SHORTEST, 60.0)] = Field(
        default_factory=lambda data: fully_arisen(data["wind_speed"])[1]
    )
    """Significant period T_S, for `bretschneider-1975` only (T_mean = 0.9 T_S)."""

    period_field = "significant_period"


class BretschneiderSea(_SeaByWind):
    """A sea of two parameters."""

    spectrum: Literal["bretschneider"]
    """`bretschneider`: two parameters, for seas of unknown history."""
    peak_period: _PeakPeriod = Field(
        default_factory=lambda data: _PEAK_OF_SIGNIFICANT * fully_arisen(data["wind_speed"])[1]
    )

    period_field = "peak_period"


class PiersonMoskowitzSea(_SeaByWind):
    """A fully developed sea, whose period follows from its height."""

    spectrum: Literal["pierson-moskowitz"]
    """`pierson-moskowitz`: fully developed."""

    def _form(self) -> dict[str, Any]:
        # Another height than the wind's scales the sea of that wind.
        return {"shape_height": self.wind_speed and fully_arisen(self.wind_speed)[0]}


class _SeaOfData(SeaSection):
    """A sea whose height and peak follow from what it is made of."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.significant_height > _HIGHEST:
            text = f"must be in (0, 30] m, got {self.significant_height:.4g} from the data"
            yield ("significant_height", text)


def _height_of_rows(data: dict[str, Any]) -> float:
    if (data["table"] is None) == (data["file"] is None):
        return math.nan  # the section's own check tells
    return 4.0 * math.sqrt(_rows(**{name: data[name] for name in _ROWS}).variance)


class MeasuredSea(_SeaOfData):
    """A measured spectrum: a table, or a record of a file."""

    spectrum: Literal["measured"]
    """`measured`: a table or a record of a file."""
    table: SeaTable | None = None
    """Table of a `measured` spectrum, or give `file`."""
    file: (
        Annotated[str, DataFile(what="a file of wave spectra"), AfterValidator(_readable)] | None
    ) = None
    """File of a `measured` spectrum (NDBC, Spotter, SWAN, WAVEWATCH III, ERA5 and more),
    relative to the case file; `stillhook sea FILE` shows its records."""
    record: Annotated[int, Quantity("count", 0, 10_000_000)] | None = None
    """Which record of `file`, counted from 0 in order of time; by default 0."""
    beyond: Literal["decay", "zero"] | None = None
    """What a `measured` spectrum is above its last row: `decay` falls as 1/omega^5, `zero` is 0.
    Default decay."""
    significant_height: _Height = Field(default_factory=_height_of_rows)

    @field_validator("record")
    @classmethod
    def _in_the_file(cls, record: int, info: ValidationInfo) -> int:
        from .records import read_seas

        file = info.data.get("file", "")
        if file is None:
            raise InputError("is for a file of spectra, and none is given")
        if file:
            read_seas(file).sea(record)
        return record

    def _faults(self) -> Iterator[tuple[str, str]]:
        if (self.table is None) == (self.file is None):
            text = "is missing: the measured spectrum needs a table or a file"
            yield ("table", text if self.table is None else "must be left out, or file")
        yield from super()._faults()

    def _form(self) -> dict[str, Any]:
        return {"table": _rows(**{name: getattr(self, name) for name in _ROWS})}

    def _files(self) -> tuple[str, ...]:
        return () if self.file is None else (self.file,)


def _no_sum(part: Any) -> Any:
    if isinstance(part, Mapping):
        if part.get("spectrum") == "sum":
            raise problems(("spectrum", "must not be a sum itself"))
        if part.get("spreading") is not None:
            raise problems(("spreading", "is for the sea as a whole, not for one of its parts"))
    return part


_SeaOfOneKind = (
    Bretschneider1975Sea
    | BretschneiderSea
    | JonswapSea
    | TorsethaugenSea
    | OchiHubbleSea
    | PiersonMoskowitzSea
    | TmaSea
    | GaussianSwell
    | MeasuredSea
)

SeaPart = Annotated[_SeaOfOneKind, Field(discriminator="spectrum"), BeforeValidator(_no_sum)]
"""A sea that is no sum: what stands under `parts`."""


class SumSea(_SeaOfData):
    """Several seas that run at the same time: their variances add up."""

    spectrum: Literal["sum"]
    """`sum`: the sum of `parts`."""
    parts: tuple[SeaPart, ...]
    """The seas of `sum`, such as a wind sea and a swell: each with a `spectrum` and its fields."""
    significant_height: _Height = Field(
        default_factory=lambda data: math.hypot(*(p.significant_height for p in data["parts"]))
    )

    def _faults(self) -> Iterator[tuple[str, str]]:
        yield from super()._faults()
        if not 1 <= len(self.parts) <= _MOST_PARTS:
            yield ("parts", f"must have 1 to {_MOST_PARTS} seas, got {len(self.parts)}")
        for index, part in enumerate(self.parts):
            try:
                part.to_spectrum()
            except InputError as error:  # a form that is not defined for its values
                yield (f"parts.{index}", str(error))

    def _form(self) -> dict[str, Any]:
        return {"parts": tuple(part.to_spectrum() for part in self.parts)}

    def _files(self) -> tuple[str, ...]:
        return tuple(file for part in self.parts for file in part._files())


Sea = Annotated[_SeaOfOneKind | SumSea, Field(discriminator="spectrum")]
"""The sea state: a section of the kind that its `spectrum` names."""

KINDS_OF_SEA: tuple[type[SeaSection], ...] = get_args(get_args(Sea)[0])

_ROWS = ("table", "file", "record", "beyond")


def _rows(
    table: SeaTable | None, file: str | None, record: int | None, beyond: str | None
) -> SpectrumTable:
    """Return the table of a measured sea."""
    if table is not None:
        return SpectrumTable(omega=table.omega, density=table.density, beyond=beyond or "decay")
    from .records import read_seas

    found = read_seas(file or "").sea(record or 0, beyond=beyond or "decay").table
    assert found is not None
    return found


@lru_cache(maxsize=64)
def _spectrum(section: SeaSection, stamps: tuple[tuple[int, int], ...]) -> SeaSpectrum:
    del stamps  # a part of the cache's key only
    law = section.spreading
    return SeaSpectrum(
        kind=section.spectrum,
        significant_height=section.significant_height,
        spreading=None if law is None else Spreading(kind=law.kind, exponent=law.exponent),
        **section._form(),
    )
