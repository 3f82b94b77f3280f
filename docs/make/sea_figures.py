"""The figure of `docs/seas.md`: `python docs/make/sea_figures.py`.

`seas.svg`: the standard forms with one H_s and T_p, and the spreading laws.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from stored import docs_folder, study_parser

from models.sea import SeaSpectrum, Spreading
from stillhook.text import AFTER, BEFORE, DRUM, HOOK, REFERENCE, new_figure, picture, styled
from stillhook.text import typeset as math_text

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
HEIGHT, PERIOD = 2.5, 10.0

FORMS = (
    ("bretschneider", {}, REFERENCE, "-"),
    ("jonswap", {}, AFTER, "-"),
    ("tma", {"depth": 20.0}, AFTER, "--"),
    ("torsethaugen", {}, BEFORE, "-"),
    ("ochi-hubble", {"order": 3.0}, DRUM, "-"),
    ("gaussian-swell", {"width": 0.05}, HOOK, "-"),
)
LAWS = (
    ("cos-2s", 5.0, AFTER, "-"),
    ("cos-2s", 30.0, AFTER, "--"),
    ("cos-n", 2.0, DRUM, "-"),
    ("cos-n", 8.0, DRUM, "--"),
)


def seas() -> bytes:
    """Return the figure as SVG."""
    with styled():
        sheet = new_figure(9.2, 3.6)
        left, right = sheet.subplots(1, 2)
        omega = np.linspace(0.2, 2.0, 1200)
        for kind, fields, colour, line in FORMS:
            sea = SeaSpectrum(kind=kind, significant_height=HEIGHT, peak_period=PERIOD, **fields)
            name = ", ".join([kind, *(f"{key} {value:g}" for key, value in fields.items())])
            left.plot(omega, sea(omega), color=colour, linestyle=line, label=name, linewidth=1.5)
        left.set_xlim(0.2, 2.0)
        left.set_ylim(bottom=0.0)
        left.set_xlabel("frequency [rad/s]")
        left.set_ylabel("density [m² s/rad]")
        left.set_title(math_text(f"H_s {HEIGHT:g} m, T_p {PERIOD:g} s"), fontsize=9.5)
        left.legend(fontsize=8.0)
        angle = np.linspace(-math.pi, math.pi, 721)
        for kind, exponent, colour, line in LAWS:
            law = Spreading(kind=kind, exponent=exponent)
            label = f"{kind} {exponent:g}: {math.degrees(law.deviation):.0f}°"
            right.plot(
                np.degrees(angle), law.density(angle), color=colour, linestyle=line, label=label
            )
        right.set_xlim(-180.0, 180.0)
        right.set_xticks(range(-180, 181, 60))
        right.set_ylim(bottom=0.0)
        right.set_xlabel("angle from the mean heading [deg]")
        right.set_ylabel("share per radian")
        right.set_title("spreading, and its standard deviation", fontsize=9.5)
        right.legend(fontsize=8.0)
        return picture(sheet, "svg")


def main() -> None:
    """Draw the figure."""
    path = docs_folder(study_parser(__doc__).parse_args().quick) / "images" / "seas.svg"
    path.write_bytes(seas())
    print(f"written: {path}")


if __name__ == "__main__":
    main()
