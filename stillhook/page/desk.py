"""The warm desk: the view that a tab keeps, and what it answers to a state.

State --> Desk.look (in the looking thread) --> Drawn: the page's figures and charts as text
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field

from models.basics import PhysicsWarning
from models.case import Case
from synth.design import View, prepare
from synth.structures import Parameter

from .charts import limit_bars, nyquist_chart, response_chart, spectrum_chart
from .curves import Picture, picture_of
from .state import State, gains_in_use


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A picture and its charts."""

    picture: Picture
    response: str
    spectrum: str
    nyquist: str
    limits: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Question:
    """A state to be looked at, with the prices of the last optimum."""

    state: State
    prices: Mapping[str, float] = field(default_factory=dict)


class Desk:
    """A view of the case and structure looked at last, and what was changed in it."""

    def __init__(self) -> None:
        self._view: View | None = None
        self._case: Case | None = None
        self._changes: dict[str, float] = {}

    def law(self, case: Case, structure: str) -> tuple[Parameter, ...]:
        """Return the parameters of a structure on a case.

        Raises InputError if there is no such structure, or the case lacks what it needs.
        """
        return self._of(case, structure).posed.first.whole_law.parameters

    def state(
        self, case: Case, structure: str, changes: Mapping[str, float] | None = None
    ) -> State:
        """Return the state that a case or a structure is opened with.

        Raises InputError as `law`.
        """
        law = self.law(case, structure)
        return State.of(case, structure, law, gains_in_use(case, structure), changes)

    def look(self, question: Question) -> Drawn:
        """Return what a state shows; what did not change since the last look is kept.

        Raises InputError if a number is out of what the case allows.
        """
        state = question.state
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PhysicsWarning)
            view = self._of(state.case, state.structure)
            fresh = {p: v for p, v in state.changes.items() if self._changes.get(p) != v}
            if fresh:
                view = view.replace(fresh)
                self._view, self._changes = view, {**self._changes, **fresh}
            picture = picture_of(view.evaluate(state.parameters), question.prices)
        return Drawn(
            picture=picture,
            response=response_chart(picture),
            spectrum=spectrum_chart(picture),
            nyquist=nyquist_chart(picture),
            limits=limit_bars(picture.limits),
        )

    def _of(self, case: Case, structure: str) -> View:
        view = self._view
        if view is None or self._case is not case or view.structure != structure:
            view = prepare(case, structure)
            self._view, self._case, self._changes = view, case, {}
        return view
