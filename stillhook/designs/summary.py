"""Tables and sentences of a design: motion, gains, margins, limits, and what they rest on.

Design -> Tables -> `stillhook.designs.report`
"""

import math
from collections.abc import Mapping, Sequence

from models.basics import digits_apart, residual_text
from models.rig import DCMotor
from models.sensing import SET_POINT
from synth.design import SWITCHING_LOSS, Design, LimitUse, few_starts
from synth.question import HOOK, PAYLOAD, difference_text

from ..text import (
    Bar,
    Table,
    Written,
    columns,
    decibels,
    delay_margin,
    duration,
    largest_in,
    number,
    percent,
    quantity,
    remarks,
    scale,
)
from .bound_text import bound_rows
from .motion import MotionView

#: What people call each limit, and where it stands in the case file.
LIMITS: Mapping[str, tuple[str, str]] = {
    "max_sensitivity": ("sensitivity peak M_s", "limits.max_sensitivity"),
    "gain_margin_up": ("gain margin, up", "limits.gain_margin_up"),
    "gain_margin_down": ("gain margin, down", "limits.gain_margin_down"),
    "delay_margin": ("delay margin", "limits.delay_margin"),
    "low_frequency": ("low frequency", "limits.low_frequency.ratio"),
    "roll_off": ("|L| beyond the rope modes", "limits.roll_off"),
    "motor.torque.peak": ("motor torque, peak", "winch.drive.torque_peak"),
    "motor.torque.continuous": ("motor torque, continuous", "winch.drive.torque_continuous"),
    "motor.speed.peak": ("motor speed, peak", "winch.drive.speed"),
    "motor.voltage.peak": ("motor voltage, peak", "winch.drive.voltage"),
    "motor.current.peak": ("motor current, peak", "winch.drive.current_peak"),
    "motor.current.continuous": ("motor current, continuous", "winch.drive.current_continuous"),
    "motor.torque.breakdown": ("motor torque, breakdown", "winch.drive.torque_continuous"),
    "motor.power.peak": ("motor power, peak", "winch.drive.power"),
    "rope.tension.peak": ("rope tension, largest", "limits.rope_tension_peak"),
    "rope.tension.least": ("rope tension at drum, least", "limits.minimum_tension"),
    "rope.lower_tension.least": ("rope tension at load, least", "limits.minimum_tension"),
}
AT_LEAST = ("gain_margin_up", "delay_margin", "rope.tension.least", "rope.lower_tension.least")
"""Limits whose bound is the least value."""
SHARES: Mapping[str, tuple[str, ...]] = {
    "sea": (HOOK,),
    "MRU": ("mru.error",),
    "noise": (),
    "losses": (SWITCHING_LOSS, SET_POINT),
}
"""Which disturbances make up a share of a signal's variance, by its name; noise is the rest."""
_INSTRUMENTS: Mapping[str, set[str]] = {
    "payload": {"payload"},
    "MRU": {"mru"},
    "load cell": {"rope"},
    "encoder": {"drum", "motor"},
}
"""Instruments by what their signals' names begin with."""
_SIGNALS = {"rope.tension": "rope tension at drum", "rope.lower_tension": "rope tension at load"}
_ROUNDED = 1e-9  # of what a signal reaches: less at rest is nothing
_PRICED = 1e-5  # a price below this share of the payload's rms is noise of the solver


def sea_text(design: Design) -> str:
    """Return the sea that the figures hold for."""
    sea = design.case.sea
    if sea.spectrum == "bretschneider-1975":
        period = f"T_S {quantity(sea.significant_period, 's')}"
    else:
        period = f"T_p {quantity(sea.spectral_peak_period, 's')}"
    text = f"H_s {quantity(design.significant_height, 'm')}, {period}"
    if not design.feasible:
        text += f" (asked for: H_s {quantity(sea.significant_height, 'm')})"
    return f"{text}, {sea.spectrum}"


def about_of(design: Design) -> str:
    """Return the case and its sea, as they stand below the title of a figure."""
    return f"{design.case.name}: {sea_text(design)}"


def motion_table(design: Design) -> Table:
    """Return hook and payload motion, before and after."""
    largest = largest_in(design.case.limits)
    heads = columns(f"motion=; rms [m]; significant height [m]; largest={largest} [m]")
    return Table(columns=heads, rows=MotionView(design).motions())


def effect(design: Design) -> str:
    """Return what the gains do to the payload, in a sentence."""
    if design.margins is None:
        return "no stable loop: the payload's motion has no standard deviation"
    if math.isinf(design.payload_rms_before):
        return f"{residual_text(design.residual)}; with the drum held the payload resonates"
    return residual_text(design.residual, design.residual_held)


