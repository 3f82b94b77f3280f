"""Weather windows of `docs/operability.md`: `python docs/make/windows_figures.py`.

The winch of `docs/make/operability_figures.py` with the gains of `feed-forward`, in the made-up
year.  A minute.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from functools import cache

import numpy as np
from operability_figures import design
from said import QUICK, Effort, Saying, sayings_parser, tell
from stored import docs_folder

from models.basics import PhysicsWarning
from stillhook.seas import calendar_figure, months_figure
from stillhook.text import picture
from synth.operability import (
    HOUR,
    Operability,
    VesselHeading,
    WeatherWindows,
    example_series,
    operability,
    recheck_records,
    weather_windows,
)

PAGE, FILE = "operability.md", "said_windows.csv"
LIES = VesselHeading(within=np.radians(30.0))


@cache
def study(effort: Effort) -> tuple[Operability, float]:
    """Return the contours that reach every sea of the year, and how long they took [s]."""
    own, begun = design(QUICK), time.process_time()  # of the structure `feed-forward`
    quick = {"periods": [2.6, 7.0, 12.0, 19.0], "headings": np.radians([150.0, 210.0])}
    found = operability(
        own,
        payload_rms="300 mm",
        seas=example_series(),
        vessel_heading=LIES,
        **(quick if effort == QUICK else {}),
    )
    return found, time.process_time() - begun


@cache
def windows(effort: Effort, alpha: float = 1.0) -> tuple[WeatherWindows, float]:
    """Return the windows of 12 h with as much contingency, and how long they took [s]."""
    contours, begun = study(effort)[0], time.process_time()
    found = weather_windows(contours, example_series(), "12 h", heading=LIES, alpha=alpha)
    found.whole("loop")
    return found, time.process_time() - begun


def counts(effort: Effort) -> dict[str, float]:
    """Return windows, shares of the time [%] and mean waits [h], before and after."""
    found = windows(effort)[0]
    numbers = {}
    for name in ("held", "loop"):
        whole = found.whole(name)
        numbers |= {
            f"{name}": whole.count,
            f"{name}_share": 100.0 * whole.inside,
            f"{name}_wait": whole.mean_wait / HOUR,
        }
    less = windows(effort, 0.8)[0].whole("loop")
    return numbers | {"less": less.count, "less_wait": less.mean_wait / HOUR}


def speed(effort: Effort) -> dict[str, float]:
    """Return how many seas and records took how long [s], and how far off look-ups are [%]."""
    contours, seconds = study(effort)
    found, more = windows(effort)
    checks = recheck_records(contours, found, 3 if effort == QUICK else 12)
    return {
        "seas": contours.dataset.height.size,
        "study": seconds,
        "records": len(found.seas),
        "seconds": more,
        "checks": len(checks),
        "off": 100.0 * max(check.difference for check in checks),
    }


SAYINGS = [
    Saying(
        page=PAGE,
        name="windows",
        template="""
            finds {held:.0f} windows in that year with the drum held and {loop:.0f} with the design,
            {held_share:.0f} and {loop_share:.0f} % of the time; whoever arrives waits
            {held_wait:.0f} and {loop_wait:.0f} h on average. An alpha of 0.8 leaves {less:.0f}
            windows and a wait of {less_wait:.0f} h.
        """,
        work=counts,
    ),
    Saying(
        page=PAGE,
        name="records",
        template="""
            The contours of {seas:.0f} seas took {study:.0f} s of one core, the {records:.0f}
            records {seconds:.1f} s. In the {checks:.0f} records whose $H_s$ is nearest the limit, a
            single evaluation finds what binds within {off:.1f} % of its bound.
        """,
        work=speed,
    ),
]


def draw(effort: Effort) -> None:
    """Draw the figures, and print what is beside them."""
    images = docs_folder(effort == QUICK) / "images"
    found = windows(effort)[0]
    print(study(effort)[0], found, sep="\n")
    for name, figure in (("months", months_figure(found)), ("calendar", calendar_figure(found))):
        (images / f"windows-{name}.svg").write_bytes(picture(figure, "svg"))


def main(argv: Sequence[str] | None = None) -> int:
    """Count the windows, draw them, and say what the page says."""
    warnings.simplefilter("ignore", PhysicsWarning)
    given = sayings_parser(__doc__).parse_args(argv)
    if not given.words:
        draw(QUICK if given.quick else Effort())
    return tell(SAYINGS, FILE, given)


if __name__ == "__main__":
    raise SystemExit(main())
