"""`sh.sweep`: a design or a controller on many cases about the nominal one, in either domain.

    design, Spread, samples --> frequency: synth.sweeps, a million cases at once
                            --> time: one nonlinear run for each case, on any number of cores
                            --> xarray.Dataset along "case"

`stillhook sweep` is the same at the command line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from models.basics import InputError, check_range, check_seed, pick, shows_progress
from models.case import Case
from models.spread import METHODS, Spread
from synth.design import Design

from ..keeper import Pool
from ..text import Progress

if TYPE_CHECKING:
    import xarray as xr

SAMPLES = {"frequency": 10_000, "time": 256}
"""Cases of a sweep unless told otherwise, by its mode."""

_LONGEST = 1e6  # run in time [s]


@shows_progress("cases")
def sweep(
    design: object,
    spread: Spread | Mapping[str, Any] | str | Path | None = None,
    *,
    samples: int | None = None,
    metrics: Sequence[str] | None = None,
    mode: str = "frequency",
    case: Case | None = None,
    sampling: str = "sobol",
    seed: int = 0,
    duration: float | str = "10 min",
    settle: float | str | None = None,
    scenario: str = "hold",
    options: Mapping[str, object] | None = None,
    masses: int | None = None,
    compiled: bool | None = None,
    design_follows: bool = False,
    weighed: bool = True,
    common_seed: bool = False,
    first: int = 0,
    starts: int = 8,
    engine: str | Pool | None = None,
    jobs: int | None = None,
    store: str | Path | None = None,
    chunk: int | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Evaluate a design or a controller on many cases.

    Parameters
    ----------
    design
        A `Design`; in time also the name of a controller (`mpc`,
        `feed-forward`, ...), a controller, or a pair of a name and a function of the case that
        returns one.
    spread
        What varies: a `Spread`, distributions by path of the case, or a spread file; by default
        `usual_spread`: mass +-30 %, stiffness +-20 %, drag +-50 %, delay up to 20 ms more.
    samples
        Number of cases; by default 10 000 in the frequency domain, 256 in time.
    metrics
        What to keep; everything by default.
    mode
        "frequency": the linear loop, thousands of cases a second; "time": nonlinear runs with
        limits, slack, noise and faults.
    case
        The nominal case; by default that of the design or controller.
    sampling
        A method of `Spread.sample`: sobol, lhs, random, grid, corners, given.
    seed
        Of the draws; row i and run i depend on it and i alone.
    duration, settle, scenario, options, masses, compiled
        In time, as for `sh.simulate`; the duration is 10 minutes by default.
    design_follows
        In time: whether the controller is made for each case, and a design designed anew
        (`starts` starts a search); by default it is made for the nominal case, and the plant is
        another.
    weighed
        In time: whether a controller that does not follow knows the static load.
    common_seed
        In time: whether all cases meet the same sea and noise.
    first
        In time: number of the first case, for a part of a sweep too long for one driver; the parts
        of a Sobol sequence or of Monte Carlo are those of the whole.
    engine, jobs
        In time: "processes" (default), "serial", ``local:4`` or the address of a dask scheduler;
        number of processes.  The numbers are the same on all of them, to the bit.
    store
        In time: folder in which results are kept as they come; the same call goes on with what it
        finds.  In the frequency domain: where the result is written (``.nc``, ``.zarr``,
        ``.parquet``, ``.csv``); such a file in time has its journal beside it (``.jsonl``).
    chunk
        In the frequency domain: cases computed at once.
    progress
        Called as progress(what, done, total).

    Returns
    -------
    Dataset
        Along "case"; a coordinate for each path that varies; variables with units and long
        names.  ``stable`` is 1 where the loop is stable, or the payload was held to the end.
        ``result.sweep.table()``, ``.worst()``, ``.to_csv()``: see `stillhook.sweeps.accessor`.

    Raises
    ------
    InputError
        If an argument is out of range, a path is unknown, or the store holds another sweep.
    SolverError
        If a cluster is gone.

    Examples
    --------
    >>> import stillhook as sh
    >>> found = sh.sweep("feed-forward", {"payload.mass": "20 %"}, mode="time", samples=2,
    ...     case=sh.load_case("subsea-crane"), duration="1 min", jobs=1)
    >>> dict(found.sizes), found["payload_rms"].attrs["units"]
    ({'case': 2}, 'm')
    """
    from . import accessor  # registers `result.sweep`

    pick("sweep", "mode", tuple(SAMPLES), (mode,))
    pick("sweep", "sampling", METHODS, (sampling,))
    check_seed("sweep", seed)
    wanted = SAMPLES[mode] if samples is None else samples
    check_range("sweep", "samples", wanted, low=1, high=1_000_000_000)
    nominal = case_of(design, case)
    given = spread_of(spread, nominal, mode)
    if mode == "frequency":
        from synth.sweeps import frequency_sweep

        from .export import check_writable, write_result

        if not isinstance(design, Design):
            raise InputError(
                f"sweep: in the frequency domain a design is wanted, got {design!r}; other "
                "controllers are swept with mode='time'"
            )
        if store is not None:
            check_writable(store)
        found = frequency_sweep(
            design if design.case is nominal else _on(design, nominal),
            given,
            samples=int(wanted),
            sampling=sampling,
            seed=seed,
            metrics=metrics,
            chunk=chunk,
            progress=progress,
        )
        if store is not None:
            write_result(found, store)
        return found
    from ..controllers import recipe_of
    from ..runs import seconds_of
    from .store import Draw
    from .time_cases import TimeQuestion
    from .time_metrics import names_of
    from .time_sweep import run_sweep

    del accessor
    recipe = recipe_of(design, "sweep")
    question = TimeQuestion(
        case=nominal,
        recipe=recipe,
        metrics=names_of(metrics),
        duration=seconds_of("sweep: duration", duration, high=_LONGEST),
        settle=None
        if settle is None
        else seconds_of("sweep: settle", settle, high=_LONGEST, positive=False),
        scenario=scenario,
        options=dict(options or {}),
        masses=masses,
        compiled=compiled,
        design_follows=design_follows,
        weighed=weighed,
        starts=int(check_range("sweep", "starts", starts, low=1, high=4096)),
    )
    own = given.on(nominal, recipe.gains or None)
    check_range("sweep", "first", first, low=0, high=1e12)
    if first and sampling not in ("sobol", "random"):
        raise InputError(f"sweep: a part of a sweep is of sobol or random, got {sampling!r}")
    draw = Draw(
        spread=own,
        samples=own.count(None if sampling == "given" else int(wanted), sampling),
        sampling=sampling,
        seed=int(seed),
        common_seed=common_seed,
        first=int(first),
    )
    return run_sweep(question, draw, engine=engine, jobs=jobs, store=store, progress=progress)


