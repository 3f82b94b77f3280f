r"""Loops of any controller around a rope of N masses: thousands at once, node by node.

The rope is a recursion from the payload up, x_0 = 1 at the payload: for every mass

    delta <- delta - zeta x,   x <- x + delta,     zeta = -s^2 m h / (EA (1 + tau s))

(piece h, its mass m; `models.plant.rope.lump_rope`), which ends at the drum with Y/P = y and T/P =
f; slings with the hook block below the rope, and a tip that gives above it, are one more step of
the kind each. Both are affine in what the payload itself asks for, M s^2 + C s, so one recursion
serves any mass and drag. Around it stand the winch's own equations, as in `models.plant.line`, and
the command

    u = -(G P + D X + E T) + H Z + N,      X = y P - Z (haul),  T = f P (tension),

of a controller that hears the payload (through its low-passes, holds and delays: G), the drum
(haul and speed: D), the tension (behind the load cell: E) and the hook Z (behind the reference
unit's high-pass and delay: H), all late by the command's own delay; N is what the errors and the
noise of all of these make of the command, and losses that switch. Then

    open = W y + g h e f,    closed = open + h phi (G + D y + E f),
    P closed = (W + h phi (D + H)) Z + h phi N.

Nothing is divided by what may be zero: but for the controller's own poles, which are taken out
(`LawColumns.without_poles`), `open` and `closed` have no poles but stable ones, so the zeros of
`closed` are the loop's poles, and its phase along the imaginary axis counts them
(`synth.sweeps.winding_count`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray, White
from models.plant import RopeLumps
from models.sensing import SAMPLE_TIME

from ..limits import LOWER_TENSION, PAYLOAD
from ..loop import Dual, exp, squared, value_of, where
from .law_rows import LawColumns
from .numbers import BRANCH_GAINS, BRANCH_TIMES, Numbers, at_rest, at_rows, part_of
from .sweep_nodes import SweepNodes

BLOCK = 12_000  # numbers of an array at once: the half dozen in use stay in the cache
VELOCITY, SPEED = "payload.velocity", "motor.speed"

Pair = tuple[str, str]
# Coefficients of y, of f and of 1 in the numerator of an output over `closed`; None for zero.
Numerator = tuple[Any, Any, Any]
_PAYLOAD = ("acceleration", "velocity", "displacement")
_UNIT = float(White(1.0).density(1.0))  # of white noise of intensity one, a rad/s


@dataclass(frozen=True, kw_only=True, eq=False)
class Shaken:
    """What shakes loops, on the nodes where variances are taken."""

    factors: FloatArray  #: Factor on the density of the hook's motion of each loop, (n,) or (1,).
    #: Density over factor of each loop at the nodes, (n, k); None if all have the common one.
    ratios: FloatArray | None
    heave_rms: FloatArray  #: Standard deviation of each hook's heave [m], (n,) or (1,).
    noisy: bool  #: Whether sensors have noise and errors, or losses switch.
    #: Density at the nodes of what losses that switch are besides friction, over their square
    #: (`models.sensing.SwitchingShape`), (n, k) or (1, k) [s/rad]; None without.
    switching: Any = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ChainLoops:
    """Closed loops of a controller around a lumped rope, delays and low-passes exact."""

    count: int  #: How many, n.
    numbers: Numbers  #: Their plants, as of `synth.sweeps.numbers.columns_of`.
    law: LawColumns  #: The controller.
    drag: FloatArray  #: Linear drag coefficient of each, (n,) or (1,) [N s/m].
    lumps: RopeLumps  #: How the rope is lumped.

    def __len__(self) -> int:
        return self.count

    @property
    def mode_spacing(self) -> FloatArray:
        """Distance of the rope's higher modes, pi c / L, (n,) or (1,) [rad/s]."""
        rope = np.maximum(self.numbers["rope_mass"], 1e-12)
        return np.asarray(np.pi * np.sqrt(self.numbers["stiffness"] / rope))

    @property
    def masses(self) -> int:
        """Masses along the rope."""
        return len(self.lumps.masses)

    def part(self, index: IndexArray) -> ChainLoops:
        """Return some of the loops."""
        return replace(
            self,
            count=len(index),
            numbers={name: part_of(column, index) for name, column in self.numbers.items()},
            law=self.law.part(index),
            drag=part_of(self.drag, index),
        )

    def with_drag(self, drag: FloatArray, friction: FloatArray | None = None) -> ChainLoops:
        """Return the loops with other drag [N s/m] and friction of losses [N m s/rad]."""
        numbers = self.numbers if friction is None else {**self.numbers, "friction": friction}
        return replace(self, drag=drag, numbers=numbers)

    def responses(self, rows: IndexArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return closed and open characteristic functions of some loops, (m, k) each.

        Points s are (m, k) or (k,) [1/s].
        """
        step = max(1, BLOCK // s.shape[-1])
        if s.ndim == 1 and rows.size > step:
            parts = [self.responses(rows[k : k + step], s) for k in range(0, rows.size, step)]
            closed, free = (np.concatenate(column) for column in zip(*parts, strict=True))
            return closed, free
        chain = Chain(self, rows, s)
        y, f = chain.ends(at_rows(self.drag, rows))
        return self._regular(rows, s, chain.closed(y, f), chain.W * y + chain.pull * f)

    def of_drag(self, rows: IndexArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return c0 and c1 of the closed characteristic function c0 + C c1, (m, k) each."""
        return self._regular(rows, s, *Chain(self, rows, s).closed_of_drag())

    def _regular(
        self, rows: IndexArray, s: ComplexArray, one: ComplexArray, other: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return two functions without the controllers' poles, (m, k) each."""
        factor, shape = self.law.without_poles(rows, s), (rows.size, s.shape[-1])
        return np.broadcast_to(one * factor, shape), np.broadcast_to(other * factor, shape)


class Chain:
    """What responses of some loops are made of; the module's docstring has the letters.

    All are (1 or m, 1 or k).  y and f are without a force at the payload and per unit of it; the
    force is `per_mass` times the mass there, and `per_drag` times the drag.  `rows` are which of
    the loops, (m,); points s are (m, k) or (k,) [1/s].
    """

    def __init__(self, loops: ChainLoops, rows: IndexArray, s: ComplexArray) -> None:
        self.loops, self.rows = loops, rows
        self.s = s = np.atleast_2d(s)
        h, phi = self._own("haul"), self._own("phi")
        self._inertial = self._own("inertia") * (s * s) + self._own("viscous_friction") * s
        self._back = self._own("beta") * s
        e = 1.0 + s * self._own("lag")
        # Losses act on the shaft; signals of the drive are told without what they take.
        self.friction = self._own("friction")
        if isinstance(self.friction, Dual) or np.any(self.friction):
            self._back = self._back + self.friction * s * e
        self.W = self._inertial * e + self._back
        self.pull = (self._own("load") * h) * e
        self.drive = h * phi
        heard = self._heard = loops.law.response(rows, s)
        delay = self._own("command_delay")
        if np.any(value_of(delay)) or isinstance(delay, Dual):
            heard = self._heard = {name: row * late(s, delay) for name, row in heard.items()}
        zero = np.zeros((1, 1))
        self.D = -(heard.get("drum.haul", zero) + heard.get("motor.speed", zero) * s / h)
        self.E = -heard.get("rope.tension", zero) * self._load_cell() / self._own("falls")
        self.G, self.H = -self._payload(), self._hook()
        self._of_y, self._of_f = self.W + self.drive * self.D, self.pull + self.drive * self.E
        self._white: Any = None
        self._rope()

    def _own(self, name: str) -> Any:
        return at_rows(self.loops.numbers[name], self.rows)

    def _rope(self) -> None:
        """Set y and f.

        The unit of the payload's force F is the stretch of the piece of rope above it, F
        piece/spring.  A chain of n like pieces is a power of one matrix, whose entries are b =
        sinh(n mu)/sinh(mu) and c, from q = 4 sinh^2(mu/2).
        """
        s, springs, masses = self.s, self.loops.lumps.springs, self.loops.lumps.masses
        ratio = self._own("slow") + s * self._own("damping_time")
        for gain, time in zip(BRANCH_GAINS, BRANCH_TIMES, strict=True):
            if np.any(value_of(self.loops.numbers[gain])):
                x = s * self._own(time)
                ratio = ratio + self._own(gain) * (x / (1.0 + x))
        spring = self._own("stiffness") * ratio
        rope = self._own("rope_mass")
        if masses.size == 1:  # the unit is F/spring
            one = np.ones((1, 1))
            self._y, self._f, unit = (one, springs[0] * one), (0.0 * one, spring), 1.0 / spring
        else:
            piece = springs[-1]
            z = rope * (s * s) / spring
            q = z * (piece * masses[0])
            b = c = 0.0 * q
            for _ in range(masses.size - 2):
                c = c + b
                b = b + (1.0 + q * c)
            delta = q * b
            x = 1.0 + q * c + delta, 1.0 + q * c + delta + b
            inner = masses[0] * z
            force = delta / piece + inner * x[0], (delta + 1.0 + q * c) / piece + inner * x[1]
            self._y = x[0] + springs[0] * force[0], x[1] + springs[0] * force[1]
            self._f, unit = (force[0] * spring, force[1] * spring), piece / spring
        below = self._own("block_mass") + rope * masses[-1]  # what is in the rope's last mass
        slings = self._own("sling_stiffness")
        load = self._own("payload_mass")
        if _somewhere(slings):
            # The payload's force stretches them, and moves the mass above them.
            inertial = s * s * unit * below
            share = 1.0 / (slings * unit)
            self._y, self._f = (
                (end[0] + inertial * end[1], share * end[0] + (1.0 + share * inertial) * end[1])
                for end in (self._y, self._f)
            )
            self._at_rest = s * s * unit * load
        else:
            self._at_rest = s * s * unit * (load + below)
        self._per_drag = s * unit
        tip = self._own("tip_stiffness")
        if _somewhere(tip):
            give = 1.0 / tip
            time = self._own("damping_time")
            if np.any(value_of(time)):
                # With a Kelvin-Voigt piece it is one such spring, as `models.plant.rope.Link` says.
                piece = self._own("stiffness") / springs[0]
                c = piece / tip
                give = (1.0 + c) / (piece * (1.0 + s * time / (1.0 + c))) - 1.0 / (
                    piece * (1.0 + s * time)
                )
            self._y = self._y[0] + give * self._f[0], self._y[1] + give * self._f[1]

    def _payload(self) -> Any:
        """Return what the payload's motion makes of the command."""
        s, gain = self.s, np.zeros((1, 1))
        for name in _PAYLOAD:
            row = self._heard.get(f"payload.{name}", 0.0) * self._held(name)
            gain = gain * s + row * late(s, self._own(f"{name}_latency"))
        return gain * self._passed * late(s, self._own("delay"))

    @cached_property
    def _passed(self) -> Any:
        """Return what the low-passes of sensor and link make of a payload signal."""
        passed: Any = 1.0
        for name in ("sensor_bandwidth", "telemetry_bandwidth"):
            bandwidth = self._own(name)
            if _there(bandwidth):
                b = self.s / bandwidth
                passed = passed / (1.0 + np.sqrt(2.0) * b + b * b)
        return passed

    def _held(self, name: str) -> Any:
        """Return what holding its readings makes of a payload signal."""
        rate = self._own(f"{name}_rate")
        if not _there(rate):
            return 1.0
        turn = 2.0 * np.pi * self.s / rate
        return (1.0 - exp(-turn)) / turn

    def _load_cell(self) -> Any:
        bandwidth = self._own("cell_bandwidth")
        return bandwidth / (self.s + bandwidth) if _there(bandwidth) else 1.0

    def _hook(self) -> Any:
        """Return what the hook's motion makes of the command."""
        gain, s, period = self._follows(), self.s, self._own("mru_period")
        if _there(period):
            w = 2.0 * np.pi / period
            gain = gain * (s * s / (s * s + np.sqrt(2.0) * w * s + w * w))
        delay = self._own("mru_delay")
        return gain * late(s, delay) if _there(delay) else gain

    def _follows(self) -> Any:
        """Return what the heave that is shown makes of the command, its rate with it."""
        heave, rate = (self._heard.get(f"mru.{name}", 0.0) for name in ("heave", "heave_rate"))
        follows = {"mru.heave", "mru.heave_rate"} & self._heard.keys()
        return heave + self.s * rate if follows else np.zeros((1, 1))

    def noise(self, shaken: Shaken) -> Any:
        """Return the density of the command that errors and noise of sensors, and losses, make."""
        if self._white is None:
            self._white = self._noise(shaken)
        return self._white

    def _noise(self, shaken: Shaken) -> Any:
        total: Any = np.zeros((1, 1))
        if shaken.switching is not None:
            # A torque over what a command makes of it; see `models.sensing.switching`.
            torque = at_rows(at_rest(self.loops.numbers)[1]["motor.torque"], self.rows)
            command, turn = torque / self._own("phi"), self.s.imag * self._own("lag")
            own = part_of(shaken.switching, self.rows)
            total = total + own * (command * command * (1.0 + turn * turn))
        passes = self._own("noise_passes")
        for name in _PAYLOAD:
            # An amplitude density a root hertz is white noise of half its square.
            size = abs2(self._heard.get(f"payload.{name}", 0.0) * self._held(name))
            if not _there(self._own(f"{name}_rate")) and np.any(value_of(passes)):
                size = size * abs2(self._passed)
            total = total + size * (0.5 * _UNIT * abs2(self._own(f"{name}_noise")))
        share = self._own("cell_noise")
        if _there(share):
            size = abs2(self._heard.get("rope.tension", 0.0))
            cell = share * self._own("static_tension")
            total = total + size * (SAMPLE_TIME * _UNIT * (cell * cell))
        floor, w = self._own("mru_floor"), self._own("mru_bandwidth")
        if _there(floor):
            error = self._own("mru_fraction") * at_rows(shaken.heave_rms, self.rows)
            error = where(value_of(error) > value_of(floor), error, floor)
            white, output = self._own("mru_noise"), self._own("mru_output")
            drift, slow = self._own("mru_drift"), 2.0 * np.pi / self._own("mru_drift_period")
            errors = (
                (error * error, w),
                (drift * drift, slow),
                (white * white * output * (0.25 / np.sqrt(2.0)), output),
            )
            for variance, corner in errors:
                if np.any(value_of(variance)):
                    fourth = corner * corner * corner * corner
                    shape = 2.0 * np.sqrt(2.0) / np.pi * (fourth / corner)
                    shape = shape / (self.s.imag**4 + fourth)
                    total = total + abs2(self._follows()) * (variance * shape)
        return total

    @cached_property
    def coherent(self) -> Any:
        """What gain and phase error of the reference unit make of the command, over the heave."""
        gain, phase = self._own("mru_gain"), self._own("mru_phase")
        share = gain * gain + phase * phase
        if not _there(share) or not np.any(value_of(share)):
            return None
        return abs2(self.H) * share

    def ends(self, drag: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return y and f with a drag, (1 or m, 1) [N s/m]."""
        force = self._at_rest + self._per_drag * drag
        return self._y[0] + force * self._y[1], self._f[0] + force * self._f[1]

    def closed(self, y: ComplexArray, f: ComplexArray) -> Any:
        """Return the closed characteristic function."""
        return self._of_y * y + self._of_f * f + self.drive * self.G

    def closed_of_drag(self) -> tuple[ComplexArray, ComplexArray]:
        """Return c0 and c1 of the closed characteristic function c0 + C c1."""
        slope = self._of_y * self._y[1] + self._of_f * self._f[1]
        return self.closed(*self.ends(np.zeros((1, 1)))), self._per_drag * slope

    def moments(
        self, outputs: Iterable[str], nodes: SweepNodes, shaken: Shaken, drag: FloatArray
    ) -> dict[str, FloatArray]:
        """Return variances of outputs, then of their rates, by all rules, (m, 2 rules) each.

        `s` is of the nodes; the loops' drag coefficients are (m,) [N s/m].
        """
        y, f = self.ends(drag[:, None])
        inverse = 1.0 / abs2(self.closed(y, f))
        right = _both(nodes.sea if shaken.ratios is None else nodes.weights, nodes.omega)
        heave = inverse if shaken.ratios is None else inverse * part_of(shaken.ratios, self.rows)
        factors = at_rows(shaken.factors, self.rows)
        hung = (self._own("payload_mass") * self.s + drag[:, None]) * self.s
        sources = [(heave, right, factors, self._of_heave())]
        if shaken.noisy:
            white = inverse * self.noise(shaken)
            right = _both(nodes.weights, nodes.omega)
            sources.append((white, right, np.ones((1, 1)), self._of_noise()))
            if self.coherent is not None:
                density, right, factors, _ = sources[0]
                sources.append((density * self.coherent, right, factors, self._of_noise()))
        found = {}
        for name in outputs:
            own, times = (PAYLOAD, abs2(hung)) if name == LOWER_TENSION else (name, 1.0)
            parts = [
                ((abs2(_sum_of(numerators[own], y, f)) * (times * density)) @ weights) * factor
                for density, weights, factor, numerators in sources
            ]
            found[name] = sum(parts[1:], start=parts[0])
        return found

    def products(
        self, pairs: Iterable[Pair], nodes: SweepNodes, shaken: Shaken, drag: FloatArray
    ) -> list[FloatArray]:
        """Return covariances of pairs of outputs, then of their rates, and what signs add to them.

        Of each pair (m, 3, 2), by the rule that counts: the covariance, with gain and phase error
        as the mean over their signs, and what positive signs of gain and of phase error add.
        Parameters are those of `moments`.
        """
        y, f = self.ends(drag[:, None])
        inverse = 1.0 / abs2(self.closed(y, f))
        heave = inverse if shaken.ratios is None else inverse * part_of(shaken.ratios, self.rows)
        heave = heave * at_rows(shaken.factors, self.rows)
        sea = nodes.sea[:1] if shaken.ratios is None else nodes.weights[:1]
        of_sea, flat = _both(sea, nodes.omega), _both(nodes.weights[:1], nodes.omega)
        hung = (self._own("payload_mass") * self.s + drag[:, None]) * self.s
        numerators = self._of_heave(), self._of_noise()

        @cache
        def shown(kind: int, name: str) -> Any:
            own, times = (PAYLOAD, hung) if name == LOWER_TENSION else (name, 1.0)
            return _sum_of(numerators[kind][own], y, f) * times

        share = 0.0 if self.coherent is None else self.coherent
        noise = inverse * self.noise(shaken) if shaken.noisy else 0.0 * inverse
        shares = [self._own(name) * k for name, k in (("mru_gain", 1.0), ("mru_phase", 1j))]
        found = []
        for one, other in pairs:
            a, b = ([shown(kind, name) for name in (one, other)] for kind in (0, 1))
            driven = (b[0].conj() * b[1]).real
            mean = ((a[0].conj() * a[1]).real + driven * share) * heave @ of_sea
            mean = mean + (driven * noise) @ flat
            parts = [mean]
            for e in shares if self.coherent is not None else ():
                crossed = a[0].conj() * b[1] + a[1].conj() * b[0]
                parts.append((crossed * (self.H * e)).real * heave @ of_sea)
            parts += [0.0 * mean] * (3 - len(parts))
            found.append(np.stack(np.broadcast_arrays(*parts), axis=1))
        return found

    def motion(self, nodes: SweepNodes, shaken: Shaken) -> Motion:
        """Return what drag and friction of losses make of two velocities; without such friction.

        `closed` is affine in each of C and b, and so are the numerators: no response is evaluated
        anew for others.
        """
        (fixed, slope), turn = self.closed_of_drag(), self.s * (1.0 + self.s * self._own("lag"))
        moved = self._per_drag * self._y[1], self._per_drag * self._f[1]
        y, f = self.ends(np.zeros((1, 1)))
        heave: Any = nodes.sea[0]
        if shaken.ratios is not None:
            heave = part_of(shaken.ratios, self.rows) * nodes.weights[0]
        heave = heave * at_rows(shaken.factors, self.rows)
        sources = [(heave, self._of_heave(), self.s * turn)]
        if shaken.noisy:
            white = self.noise(shaken) * nodes.weights[0]
            if self.coherent is not None:
                white = white + self.coherent * heave
            sources.append((white, self._of_noise(), np.zeros((1, 1))))
        count = self.rows.size
        closed = np.empty((count, 4, 2, len(nodes)))
        for j, part in enumerate((fixed, slope, turn * y, turn * moved[0])):
            closed[:, j, 0], closed[:, j, 1] = part.real, part.imag
        driven = np.zeros((count, 6, len(nodes)))
        for density, numerators, per_friction in sources:
            speed = numerators[SPEED]
            pairs = (
                (numerators[VELOCITY][2], per_friction),
                (_sum_of(speed, y, f), _sum_of((*speed[:2], None), *moved)),
            )
            for j, (one, other) in enumerate(pairs):
                cross = 2.0 * (one.real * other.real + one.imag * other.imag)
                for k, part in enumerate((abs2(one), cross, abs2(other))):
                    driven[:, 3 * j + k] += part * density
        return Motion(closed.reshape(count, 4, -1), driven)

    def _of_heave(self) -> Mapping[str, Numerator]:
        """Return the numerators of outputs over `closed`, for the hook's heave."""
        phi, shaft, W, H = self._own("phi"), self._inertial, self.W, self.H
        load, asks = self._own("load"), self.D + self.H
        turn = phi * H, -(phi * self.E + self.pull / self._own("haul")), -phi * self.G
        pulls = load * (self._back + self.drive * asks) - phi * shaft * self.E
        return self._numerators(
            payload=W + self.drive * asks,
            turn=turn,
            torque=(phi * shaft * H, pulls, -phi * shaft * self.G),
            command=(W * H, self.pull * asks - W * self.E, -W * self.G),
        )

    def with_friction(self, friction: FloatArray) -> Chain:
        """Return the same loops with other friction of losses, (m,) [N m s/rad]."""
        found, lag = copy(self), 1.0 + self.s * self._own("lag")
        found.friction = friction[:, None]
        found._back = self._own("beta") * self.s + found.friction * self.s * lag
        found.W = self._inertial * lag + found._back
        found._of_y = found.W + self.drive * self.D
        return found

    def _of_noise(self) -> Mapping[str, Numerator]:
        """Return the numerators of outputs over `closed`, for noise on the command."""
        phi = self._own("phi")
        return self._numerators(
            payload=self.drive + 0.0 * self.s,
            turn=(phi + 0.0 * self.s, None, None),
            torque=(phi * self._inertial, self._own("load") * self.drive, None),
            command=(self.W, self.pull, None),
        )

    def _numerators(
        self, *, payload: ComplexArray, turn: Numerator, torque: Numerator, command: Numerator
    ) -> Mapping[str, Numerator]:
        voltage = command
        if isinstance(self.friction, Dual) or np.any(self.friction):
            taken = self._own("resistance") / self._own("torque_constant") * self.friction
            pairs = zip(command, _times(-taken * self.s, turn), strict=True)
            a, b, c = (x if y is None else y if x is None else x + y for x, y in pairs)
            voltage = a, b, c
        return {
            "payload.displacement": (None, None, payload),
            VELOCITY: (None, None, self.s * payload),
            "drum.haul": _times(self._own("haul"), turn),
            "motor.speed": _times(self.s, turn),
            "motor.torque": torque,
            "motor.current": _times(1.0 / self._own("torque_constant"), torque),
            "drive.command": command,
            "motor.voltage": voltage,
            "rope.tension": (None, self._own("reeved") * payload, None),
        }


class Motion:
    """Variances of the payload's velocity and the motor's speed of m loops, by drag and friction.

    `closed`, (m, 4, 2 k), are the real and the imaginary parts of what stands at 1, C, b and b C
    in the closed characteristic function; `driven`, (m, 6, k), the numerators' squares times
    densities and weights, of the velocity at 1, b and b^2, then of the speed at 1, C and C^2.
    """

    def __init__(self, closed: FloatArray, driven: FloatArray) -> None:
        self._closed, self._driven = closed, driven

    def variances(self, held: FloatArray, rows: IndexArray | slice) -> FloatArray:
        """Return both of some rows, (m, 2), with their C [N s/m] and b [N m s/rad], (m, 2)."""
        closed, driven, (C, b) = self._closed[rows], self._driven[rows], held.T
        size = (np.stack([np.ones_like(C), C, b, b * C], axis=1)[:, None] @ closed)[:, 0]
        np.multiply(size, size, out=size)
        half = driven.shape[2]
        size = size[:, :half] + size[:, half:]
        np.reciprocal(size, out=size)
        sums = (driven @ size[:, :, None]).reshape(-1, 2, 3)
        other = held[:, ::-1]
        return np.asarray(sums[..., 0] + other * (sums[..., 1] + other * sums[..., 2]))


def late(s: ComplexArray, delay: Any) -> Any:
    """Return exp(-s delay); real arithmetic where s is on the imaginary axis."""
    if isinstance(delay, Dual):
        return exp(-s * delay)
    if not np.any(delay):
        return 1.0
    turn = s.imag * delay
    found = np.empty(turn.shape, dtype=np.complex128)
    np.cos(turn, out=found.real)
    np.sin(-turn, out=found.imag)
    return found * np.exp(-s.real * delay) if np.any(s.real) else found


def abs2(values: Any) -> Any:
    """Return |values|^2."""
    if isinstance(values, Dual):
        return squared(values)
    return values.real**2 + values.imag**2


def _there(column: Any) -> bool:
    """Return whether all plants have a number: a sensor, or a bandwidth that matters."""
    return bool(np.all(np.isfinite(value_of(column))))


def _somewhere(column: Any) -> bool:
    """Return whether any plant has a number: something that gives."""
    return bool(np.any(np.isfinite(value_of(column))))


def _times(factor: Any, terms: Numerator) -> Numerator:
    a, b, c = (None if t is None else factor * t for t in terms)
    return a, b, c


def _sum_of(terms: Numerator, y: Any, f: Any) -> Any:
    """Return a y + b f + c, each if it is there."""
    pairs = zip(terms, (y, f, None), strict=True)
    parts = [t if x is None else t * x for t, x in pairs if t is not None]
    return sum(parts[1:], start=parts[0])


def _both(weights: FloatArray, omega: FloatArray) -> FloatArray:
    """Return weights of the moments of order 0 and 2 by all rules, (k, 2 rules)."""
    return np.concatenate([weights, weights * omega**2]).T.copy()
