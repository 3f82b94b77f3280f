"""The journal of a comparison (`Store`), from which it goes on where it stopped.

Cell, StoredDesign --> Store --> cells.jsonl --> Store --> what is there already
"""

from pathlib import Path
from typing import Any

from ..controllers import Contender, StoredDesign
from ..keeper import Journal, versions
from .bench import CellBench
from .cell import Cell, ComparisonQuestion

STORE = "cells.jsonl"  #: Name of the file in the folder of a comparison.


def question_of(question: ComparisonQuestion) -> dict[str, Any]:
    """Return what a store has to answer, as plain data."""
    return {
        "case": question.case.to_dict(),
        "duration": question.duration,
        "settle": question.settle,
        "mismatch": {str(k): v for k, v in question.mismatch.changes.items()},
        "masses": question.masses,
        "compiled": question.compiled,
        "design at": question.design_at,
        "starts": question.starts,
        "versions": versions(CellBench),
    }


class Store:
    """Results on disk, in a journal; `laws` are the designs by what was needed and height [m].

    Raises InputError as for `Journal`.
    """

    def __init__(self, path: Path, question: ComparisonQuestion) -> None:
        self.laws: dict[tuple[str, float], StoredDesign] = {}
        self._cells: dict[tuple[str, str, float, int], Cell] = {}
        self.journal = Journal(path, "comparison", question_of(question), self._take)

    def cell(
        self, contender: Contender, law: StoredDesign | None, height: float, seed: int
    ) -> Cell | None:
        """Return the result of a run, if there is one of this very contender."""
        return self._cells.get((contender.name, _identity(contender, law), height, seed))

    def add_cell(self, contender: Contender, law: StoredDesign | None, cell: Cell) -> None:
        """Keep the result of a run."""
        self.journal.add(["run", _identity(contender, law)], cell.to_dict())

    def add_law(self, needs: str, height: float, law: StoredDesign) -> None:
        """Keep a design."""
        self.journal.add(["design", needs, height], law.to_dict())

    def _take(self, key: list[Any], values: dict[str, Any]) -> None:
        kind, *rest = key
        if kind == "run":
            cell = Cell(**values)
            self._cells[cell.contender, rest[0], cell.height, cell.seed] = cell
        else:
            self.laws[rest[0], float(rest[1])] = StoredDesign(**values)


def _identity(contender: Contender, law: StoredDesign | None) -> str:
    """Return what a result hangs on besides the question: the contender and its law."""
    return f"{contender.identity}.{'' if law is None else law.digest}"
