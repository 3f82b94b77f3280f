"""Cases by name, the crane with the data that gains and numbers in the tests were made for.

Its rope was twice as stiff as the bundled one's, its tip rigid, its sheaves without losses, and the
error of its reference unit noise in the band of the waves.  The ropes of both cranes were damped by
Kelvin and Voigt's law.
"""

from __future__ import annotations

from pathlib import Path

from models import Case
from models import load_case as bundled
from models.casefile import read_yaml

_FORMER = Path(__file__).parents[1] / "golden" / "cases" / "subsea-crane.yaml"


def load_case(name: str | Path) -> Case:
    """Return a case by name or path, the former ones for ``subsea-crane`` and ``landing``."""
    if name == "landing":
        return bundled(name).replace({"rope.damping_law": "kelvin-voigt"})
    if name != "subsea-crane":
        return bundled(name)
    data, _ = read_yaml(_FORMER.read_text(encoding="utf-8"), name)
    data["sensors"]["payload"]["noise_enters"] = "before-filter"
    return Case.from_dict(data, source=name)
