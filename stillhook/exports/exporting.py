"""`sh.export`: a controller, or the plant, written as others run it.

design or case --> Law --> Recording --> each kind's files --> DIR/c, DIR/fmu, DIR/st, ..
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from models.basics import InputError, check_range, shows_progress
from models.case import Case
from models.plant import PlantData
from models.run import Run
from models.sensing import Controller

from ..runs import simulate
from ..text import OutputFolder, Progress
from .c_code import as_c
from .exported import Exported
from .facts import facts_of
from .fmu import as_fmu, plant_as_fmu
from .law import Law, law_of
from .margins import check_sample_time
from .plc import as_structured_text
from .readme import readme
from .recording import record
from .series import as_series
from .state_space import as_json, as_mat

if TYPE_CHECKING:
    from synth.design import Design, Tuning

Given = TypeVar("Given")

KINDS: Mapping[str, str] = {
    "c": "C99 sources of the controller, with a program that replays the test vector",
    "fmu": "FMI 2.0 co-simulation FMU of the controller (extra: export)",
    "st": "IEC 61131-3 structured text of the controller, and PLCopen XML",
    "mat": "state space of the law and the plant for MATLAB",
    "json": "the same as JSON",
    "plant": "FMI 2.0 co-simulation FMU of the plant, for controllers of others (extra: export)",
    "orcaflex": "the winch's payout and the hook's motion in the case's sea for OrcaFlex",
    "moordyn": "line length and its rate for MoorDyn",
    "csv": "the same as CSV",
}
"""What can be exported: kind and what it is."""

PLANT = "plant"
SERIES = ("orcaflex", "moordyn", "csv")
_REPLAYED = ("c", "fmu", "st")  # kinds that are compared with a test vector
_LAWS = (*_REPLAYED, "mat", "json")
_PLANT_STEP = 0.01  # of the plant's communication, unless another is asked for [s]
_LONGEST = 3.0 * 3600.0  # of a series [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Export:
    """What was exported: the law, each kind as it was written, and the files."""

    law: Law | None  #: None where the plant alone was asked for.
    facts: tuple[tuple[str, str], ...]  #: What is told of the law.
    exported: tuple[Exported, ...]
    written: tuple[Path, ...]

    @property
    def proved(self) -> bool:
        """Whether each was compared with the simulation, and found the same."""
        return all(one.proved for one in self.exported)


@shows_progress("exporting")
def export(
    what: Case | Design | Tuning | Controller,
    out: str | Path | OutputFolder,
    to: Sequence[str] | str = ("c",),
    *,
    controller: str | Controller | None = None,
    case: Case | None = None,
    gains: Mapping[str, float] | None = None,
    sample_time: float | None = None,
    communication_step: float | None = None,
    ramp: float = 5.0,
    rate: float = math.inf,
    slew: float = math.inf,
    duration: float = 600.0,
    seed: int = 0,
    name: str | None = None,
    progress: Progress | None = None,
) -> Export:
    """Export a controller as C, FMU, structured text or state space, the plant, or a run's series.

    Each kind goes into a folder of its own with a README; nothing is written unless all could be
    made.

    Parameters
    ----------
    what
        A design; or a case, with the controller meant.
    out
        The folder; it is made if need be.
    to
        Kinds of `KINDS`, or a text of them with commas between.
    controller
        For a case: the name of a controller (`stillhook scenarios` lists them), or one.
    case
        For a tuning or a controller: the case that it is for.
    gains
        For the controller ``feedback`` of a case.
    sample_time
        T of the exported law [s]; by default the controller's own.
    communication_step
        Step of the co-simulation that an FMU goes into [s]; the margins are told at it.
    ramp, rate, slew
        The operator's interface: time of taking over [s], highest rate of the set point [m/s] and
        of the command [per s].
    duration, seed
        Of the run that a series is taken from: its length [s] and its sea.
    name
        What files and functions are called; by default after the structure or the controller.
    progress
        Called as progress(what, done, total).

    Returns
    -------
    Export
        What was exported, how it was checked, and the files.

    Raises
    ------
    InputError
        If a kind is unknown, the law cannot be exported as it, a sample time breaks the margins,
        or a file cannot be written.
    SynthesisError, SolverError
        If the controller cannot be made, or an export does not do what was simulated.
    """
    kinds = asked_kinds(to)
    check_range("export", "duration", duration, low=60.0, high=_LONGEST, unit="s")
    if communication_step is not None:
        check_range(
            "export", "communication_step", communication_step, low=1e-5, high=10.0, unit="s"
        )
    target = OutputFolder.prepare(out)
    tell = progress if progress is not None else _silent
    total = len(kinds) + 2
    law, recording, run = None, None, None
    facts: tuple[tuple[str, str], ...] = ()
    if set(kinds) != {PLANT}:
        tell("controller", 0, total)
        law = law_of(
            what,
            controller=controller,
            case=case,
            gains=gains,
            sample_time=sample_time,
            ramp=ramp,
            rate=rate,
            slew=slew,
            name=name,
        )
        check_sample_time(law)
        facts = tuple(facts_of(law, communication_step))
    if law is not None and set(kinds) & set(_REPLAYED):
        tell("test vector", 1, total)
        recording = record(law, seed=seed)
    if law is not None and set(kinds) & set(SERIES):
        tell("run", 1, total)
        runs = simulate(law.case, law.controller, seeds=[seed], duration=duration)
        run = runs[0]
    world = law.case if law is not None else _case_of(what, case)
    makers: Mapping[str, Callable[[], Exported]] = {
        "c": lambda: as_c(_given(law), _given(recording)),
        "fmu": lambda: as_fmu(
            _given(law), _given(recording), communication_step=communication_step
        ),
        "st": lambda: as_structured_text(_given(law), _given(recording)),
        "mat": lambda: as_mat(_given(law)),
        "json": lambda: as_json(_given(law)),
        PLANT: lambda: plant_as_fmu(
            world,
            sample_time=_PLANT_STEP if communication_step is None else communication_step,
            masses=_masses(what),
        ),
    } | {kind: functools.partial(_series, run, kind) for kind in SERIES}
    made = []
    for done, kind in enumerate(kinds):
        tell(kind, 2 + done, total)
        made.append(makers[kind]())
    tell("writing", total, total)
    written: list[Path] = []
    for one in made:
        of = law if one.kind in _LAWS else None
        text = readme(one, law=of, recording=recording, facts=facts if of is not None else ())
        for path, content in {"README.md": text, **one.files}.items():
            written.append(target.write(f"{one.kind}/{path}", content))
    return Export(law=law, facts=facts, exported=tuple(made), written=tuple(written))


def asked_kinds(to: Sequence[str] | str) -> tuple[str, ...]:
    """Return the kinds that are asked for, each once.

    Raises InputError if one is unknown, or there is none.
    """
    asked = [one.strip() for one in to.split(",")] if isinstance(to, str) else list(to)
    for one in asked:
        if one not in KINDS:
            raise InputError(f"export: --to: there is no {one!r}; {', '.join(KINDS)}")
    if not asked:
        raise InputError(f"export: --to: say what is wanted: {', '.join(KINDS)}")
    return tuple(dict.fromkeys(asked))


def _case_of(what: object, case: Case | None) -> Case:
    if case is None:
        case = what if isinstance(what, Case) else getattr(what, "case", None)
    if case is None:
        raise InputError("export: say which case the controller is for: case=...")
    return case


def _masses(what: object) -> int | None:
    """Return the masses along the rope that a design was found with, where they are more."""
    masses = int(getattr(what, "masses", 0))
    case = getattr(what, "case", None)
    if not masses or not isinstance(case, Case):
        return None
    data = PlantData.from_case(case)
    return masses if data.masses is None and masses > data.chosen_masses() else None


def _series(run: Run | None, kind: str) -> Exported:
    return as_series(_given(run), kind)


def _given(there: Given | None) -> Given:
    assert there is not None  # made above for every kind that needs it
    return there


def _silent(what: str, done: int, total: int) -> None:
    pass
