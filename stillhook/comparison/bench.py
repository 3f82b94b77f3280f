"""Tasks of a comparison, designs and runs, and the bench that does them in any process.

CellBench --(to any process)--> do(CellTask) --> StoredDesign, Cell, Trace or Refused
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from models.basics import PhysicsWarning

from ..controllers import Contender, StoredDesign, design_law
from ..keeper import failure
from .cell import ComparisonQuestion, Floor, Prepared


@dataclass(frozen=True, kw_only=True)
class CellTask:
    """Something to do."""

    kind: str  #: "design", "run" or "trace".
    name: str  #: The contender, or the design that is wanted.
    height: float  #: Significant height [m].
    seed: int = -1  #: Seed of the run; -1 for a design.
    #: The design that the contender is made of; None if it needs none.
    law: StoredDesign | None = field(default=None, compare=False)
    moment: float = 0.0  #: What to show the traces around [s].

    @property
    def group(self) -> tuple[str, float]:
        """What is prepared once for several tasks."""
        return self.name, self.height


@dataclass(frozen=True, kw_only=True)
class Refused:
    """An answer that says why there is none, and whether it holds for every seed."""

    reason: str
    always: bool = False


class CellBench:
    """Does tasks, one after the other, and keeps what it prepared for the one before."""

    def __init__(self, question: ComparisonQuestion, contenders: Sequence[Contender]) -> None:
        self._question = question
        self._contenders = {each.name: each for each in contenders}
        self._at: tuple[str, float] | None = None
        self._prepared: Any = None

    def do(self, task: CellTask, progress: Any = None) -> Any:
        """Return the answer to a task: a `StoredDesign`, a `Cell`, a `Trace`, or `Refused`."""
        with warnings.catch_warnings():  # told once, where the case was read
            warnings.simplefilter("ignore", PhysicsWarning)
            try:
                if task.kind == "design":
                    case = self._question.known(task.height)
                    return design_law(task.name, case, self._question.starts, progress)
                if self._at != task.group:
                    self._at, self._prepared = None, None
                    contender = self._contenders[task.name]
                    how = (self._question, contender, task.height)
                    floor = contender.recipe is None
                    self._prepared = Floor(*how) if floor else Prepared(*how, task.law)
                    self._at = task.group
            except Exception as error:  # what a contender of the user's own may do
                return Refused(reason=failure(error), always=True)
            try:
                if task.kind == "trace":
                    return self._prepared.trace(task.seed, task.moment, progress)
                return self._prepared.run(task.seed, progress)
            except Exception as error:
                self._at = None
                return Refused(reason=failure(error))
