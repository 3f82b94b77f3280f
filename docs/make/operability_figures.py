"""Figures of `docs/operability.md`, and its figures: `python docs/make/operability_figures.py`.

A present-day winch (`subsea-crane`) over the starboard quarter of the bundled supply vessel, with
the gains of the structure `combined`, against the made-up scatter diagram.  About three minutes.
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path

from stored import docs_folder, study_parser

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
VESSEL = {
    "vessel.raos": "osv-83m",
    "vessel.hook": {"x": -25.0, "y": -15.0, "z": 20.0},
    "vessel.heading": "165 deg",
}


def main() -> None:
    """Find the design and its contours, draw them, and print what the page says."""
    import numpy as np

    import stillhook as sh
    from models.basics import PhysicsWarning
    from stillhook.seas import (
        capability_figure,
        contour_figure,
        depth_figure,
        heading_figure,
        scatter_figure,
    )
    from stillhook.text import picture
    from synth.operability import operability

    quick = study_parser(__doc__).parse_args().quick
    images = docs_folder(quick) / "images"
    warnings.simplefilter("ignore", PhysicsWarning)
    case = sh.load_case("subsea-crane").replace(VESSEL)
    design = sh.optimise_gains(case, "feed-forward" if quick else "combined", starts=1)
    print(design)
    begun = time.perf_counter()
    study = operability(
        design,
        headings=np.radians(np.arange(0.0, 360.0, 90.0 if quick else 15.0)),
        payload_rms="50 mm",
        scatter="example",
    )
    seas = study.periods.size * (1 if study.headings is None else study.headings.size)
    print(f"{seas} seas in {time.perf_counter() - begun:.1f} s")
    deep = operability(
        design,
        periods=np.arange(5.0, 16.0, 5.0 if quick else 1.0),
        headings=[np.radians(165.0)],
        payload_rms="50 mm",
        depths=[300.0, 500.0, 1000.0, 1300.0],
    )
    print(study)
    print(deep)
    for check in (*study.verify(), *deep.verify(1)):
        print(check)
    for name, figure in (
        ("contour", contour_figure(study)),
        ("headings", heading_figure(study)),
        ("year", scatter_figure(study)),
        ("capability", capability_figure(study)),
        ("depths", depth_figure(deep)),
    ):
        (images / f"operability-{name}.svg").write_bytes(picture(figure, "svg"))


if __name__ == "__main__":
    main()