def alternatives_table(design: Design) -> Table | None:
    """Return the structures that were tried, what each hears, and why it was not taken."""
    if not design.alternatives:
        return None
    tried = sorted((design, *design.alternatives), key=lambda d: -d.family_rms)
    return Table(
        columns=columns("structure; payload_rms=payload [m]; residual=of the hook's [%]; hears <"),
        rows=[
            (d.structure, d.family_rms, d.family_rms / d.hook_rms, ", ".join(heard(d)))
            for d in tried
        ],
        notes=(
            *(f"{d.structure}: {_why_not(design, d)}" for d in tried if d is not design),
            *unit_notes(tried),
        ),
        broken=tuple(k for k, other in enumerate(tried) if not other.ok),
    )


def unit_notes(designs: Sequence[Design]) -> tuple[str, ...]:
    """Return what of feed-forward hangs on how the reference unit's error is read, if it does."""
    found = []
    for design in designs:
        unit, parts = design.case.sensors.mru, design.shares.get(PAYLOAD, {})
        if design.structure != "feed-forward" or unit is None or not design.ok:
            continue
        if max(unit.noise_floor, unit.noise_fraction) > 0.0 and "mru.error" in parts:
            left = math.sqrt(sum(rms**2 for name, rms in parts.items() if name != "mru.error"))
            found.append(
                f"{design.structure}: hangs on the MRU's error being read as noise in the band of "
                f"the waves; without it these gains leave {quantity(left, 'm')}"
            )
    return tuple(found)


def heard(design: Design) -> tuple[str, ...]:
    """Return the instruments that a structure hears."""
    found = {name.partition(".")[0] for name in design.measurements}
    return tuple(said for said, parts in _INSTRUMENTS.items() if found & parts)


def _why_not(taken: Design, other: Design) -> str:
    """Return why a structure was not taken."""
    if not other.ok:
        return other.status
    if other.family_rms > taken.family_rms:
        return f"{number(other.family_rms / taken.family_rms)} times the motion"
    less = percent(1.0 - other.family_rms / taken.family_rms)
    return f"only {less} less motion for a larger controller"


def member_table(design: Design) -> Table | None:
    """Return what the design does in each member of its family; None without a family."""
    further = [*design.members, *([design.exhibit] if design.exhibit is not None else [])]
    if not further:
        return None
    every = [("the case", design), *(
        (difference_text(design.case, member.case), member) for member in further
    )]  # fmt: skip
    rows = []
    for name, one in every:
        enforced = [use for use in one.limits.values() if use.enforced]
        tightest = max(enforced, key=lambda use: use.use, default=None)
        used = (tightest.use, label_of(one, tightest.name)) if tightest else (None, "")
        peak = None if one.margins is None else one.margins.max_sensitivity
        moves = one.payload_rms if math.isfinite(one.payload_rms) else None
        rows.append((name, moves, one.payload_rms_before, peak, *used))
    heads = "member=; payload_rms=payload [m]; held=drum held [m]; M_s; use [%]; of <"
    small = {
        "worst": "the worst of them",
        "mean": "their root mean square",
        "regret": "the worst, over what gains of its own would reach",
    }[design.objective]
    notes = [f"made small: {small}"] if design.members else []
    if design.exhibit is not None:
        found = (
            "" if design.exhibit.margins is not None else f"; there it is {design.exhibit.status}"
        )
        notes.append(f"the last is told, not asked of a Kelvin-Voigt rope{found}")
    return Table(columns=columns(heads), rows=rows, notes=tuple(notes))


def has_loop(design: Design) -> bool:
    """Return whether there is a loop at all: any gain that is not zero."""
    gains = [value for name, value in design.gains.items() if name != "A"]
    return any(gains) if gains else bool(design.parameters)


def parameter_table(design: Design) -> Table:
    """Return the structure's parameters."""
    rows = [(name, value, design.units.get(name, "")) for name, value in design.parameters.items()]
    notes = [f"{name} is held" for name in design.fixed]
    ends = [name for name in design.at_bounds if name not in design.fixed]
    notes += [f"{name} stands at the end of its range" for name in ends]
    heads = columns("parameter; value [6]; unit=<")
    return Table(columns=heads, rows=rows, notes=tuple(notes))


def command_of(design: Design) -> str:
    """Return what the structure commands, with its unit."""
    motor = design.case.winch.motor
    if isinstance(motor, DCMotor):
        return "armature voltage [V]"
    return "motor speed [rad/s]" if motor.speed_gain else "motor torque [N m]"


