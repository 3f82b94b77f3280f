"""Designs as plain data (`StoredDesign`), and those that are fair to linear laws.

    case at one H_s --> optimise_gains --> StoredDesign --> store, processes

A linear law can be designed to keep the drive's limits, or as if there were none: the first is
slow in a sea that the drive could follow, the second falls off where it cannot.  In between is one
that keeps them in a sea of half the height, and saturates now and then.  None is fair to linear
control by itself, so all take part, whatever the case says about the limits; the plant that they
are simulated on has them all the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

from models.case import Case
from synth.design import Design, Tuning
from synth.loop import LinearController
from synth.question import controller_for

if TYPE_CHECKING:
    from ..text import Progress

EAGER = "-eager"  #: Ending of the designs that ignore the drive's limits.
HALF = "-half"  #: Ending of the designs that keep them in a sea of half the height.


@dataclass(frozen=True, kw_only=True)
class StoredDesign:
    """A linear law as plain data, exact to the last bit in JSON."""

    #: The matrices A, B, C, D and the names of the measurements and inputs; empty where no stable
    #: law was found.
    values: Mapping[str, Any]
    ok: bool  #: Whether it keeps every limit that it was designed for.
    #: "enforced" or "reported": whether the drive's limits were among these; empty if the design
    #: was given.
    drive: str = ""
    status: str = ""  #: The sentence of the design.
    #: The structure and its parameters by name; empty where there is no structure of a winch.
    structure: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def found(self) -> bool:
        """Whether there is a law at all."""
        return bool(self.values)

    @property
    def law(self) -> LinearController:
        """What `LinearFeedback` takes: a controller in state space."""
        ny, nu = len(self.values["measurements"]), len(self.values["inputs"])
        n = len(self.values["A"])
        import numpy as np

        shapes = {"A": (n, n), "B": (n, ny), "C": (nu, n), "D": (nu, ny)}
        return LinearController(
            **{k: np.reshape(np.array(self.values[k], float), s) for k, s in shapes.items()},
            measurements=tuple(self.values["measurements"]),
            inputs=tuple(self.values["inputs"]),
        )

    def on(self, case: Case, parameters: Mapping[str, float]) -> StoredDesign:
        """Return the law with some of its parameters changed, for a case."""
        every = {**self.parameters, **parameters}
        controller = controller_for(case, self.structure, every)
        return replace(self, values=_matrices(controller), parameters=every)

    @property
    def digest(self) -> str:
        """Digest of what it does, whatever was said about it."""
        text = json.dumps(dict(self.values), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)

    @classmethod
    def of(cls, design: Design | Tuning, drive: str = "") -> StoredDesign:
        """Return the law of a design."""
        about: dict[str, Any] = {"ok": bool(design.ok), "drive": drive, "status": design.status}
        controller = design.controller if design.margins is not None else None
        if controller is None:
            return cls(values={}, **about)
        if isinstance(design, Design):
            parameters = {name: float(value) for name, value in design.parameters.items()}
            about |= {"structure": design.structure, "parameters": parameters}
        return cls(values=_matrices(controller), **about)


def _matrices(controller: LinearController) -> dict[str, Any]:
    values: dict[str, Any] = {k: getattr(controller, k).tolist() for k in ("A", "B", "C", "D")}
    return values | {
        "measurements": list(controller.measurements),
        "inputs": list(controller.inputs),
    }


def design_law(
    needs: str, case: Case, starts: int, progress: Progress | None = None
) -> StoredDesign:
    """Return the law that is designed for a case, in its sea.

    `needs` is the name of a structure, for a law within the drive's limits; followed by "-eager"
    for one that ignores them, or "-half" for one that keeps them in half the sea.  A reference unit
    that the case does not name is an exact one.  `progress` is called as progress(stage, done,
    total).

    Raises InputError if a limit lies below the static load.
    """
    if case.sensors.mru is None:  # it is simulated with an exact one, which all others hear too
        case = case.replace({"sensors.mru": {"noise_floor": 0.0, "noise_fraction": 0.0}})
    if needs.endswith(EAGER):
        free = case.replace({"limits.drive": "report"})
        return StoredDesign.of(
            _design(needs.removesuffix(EAGER), free, starts, progress), "reported"
        )
    changes: dict[str, object] = {"limits.drive": "enforce"}
    if needs.endswith(HALF):
        needs = needs.removesuffix(HALF)
        changes["sea.significant_height"] = 0.5 * float(case.sea.significant_height)
    strict = case.replace(changes)
    design = _design(needs, strict, starts, progress)
    law = StoredDesign.of(design, "enforced")
    if not design.drive_kept:
        # What was found ignores the limits: that is the eager one, and takes part as such.
        status = f"no law within the drive's limits: {law.status}"
        return replace(law, values={}, status=status)
    return law


def _design(needs: str, case: Case, starts: int, progress: Progress | None) -> Design:
    from synth.design import optimise_gains

    return optimise_gains(case, needs, starts=starts, progress=progress)
