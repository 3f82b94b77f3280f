"""The controller structures of a winch, by name.

`structure_named` gives each of them for a case; `synth.design.optimise_gains` optimises it.  How
they are put together is said in `synth.structures.winch_diagram`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from models.basics import InputError, pick
from models.case import Case
from models.plant import PlantData
from models.sensing import SENSORS, aboard

from .blocks import FilterSection, integral, lead_lag, notch, roll_off
from .drum_speed import SteadyMotion
from .low_order import LowOrderFeedback
from .structure import PayloadFeedback
from .winch_diagram import TRANSPARENT, WinchStructure

#: What each structure is, for tables and help texts.
DESCRIPTIONS: Mapping[str, str] = {
    "payload-feedback": "the thesis's three gains on the payload's motion",
    "payload-feedback-rolloff": "... behind a second-order roll-off",
    "payload-feedback-lead": "... behind a first-order lead or lag",
    "payload-feedback-notch": "... behind a notch and a second-order roll-off",
    "payload-feedback-integral": "... with integral action and a second-order roll-off",
    "drum-feedback": "... rolled off, on top of a drum loop",
    "feed-forward": "drum loop that follows the reference unit's heave, gain and lead time",
    "combined": "drum loop, feed-forward of heave, payload feedback rolled off",
    "constant-tension": "drum loop that follows the rope's tension",
    "low-order-4": "a free controller of the payload's motion, of order 4 (or any)",
}
_LOW_ORDER = re.compile(r"low-order-([1-9]\d?)$")
_HIGH_ORDER = re.compile(r"high-order(?:-([1-9]\d?))?$")


def structure_names() -> tuple[str, ...]:
    """Return the names of the structures."""
    return tuple(DESCRIPTIONS)


def structures_aboard(case: Case, names: Sequence[str] = tuple(DESCRIPTIONS)) -> tuple[str, ...]:
    """Return those of some structures whose sensors a case names, in their order."""
    heard = set(aboard(case))
    return tuple(n for n in names if heard.issuperset(structure_named(n, case).measurements))


def structure_aboard(name: str, case: Case) -> PayloadFeedback | WinchStructure | LowOrderFeedback:
    """Return a structure for a case that names all its sensors, see `structure_named`.

    A sensor that a case does not name is not aboard; one without errors has to be named as such,
    as ``sensors.mru: {noise_floor: 0, noise_fraction: 0}``.

    Raises InputError if there is no structure of that name, or a sensor that it hears is not
    aboard.
    """
    structure = structure_named(name, case)
    missing = [heard for heard in structure.measurements if heard not in aboard(case)]
    if missing:
        sensors = " and ".join(dict.fromkeys(f"sensors.{SENSORS[heard]}" for heard in missing))
        raise InputError(
            f"{case.label}: {name} hears {missing[0]}, which is not aboard: add {sensors}, or take "
            f"one of {', '.join(structures_aboard(case))}"
        )
    return structure


def structure_named(name: str, case: Case) -> PayloadFeedback | WinchStructure | LowOrderFeedback:
    """Return a structure for a case, for its motor, drum, rope and gains.

    The name is one of `structure_names`; ``low-order-n`` has any order n from 1 to 99, and
    ``high-order`` hears all that is aboard, with as many states as it takes.

    Raises InputError if there is no structure of that name.
    """
    if (order := _LOW_ORDER.match(name)) is not None:
        return LowOrderFeedback(order=int(order[1]))
    if (order := _HIGH_ORDER.match(name)) is not None:
        return LowOrderFeedback(
            order=int(order[1] or 0), family="high-order", measurements=aboard(case)
        )
    pick("structures", "structure", structure_names(), (name,))
    data = PlantData.from_case(case)
    amplifier = case.gains.A if case.gains is not None else 1.0
    bounds = _bounds(case, amplifier)
    if name == PayloadFeedback.name:
        return PayloadFeedback(amplifier=amplifier, bounds=bounds)
    # The rope's own, also where the design is made on one spring.
    modes = replace(data, lumping="distributed").axial_modes(2)
    feedback = name.removeprefix("payload-feedback") if name.startswith("payload") else None
    corner = (1.0, TRANSPARENT)
    sections: dict[str, tuple[FilterSection, ...]] = {
        "-rolloff": (roll_off("rolloff", corner=corner),),
        "-lead": (lead_lag("lead", zero=(0.05, 100.0), pole=(0.5, 200.0)),),
        "-notch": (
            notch("notch", frequency=(0.5 * modes[1], 2.0 * modes[1])),
            roll_off("rolloff", corner=corner),
        ),
        "-integral": (
            integral("integral", corner=(0.002, 0.5)),
            roll_off("rolloff", corner=corner),
        ),
    }
    payload = name != "feed-forward" and name != "constant-tension"
    return WinchStructure(
        name=name,
        motor=SteadyMotion.of(data),
        amplifier=amplifier,
        pace=float(modes[0]),
        filters=sections["-rolloff" if feedback is None else feedback] if payload else (),
        hears_payload=payload,
        drum=feedback is None,
        heave=name in ("feed-forward", "combined"),
        tension=data.stiffness if name == "constant-tension" else None,
        bounds={} if feedback is None else bounds,
    )


def _bounds(case: Case, amplifier: float) -> dict[str, tuple[float, float]]:
    """Return the bounds of a, a1, a2 that a case states, whose A is in them."""
    if case.gain_bounds is None:
        return {}
    given = {name: getattr(case.gain_bounds, name) for name in ("a", "a1", "a2")}
    return {
        name: (pair[0] / amplifier, pair[1] / amplifier)
        for name, pair in given.items()
        if pair is not None
    }