@shows_progress("cases")
def resume_sweep(
    store: str | Path,
    *,
    engine: str | Pool | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Go on with a time-domain sweep that was stopped, from its store alone.

    The store is the folder that `sweep` was given; another engine gives the same numbers.

    Raises InputError if there is no sweep, it is spoilt, was computed by other code, or its
    controller was Python code (then call `sweep` again as before).
    """
    from . import accessor
    from .store import stored_question
    from .time_sweep import run_sweep

    del accessor
    question, draw = stored_question(store)
    return run_sweep(question, draw, engine=engine, jobs=jobs, store=store, progress=progress)


def case_of(design: object, case: Case | None) -> Case:
    """Return the nominal case: the one given, or that of the design.

    Raises InputError if there is none.
    """
    own = design[1] if isinstance(design, tuple) and len(design) == 2 else design
    found = case if case is not None else getattr(own, "case", None)
    if not isinstance(found, Case):
        what = repr(design) if isinstance(design, str) else type(own).__name__
        raise InputError(f"sweep: {what} knows of no case: say case=...")
    return found


def spread_of(
    given: Spread | Mapping[str, Any] | str | Path | None, case: Case, mode: str
) -> Spread:
    """Return the spread that is meant.

    Raises InputError if it is none.
    """
    if given is None:
        from .usual import usual_spread

        return usual_spread(case, mode)
    if isinstance(given, Spread):
        return given
    if isinstance(given, str | Path):
        return Spread.from_yaml(given)
    if "vary" in given:
        return Spread.from_dict(given)
    return Spread(dict(given))


def _on(design: Design, case: Case) -> Design:
    """Return a design's parameters on another case, in its sea."""
    return replace(design, case=case, significant_height=case.sea.significant_height)
