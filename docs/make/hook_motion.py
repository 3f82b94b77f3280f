"""The hook of a vessel: its figure for the docs, and how long it takes to find it.

    python docs/make/hook_motion.py            # docs/images/hook-motion.svg
    python docs/make/hook_motion.py --time     # how long each step takes

The bundled crane on the bundled vessel `osv-83m`, in a short-crested sea.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from stored import docs_folder, study_parser

import stillhook as sh
from models.hook import HookMotion, hook_motion
from models.vessel import vessel_raos
from models.vessel.readers import read_raos

IMAGE = Path(__file__).resolve().parents[2] / "docs" / "images" / "hook-motion.svg"
VESSEL = {
    "vessel.raos": "osv-83m",
    "vessel.hook": {"x": -32.0, "y": 12.0, "z": 20.0},
    "vessel.heading": "165 deg",
}
SPREADING = {"sea.spreading": {"kind": "cos-2s", "exponent": 10}}


def case(**changes: object) -> sh.Case:
    """Return the bundled crane on the bundled vessel."""
    return sh.load_case("subsea-crane").replace({**VESSEL, **SPREADING, **changes})


def picture(path: Path = IMAGE) -> None:
    """Write the figure."""
    from stillhook.seas import motion_figure
    from stillhook.text import picture as drawn

    path.write_bytes(drawn(motion_figure(hook_motion(case())), "svg"))
    print(f"written: {path}")


def best_of(work: Callable[[], object], rounds: int = 5) -> float:
    """Return the shortest time of some rounds [ms]."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def timed() -> None:
    """Print how long each step takes."""
    own, moving = case(), case(**{"vessel.speed": "5 knots"})
    vessel_raos(own.vessel)
    rows: list[tuple[str, Callable[[], object]]] = [
        ("read the vessel's file", lambda: read_raos("osv-83m")),
        ("make a case with it again", case),
        ("hook motion and its statistics, 33 headings", lambda: HookMotion.from_case(own).velocity),
        ("the same at 5 knots", lambda: HookMotion.from_case(moving).velocity),
        ("survey: 2 sides, 24 headings, 12 peak periods", lambda: hook_motion(own)),
        ("the same at 5 knots", lambda: hook_motion(moving)),
        ("three hours at 20 Hz", lambda: HookMotion.from_case(own).record(10800.0, seed=1)),
    ]
    for name, work in rows:
        print(f"{name:<50} {best_of(work):8.1f} ms")


def main() -> None:
    """Draw, or measure."""
    parser = study_parser(__doc__)
    parser.add_argument("--time", action="store_true", help="measure instead of drawing")
    given = parser.parse_args()
    timed() if given.time else picture(docs_folder(given.quick) / "images" / IMAGE.name)


if __name__ == "__main__":
    main()
