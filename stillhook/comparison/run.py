"""`sh.compare`: contenders in the same seas, on the same plant, with the same noise.

    case, contenders, H_s, seeds --> designs --> cells, in several processes --> Comparison

Every result is kept as soon as it is there (`stillhook.comparison.store`), and a comparison that
was stopped goes on where it was.  What a contender cannot do is part of the answer and no error: it
says why it did not take part.
"""

from __future__ import annotations

import contextlib
import sys
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path

from models.basics import InputError, check_choice, check_range
from models.case import Case
from models.simulation import EASE

from ..controllers import contenders_of
from ..keeper import Processes, usable_cores
from ..runs import seconds_of, seeds_of
from ..text import Progress
from .bench import CellSetup
from .campaign import Campaign
from .cell import ComparisonQuestion
from .comparison import Comparison
from .mismatch import Mismatch
from .store import STORE, Store

_LONGEST = 1e6  # run [s]


def compare(
    case: Case,
    controllers: Sequence[object] | None = None,
    *,
    seeds: int | Sequence[int] = 10,
    duration: float | str = "20 min",
    heights: Sequence[float] | None = None,
    mismatch: str | Mapping[str, object] | None = None,
    masses: int | None = None,
    settle: float | str | None = None,
    design_at: str = "each",
    starts: int = 8,
    compiled: bool | None = None,
    jobs: int | None = None,
    out: str | Path | None = None,
    traces: bool = True,
    progress: Progress | None = None,
) -> Comparison:
    """Compare controllers in the same seas, on the same nonlinear plant with its limits.

    Parameters
    ----------
    case
        Vessel, sea, rope, payload, winch and sensors.
    controllers
        Names of `stillhook.controllers.CONTENDERS`, designs, controllers, and pairs of a
        name and one of these or of a function of the case that returns a controller; by default
        `stillhook.controllers.DEFAULTS`.
    seeds
        How many seas of each height, or their seeds.  The same seed is the same motion of the
        hook for every contender, and the same noise for those with the same sample time.
    duration
        Length of a run [s], or a text such as ``"20 min"``.
    heights
        Significant heights [m]; by default that of the case.
    mismatch
        What of the plant is not as the controllers are told, such as
        ``"payload=+30%,delay=+50ms"`` (`stillhook.comparison.mismatch`).
    masses, compiled
        Of the simulated plant, as for `sh.simulate`.
    settle
        Time from which statistics count [s]; by default 30 s in which the hook's motion grows
        and ten peak periods, at most a tenth of the run but not less than these 30 s, or half of
        a run that is shorter than a minute.
    design_at
        "each": linear laws are designed anew for every height, which is fairest to them;
        "case": once, in the sea of the case.  Those within the drive's limits keep them whether
        the case enforces them or not; the eager ones ignore them (the plant does not).
    starts
        Starts of the searches for designs.
    jobs
        Processes that share the work; by default one for each core.  Contenders that cannot be
        sent to another process run in this one.
    out
        Folder in which every result is kept as soon as it is there; the same call goes on with
        what it finds.
    traces
        Whether to run once more around the worst moment of the best linear law, for a figure.
    progress
        Called as progress(what, done, total), in runs.

    Returns
    -------
    Comparison
        After Ctrl-C with the runs that there are.

    Raises
    ------
    InputError
        If an argument is out of range, a name is unknown, or `out` holds another comparison.

    Examples
    --------
    >>> import stillhook as sh
    >>> found = sh.compare(sh.load_case("thesis-1975"), ["none", "feed-forward"], seeds=2,
    ...     duration="1 min", jobs=1, traces=False)
    >>> found.table["runs"].tolist(), found.complete
    ([2, 2], True)
    """
    contenders = contenders_of(controllers)
    numbers = seeds_of("compare", seeds)
    lasting = seconds_of("compare: duration", duration, high=_LONGEST)
    check_choice("compare", "design_at", design_at, ("each", "case"))
    check_range("compare", "starts", starts, low=1, high=4096)
    if jobs is not None:
        check_range("compare", "jobs", jobs, low=1, high=512)
    waves = EASE + 10.0 * case.sea.spectral_peak_period
    asked = seconds_of("compare: settle", settle, high=_LONGEST, positive=False)
    usual = max(min(waves, 0.1 * lasting), min(EASE, 0.5 * lasting))
    question = ComparisonQuestion(
        case=case,
        duration=lasting,
        settle=usual if asked is None else asked,
        mismatch=Mismatch.read(mismatch),
        masses=masses,
        compiled=compiled,
        design_at=design_at,
        starts=int(starts),
    )
    check_range("compare", "settle", question.settle, low=0.0, high=0.9 * lasting, unit="s")
    levels = _heights(case, heights)
    for height in levels:
        question.true(height)  # what is wrong with a sea or a mismatch is said at once
    workers = min(int(jobs or usable_cores()), len(contenders) * len(levels) * len(numbers))
    began = clock.perf_counter()
    with contextlib.ExitStack() as stack:
        store = None
        if out is not None:
            from ..text import OutputFolder

            store = Store(OutputFolder.prepare(out).path / STORE, question)
            stack.enter_context(store.journal)
        campaign = Campaign(
            question=question,
            contenders=contenders,
            heights=levels,
            seeds=numbers,
            store=store,
            progress=progress or (lambda what, done, total: None),
        )
        complete = True
        try:
            if workers > 1 and sys.executable:
                names = {each.name: each for each in contenders if each.portable}
                setup = CellSetup(question=question, contenders=names)
                campaign.share(stack.enter_context(Processes(workers).begin(setup, workers)))
            campaign.alone()
            if traces:
                campaign.look_closely()
        except KeyboardInterrupt:
            complete = False
        return campaign.comparison(complete=complete, seconds=clock.perf_counter() - began)


def _heights(case: Case, heights: Sequence[float] | None) -> tuple[float, ...]:
    if heights is None:
        return (float(case.sea.significant_height),)
    found = tuple(
        check_range("compare", "heights", each, low=0.0, high=30.0, unit="m", open_low=True)
        for each in heights
    )
    if not found or len(set(found)) != len(found):
        raise InputError(f"compare: heights must be distinct, at least one, got {list(found)}")
    return tuple(sorted(found))
