"""What goes into a report: the title block, and the design with the studies of it.

design [, comparison, operability, sweep, ...] --> Findings --> stillhook.report.write_report
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Any

from models.basics import InputError
from models.case import Case
from synth.design import Design
from synth.operability import Operability, WeatherWindows, payload_criteria
from synth.robust import Robustness
from synth.sensitivity import Sensitivity
from synth.sweeps import ATTRIBUTE

from ..comparison import Comparison
from ..runs import FailureModes, Runs

if TYPE_CHECKING:
    import xarray as xr

    from synth.limits import Limit

_OWNER = "report"


@dataclass(frozen=True, kw_only=True)
class Revision:
    """A row of the revision table."""

    mark: str  #: As in `A` or `01`.
    date: str  #: As in 2026-11-28.
    text: str  #: What was done, as in `issued for comment`.
    author: str = ""
    checker: str = ""
    approver: str = ""

    @classmethod
    def read(cls, text: str) -> Revision:
        """Return the revision of a text `MARK; DATE; TEXT[; AUTHOR[; CHECKER[; APPROVER]]]`.

        Raises InputError if it has other parts, or the date is none.

        Examples
        --------
        >>> Revision.read("A; 2026-11-28; issued for comment; NN").author
        'NN'
        """
        parts = [part.strip() for part in text.split(";")]
        form = "'MARK; DATE; TEXT[; AUTHOR[; CHECKER[; APPROVER]]]'"
        if not 3 <= len(parts) <= 6 or not all(parts[:3]):
            raise InputError(f"report: a revision must be {form}, got {text!r}")
        checked_date("the date of a revision", parts[1])
        names = ("mark", "date", "text", "author", "checker", "approver")
        return cls(**dict(zip(names, parts, strict=False)))


@dataclass(frozen=True, kw_only=True)
class TitleBlock:
    """What a document is called, for whom it is, and who answers for it; all may be left out."""

    title: str = ""  #: By default one that names the case.
    project: str = ""
    client: str = ""
    document: str = ""  #: Number of the document.
    date: str = ""  #: As in 2026-11-28; by default today's.
    author: str = ""
    checker: str = ""
    approver: str = ""
    revisions: tuple[Revision, ...] = ()  #: By default one, the first issue.

    def __post_init__(self) -> None:
        if self.date:
            checked_date("date", self.date)

    @property
    def day(self) -> str:
        """The date of the document."""
        return self.date or date.today().isoformat()

    @property
    def table(self) -> tuple[Revision, ...]:
        """The revisions, at least one."""
        first = Revision(
            mark="0",
            date=self.day,
            text="first issue",
            author=self.author,
            checker=self.checker,
            approver=self.approver,
        )
        return self.revisions or (first,)


def checked_date(what: str, text: str) -> None:
    """Check that a text is a date.

    Raises InputError if it is none.
    """
    try:
        date.fromisoformat(text)
    except ValueError:
        raise InputError(f"report: {what} must be as in 2026-11-28, got {text!r}") from None


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """A design, and the studies that have been made of it.

    Raises InputError if one is of another case than the design.
    """

    design: Design
    #: How still the load must be held (`synth.operability.payload_criteria`); by default what the
    #: study of operability was asked for.
    required: tuple[Limit, ...] = ()
    comparison: Comparison | None = None
    operability: Operability | None = None
    windows: WeatherWindows | None = None
    sweep: xr.Dataset | None = None
    sensitivity: Sensitivity | None = None
    robustness: Robustness | None = None
    failures: FailureModes | None = None
    runs: Runs | None = None  #: The design in time.
    held: Runs | None = None  #: The drum held, in the same seas.

    def __post_init__(self) -> None:
        if not self.design.parameters:
            raise InputError(f"{_OWNER}: the design has no controller: {self.design.status}")
        study = self.sensitivity
        cases = {
            "comparison": self.comparison,
            "study of operability": self.operability,
            "sensitivity": None if study is None else study.design,
            "study of failures": self.failures,
            "simulation": self.runs,
            "simulation with the drum held": self.held,
        }
        found = {what: one.case for what, one in cases.items() if one is not None}
        swept = None if self.sweep is None else _case_of_sweep(self.sweep)
        if swept is not None:
            found["sweep"] = swept
        own = self.design.case
        for what, case in found.items():
            if case != own:
                raise InputError(
                    f"{_OWNER}: the {what} is of another case ({told(case)}) than the design "
                    f"({told(own)})"
                )

    @property
    def case(self) -> Case:
        """The case of all of them."""
        return self.design.case

    @property
    def requirement(self) -> tuple[Limit, ...]:
        """How still the load must be held; nothing where nobody has said."""
        asked = () if self.operability is None else self.operability.wanted
        return self.required or asked


def requirement_of(case: Case, wanted: Mapping[str, Any] | None) -> tuple[Limit, ...]:
    """Return the criteria of a mapping such as ``{"payload_rms": "50 mm", "daf": 1.3}``.

    Its names are ``payload_rms``, ``payload_significant``, ``payload_max``, ``payload_speed``,
    ``daf`` and ``snap``, as of `synth.operability`.

    Raises InputError if a name is unknown or a value is not one.
    """
    names = {
        "payload_rms": "rms",
        "payload_significant": "significant",
        "payload_max": "maximum",
        "payload_speed": "speed",
        "daf": "daf",
        "snap": "snap",
    }
    given = {name: value for name, value in (wanted or {}).items() if value is not None}
    unknown = [name for name in given if name not in names]
    if unknown:
        raise InputError(
            f"{_OWNER}: requirement: there is no {unknown[0]!r}; there are {', '.join(names)}"
        )
    return payload_criteria(case, **{names[name]: value for name, value in given.items()})


def told(case: Case) -> str:
    """Return a case's name and the beginning of its hash."""
    return f"{case.name}, {case.digest[:12]}"


def _case_of_sweep(result: xr.Dataset) -> Case | None:
    """Return the nominal case of a sweep."""
    header = result.attrs.get(ATTRIBUTE)
    return None if header is None else Case.from_stored(json.loads(header)["case"])
