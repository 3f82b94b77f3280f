"""Contenders of a comparison by name: recipe, description and knowledge of each.

names, designs, controllers, (name, function) --> contenders_of --> Contender ... --> compare
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from models.basics import InputError, pick
from models.case import Case
from synth.design import Design, Tuning

from .named import CONTROLLER_TEXTS
from .recipe import Make, Recipe, feedback, recipe_of, thesis
from .stored_design import EAGER, HALF

GROUPS = ("brake", "linear", "filter", "predictive", "own", "reference", "floor")
"""What contenders are: brake, linear laws, the filter of MPC without its plan, causal prediction,
the user's own, those that know what nobody can know, and the floor, which is no controller."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contender:
    """One that takes part."""

    name: str  #: What it is called in tables and figures.
    #: One line each: what it is, and what it knows.
    what: str
    knows: str
    group: str  #: One of `GROUPS`.
    recipe: Recipe | None  #: How its controller is made; None for the floor.

    @property
    def needs(self) -> str:
        """The design that is to be found for it, as for `design_law`; empty if none."""
        recipe = self.recipe
        return recipe.needs if recipe is not None and recipe.design is None else ""

    @property
    def portable(self) -> bool:
        """Whether it can be sent to another process, and known again when work goes on."""
        return self.recipe is None or self.recipe.portable

    @property
    def identity(self) -> str:
        """A digest that changes when the contender does."""
        return self.name if self.recipe is None else self.recipe.identity


def _named(name: str, knows: str, group: str) -> Contender:
    """Return the contender that has the name of a controller in time."""
    own = recipe_of(name, "compare")
    return Contender(name=name, what=CONTROLLER_TEXTS[name], knows=knows, group=group, recipe=own)


def _linear(name: str, needs: str, what: str, knows: str, make: Make | None = None) -> Contender:
    """Return a linear law that is designed for every sea."""
    own = Recipe(
        name=name,
        kind="law",
        make=make or functools.partial(feedback, name),
        needs=needs,
        identity=name,
    )
    return Contender(name=name, what=what, knows=knows, group="linear", recipe=own)


# What is designed: the structure, what it is, what it hears.
_DESIGNED = {
    "feedback": ("payload-feedback", "three optimised gains", "payload by telemetry"),
    "combined": (
        "combined", "optimised feedback and feed-forward", "payload and motion reference unit"
    ),
}  # fmt: skip
# How it is designed: ending of the name, that of what is needed (`design_law`), in words.
_WAYS = (
    ("", "", "within the drive's limits"),
    (HALF, HALF, "within the drive's limits in a sea of half the height"),
    (EAGER, EAGER, "as if the drive had no limits"),
    ("-no-antiwindup", EAGER, "as if the drive had no limits, and without anti-windup"),
)
_SEEN = "all sensors, up to now; plant of the case"
_ALL = (
    _named("none", "nothing", "brake"),
    _named("constant-tension", "load cell and motor", "linear"),
    _named("feed-forward", "motion reference unit", "linear"),
    _named("feed-forward-full", "motion reference unit", "linear"),
    _linear("thesis", "", "the gains that the case has in use", "payload by telemetry", thesis),
    *(
        _linear(
            f"{name}{ending}",
            f"{structure}{needs}",
            f"{what}, {how}",
            f"{heard}; plant and sea of the case when it was designed",
        )
        for name, (structure, what, heard) in _DESIGNED.items()
        for ending, needs, how in _WAYS
    ),
    _named("mpc-clipped", f"{_SEEN}; the sea's spectrum", "filter"),
    _named("mpc", f"{_SEEN}; the sea's spectrum", "predictive"),
    _named("mpc-ar", f"{_SEEN}; nothing of the sea", "predictive"),
    _named("nonlinear-mpc", f"{_SEEN}, its limits and drag; the sea's spectrum", "predictive"),
    _named("mpc-preview", f"{_SEEN}; the hook's motion to come", "reference"),
    Contender(
        name="clairvoyant",
        what="the least that any command within the drive's limits leaves: a floor, no controller",
        knows="everything, the whole record in advance",
        group="floor",
        recipe=None,
    ),
)

CONTENDERS: Mapping[str, Contender] = MappingProxyType({each.name: each for each in _ALL})
"""Every contender by its name."""

# Names that are left out unless they are asked for.  `feedback-no-antiwindup` says only that
# static gains cannot wind up.
LEFT_OUT = ("feedback-no-antiwindup",)

ALL = tuple(name for name in CONTENDERS if name not in LEFT_OUT)
"""Everybody who can do anything in a case."""

DESIGNED = "combined"
"""Who stands for the best design of a case: MPC hears both sensors, and so does its rival."""

DEFAULTS = (
    *("none", "constant-tension", "feed-forward", "feed-forward-full", "thesis", DESIGNED),
    *("mpc-clipped", "mpc", "clairvoyant"),
)
"""Who takes part unless others are named: each kind once."""


def line_up(case: Case, *, every: bool = False, design: object = None) -> list[object]:
    """Return who takes part in a case unless others are named: `DEFAULTS`, or `ALL` if `every`.

    A design that is given stands in for the one that would be looked for.
    """
    names = [n for n in (ALL if every else DEFAULTS) if n != "thesis" or case.gains is not None]
    return [design if n == DESIGNED and design is not None else n for n in names]


def contenders_of(wanted: object) -> tuple[Contender, ...]:
    """Return the contenders meant by names of `CONTENDERS`, or whatever else `recipe_of` takes.

    Raises InputError if there is none, a name is unknown or comes twice, or one is none of these.
    """
    if isinstance(wanted, str) or not isinstance(wanted, Sequence):
        wanted = [wanted]
    found = tuple(_contender(each) for each in wanted)
    if not found:
        raise InputError("compare: at least one controller is wanted, got none")
    names = [each.name for each in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(
            f"compare: controllers must have names that differ, got {twice!r} twice; "
            "give a pair (name, controller)"
        )
    return found


def _contender(wanted: object) -> Contender:
    if isinstance(wanted, str):
        pick("compare", "controller", tuple(CONTENDERS), (wanted,))
        return CONTENDERS[wanted]
    if isinstance(wanted, Design | Tuning):  # `feedback` is one that is designed anew
        wanted = ("design", wanted)
    own = recipe_of(wanted, "compare")
    if own.design is not None:
        return Contender(
            name=own.name,
            what=f"a design that was given: {own.design.status}",
            knows="what it was designed for",
            group="linear",
            recipe=own,
        )
    given = wanted[1] if isinstance(wanted, tuple) else wanted
    what = type(given).__name__
    if own.kind == "factory":
        what = getattr(given, "__qualname__", what)
    return Contender(
        name=own.name, what=f"given: {what}", knows="what it was given", group="own", recipe=own
    )