def command_text(design: Design) -> str:
    """Return what the structure commands, for payload feedback its law."""
    command = command_of(design)
    if design.structure == "payload-feedback":
        return f"{command} = -A (a P'' + a1 P' + a2 P)"
    names = ", ".join(name.replace(".", " ").replace("_", " ") for name in design.measurements)
    return f"{command} by {names}"


def share_table(design: Design) -> Table | None:
    """Return what sea, reference unit, losses and noise make of signals; None for the sea alone."""
    if all(len(parts) < 2 for parts in design.shares.values()):
        return None
    names = share_names([design])
    heads = columns("signal=share of the variance of" + "".join(f"; {n} [%]" for n in names))
    rows = [
        (_signal(signal), *(share_of(design, n, signal) for n in names)) for signal in design.shares
    ]
    return Table(columns=heads, rows=rows)


def _signal(name: str) -> str:
    return _SIGNALS.get(name, name.replace(".", " ").replace("_", " "))


def share_names(designs: Sequence[Design]) -> tuple[str, ...]:
    """Return the names of `SHARES`; ``losses`` only where there are some."""
    shaken = {name for d in designs for parts in d.shares.values() for name in parts}
    return tuple(n for n in SHARES if n != "losses" or shaken & {*SHARES[n]})


def share_of(design: Design, name: str, signal: str = PAYLOAD) -> float:
    """Return the share of a signal's variance from one of `SHARES`."""
    squares = {source: rms**2 for source, rms in design.shares.get(signal, {}).items()}
    total = sum(squares.values())
    known = [source for names in SHARES.values() for source in names]
    chosen = SHARES[name] or [source for source in squares if source not in known]
    part = sum(squares.get(source, 0.0) for source in chosen)
    return part / total if total > 0.0 else 0.0


def margin_table(design: Design) -> Table | None:
    """Return the margins: what, figure, and the same figure in other words; None without any."""
    margins = design.margins
    if margins is None:
        return None
    smallest = 1.0 / margins.max_sensitivity
    rows = [
        (
            "sensitivity peak M_s",
            number(margins.max_sensitivity),
            f"at {number(margins.peak)} rad/s; L stays {number(smallest)} away from -1",
        ),
        (
            "gain may grow",
            "without bound" if math.isinf(margins.gain) else f"x {number(margins.gain)}",
            "" if math.isinf(margins.gain) else f"by {decibels(margins.gain)}",
        ),
        (
            "gain may fall",
            f"x {number(margins.gain_down)}" if margins.gain_down > 0.0 else "to nothing",
            f"by {decibels(1.0 / margins.gain_down)}: conditionally stable"
            if margins.gain_down > 0.0
            else "",
        ),
    ]
    if math.isinf(margins.phase):
        rows.append(("phase, delay", "without bound", "|L| stays below 1"))
    else:
        rows.append(("phase", f"{number(math.degrees(margins.phase))} deg", ""))
        rows.append(("further delay", delay_margin(margins.delay), ""))
    rows.append(("disk margin", number(margins.disk), "gain and phase together"))
    return remarks("", rows)


def limit_table(design: Design) -> Table:
    """Return the limits, those that bind the design first."""
    uses = sorted(design.limits.values(), key=lambda use: not use.enforced)
    rows = [_limit_row(design, use) for use in uses]
    notes = []
    priced = any(row[4].value for row in rows)
    if priced:
        notes.append("price: what the payload's rms would lose if the bound were 1 % looser")
    if not all(use.enforced for use in uses):
        notes.append("reported: the case asks for the figure only (limits.drive: report)")
    heads = columns(f"limit=; value; bound; use; price={'price' if priced else ''}")
    return Table(columns=heads, rows=rows, notes=tuple(notes))


def expected_table(design: Design) -> Table | None:
    """Return what signals most probably reach with losses that switch; None without a loop."""
    if not has_loop(design) or design.margins is None:
        return None
    plant, limits = design.question.plant, design.case.limits
    time = limits.equivalent_exposure  # as often exceeded as the limits are
    rows = []
    for signal in design.shares:
        unit = "rpm" if signal == "motor.speed" else plant.units[signal]
        up, down = (design.switched.extreme(signal, time, way) for way in (1, -1))
        rest = plant.static.get(signal, 0.0)
        rest = rest if abs(rest) > _ROUNDED * up else 0.0
        figures = rest, design.switched.deviation(signal), rest + up, rest - down
        rows.append((_signal(signal), *(Written(x, quantity(x, unit)) for x in figures)))
    within = duration(limits.exposure_time)
    if not math.isclose(time, limits.exposure_time):
        within += f", exceeded in {percent(limits.exceedance)} of them"
    heads = columns(f"signal=expected in {within}; rest=at rest; rms; largest; least")
    notes = (
        ("limits hold the losses in full: they are on the safe side",)
        if any(plant.loss.values())
        else ()
    )
    return Table(columns=heads, rows=rows, notes=notes)


def label_of(design: Design, name: str) -> str:
    """Return what people call a limit."""
    slow = design.case.limits.low_frequency
    if name == "low_frequency" and slow is not None:
        return f"|P/Z| up to {slow.below:g} rad/s"
    return LIMITS[name][0] if name in LIMITS else name.replace(".", " ").replace("_", " ")


def facts(design: Design, *, bound: bool = True) -> list[tuple[str, str]]:
    """Return what the figures rest on: sea, rope, drag, search, check, and the bound beside them.

    `bound` says whether to compute that too, which takes some ten seconds.
    """
    case = design.case
    if case.rope.lumping == "thesis":
        rope = "one spring with all of the rope's mass at the payload"
    else:
        rope = f"{design.masses} masses along {quantity(case.rope.length, 'm', 4)}"
    for what, stiffness in (("tip", case.crane.tip_stiffness), ("slings", case.rigging.stiffness)):
        if stiffness is not None:
            rope += f", {what} {quantity(stiffness, 'N/m')}"
    if case.rope.falls > 1:
        rope += f", {case.rope.falls} falls: tensions at the drum are those of each"
    if case.payload.fixed_drag is None:
        drag = (
            f"{quantity(design.drag, 'N s/m')}, {quantity(design.drag_before, 'N s/m')} with the "
            "drum held: it follows the payload's speed"
        )
    else:
        drag = f"{quantity(design.drag, 'N s/m')}, fixed by the case"
    rows = [("sea", sea_text(design)), ("rope", rope), ("drag", drag)]
    if design.friction > 0.0:
        friction = quantity(design.friction, "N m s/rad")
        rows.append(("losses", f"as a friction of {friction} at the motor, by its speed"))
    if design.starts:
        agree = f"{design.agreed} of {len(design.starts)} starts agree"
        few = few_starts(design.agreed, len(design.starts))
        rows.append(
            ("search", f"{few}; more starts or another seed may do better" if few else agree)
        )
    if design.verification is not None:
        rows.append(("check", design.verification.status))
    return [*rows, *(bound_rows(design) if bound else ())]


def required_table(design: Design) -> Table | None:
    """Return what each limit that breaks is and would have to be in the sea asked for, if any."""
    if not design.required:
        return None
    rows = []
    for name, value in design.required.items():
        use = design.limits[name]
        digits = digits_apart(value, use.bound)
        needed = _measured(use, value, digits, size=use.bound)
        rows.append((label_of(design, name), _measured(use, use.bound, digits), needed))
    wanted = f"needed in H_s {design.case.sea.significant_height:.3g} m"
    heads = columns(f"limit=limit that breaks; is; needed={wanted}")
    note = f"All figures below are those in H_s {design.significant_height:.3g} m"
    return Table(columns=heads, rows=rows, notes=(note,))


def _limit_row(design: Design, use: LimitUse) -> tuple[str, Written, Written, Bar, Written]:
    sign = "≥" if use.name in AT_LEAST else "≤"
    worth = use.price > _PRICED * design.payload_rms and use.enforced
    price = quantity(use.price, "m", 2) if worth else ""
    remark = (price if use.kept else "broken") if use.enforced else "reported"
    digits = digits_apart(use.value, use.bound)
    return (
        label_of(design, use.name),
        Written(use.value, _measured(use, use.value, digits, size=use.bound)),
        Written(use.bound, f"{sign} {_measured(use, use.bound, digits)}"),
        Bar(use.use, use.kept, use.enforced),
        Written(use.price if worth else None, remark),
    )


def _measured(use: LimitUse, value: float, digits: int, *, size: float | None = None) -> str:
    unit = "rpm" if use.name.startswith("motor.speed") else use.unit
    if use.name.startswith("gain_margin"):
        return "no bound" if math.isinf(value) else f"x {number(value, digits)}"
    if math.isinf(value):
        return "no bound"
    if size is not None and scale(unit, size)[0] > 1e3 * abs(value):
        size = None  # 3 W is not 0.000003 MW
    return quantity(value, unit, digits, size=size)
