r"""Loops of any controller around a rope of N masses: thousands at once, node by node.

The rope is a recursion from the payload up, x_0 = 1 at the payload: for every mass

    delta <- delta - zeta x,   x <- x + delta,     zeta = -s^2 m h / (EA (1 + tau s))

(piece h, its mass m; `models.plant.rope.lump_rope`), which ends at the drum with Y/P = y and T/P =
f. Both are affine in what the payload itself asks for, D = M s^2 + C s, so one recursion serves any
mass and drag. Around it stand the winch's own equations, as in `models.plant.line`, and the command

    u = -(G P + D X + E T) + H Z + N,      X = y P - Z (haul),  T = f P (tension),

of a controller that hears the payload (through its low-passes and delay: G), the drum (haul and
speed: D), the tension (behind the load cell: E) and the hook Z (behind the reference unit's
high-pass and delay: H); N is what the errors and the noise of all of these make of the command.
Then

    open = W y + g h e f,    closed = open + h phi (G + D y + E f),
    P closed = (W + h phi (D + H)) Z + h phi N.

Nothing is divided by what may be zero: but for the controller's own poles, which are taken out
(`LawColumns.without_poles`), `open` and `closed` have no poles but stable ones, so the zeros of
`closed` are the loop's poles, and its phase along the imaginary axis counts them
(`synth.sweeps.winding_count`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray, White
from models.plant import RopeLumps
from models.sensing import SAMPLE_TIME

from .law_rows import LawColumns
from .numbers import PlantNumbers, at_rows
from .sweep_nodes import SweepNodes

BLOCK = 12_000  # numbers of an array at once: the half dozen in use stay in the cache
VELOCITY = "payload.velocity"

# Coefficients of y, of f and of 1 in the numerator of an output over `closed`; None for zero.
Numerator = tuple[Any, Any, Any]
_PAYLOAD = ("acceleration", "velocity", "displacement")


@dataclass(frozen=True, kw_only=True, eq=False)
class Shaken:
    """What shakes loops, on the nodes where variances are taken.

    Attributes
    ----------
    factors
        Factor on the density of the hook's motion of each loop, (n,) or (1,).
    ratios
        Density over factor of each loop at the nodes, (n, k); None if all have the common one.
    heave_rms
        Standard deviation of each hook's heave [m], (n,) or (1,).
    noisy
        Whether sensors have noise and errors.
    """

    factors: FloatArray
    ratios: FloatArray | None
    heave_rms: FloatArray
    noisy: bool

    def part(self, index: IndexArray) -> Shaken:
        """Return that of some loops."""

        def some(column: FloatArray) -> FloatArray:
            return column[index] if len(column) > 1 else column

        ratios = None if self.ratios is None else self.ratios[index]
        return Shaken(
            factors=some(self.factors),
            ratios=ratios,
            heave_rms=some(self.heave_rms),
            noisy=self.noisy,
        )


class ChainLoops:
    """Closed loops of a controller around a lumped rope, delays and low-passes exact.

    Parameters
    ----------
    plants
        The plants.
    law
        The controller.
    drag
        Linear drag coefficient of each, (n,) or (1,) [N s/m].
    lumps
        How the rope is lumped.
    """

    def __init__(
        self, plants: PlantNumbers, law: LawColumns, drag: FloatArray, *, lumps: RopeLumps
    ) -> None:
        n = plants
        self._count = max(len(plants), drag.size, *(v.size for v in law.values))
        self.numbers, self.law = plants, law
        self._lumps = lumps
        self.drag = drag
        self._tau = n.damping_time
        self._stiffness = n["axial_stiffness"] / n["rope_length"]
        self._rope = n.rope_mass
        self._mass = n["payload_mass"]
        self._h = n["drum_radius"] / n["gear_ratio"]
        self._load = n.gear_factor * self._h
        self._inertia, self._friction = n["inertia"], n["viscous_friction"]
        self._phi, self._beta, self._lag = n.drive
        self._low_passes = [
            n[name]
            for name in ("sensor_bandwidth", "telemetry_bandwidth")
            if np.all(np.isfinite(n[name]))
        ]

    def __len__(self) -> int:
        return self._count

    @property
    def mode_spacing(self) -> FloatArray:
        """Distance of the rope's higher modes, pi c / L, (n,) or (1,) [rad/s]."""
        return np.pi * np.sqrt(self._stiffness / np.maximum(self._rope, 1e-12))

    @property
    def masses(self) -> int:
        """Masses along the rope."""
        return len(self._lumps.masses)

    @property
    def swiftest(self) -> float:
        """Size of the largest of the controllers' poles [1/s]."""
        return float(np.abs(self.law.poles).max(initial=0.0))

    def with_drag(self, drag: FloatArray) -> ChainLoops:
        """Return the loops with other drag [N s/m]."""
        other = object.__new__(ChainLoops)
        other.__dict__.update(self.__dict__)
        other.drag = drag
        return other

    def responses(self, rows: IndexArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return closed and open characteristic functions of some loops, (m, k) each.

        Parameters
        ----------
        rows
            Which loops, (m,).
        s
            Points [1/s], (m, k) or (k,).
        """
        step = max(1, BLOCK // s.shape[-1])
        if s.ndim == 1 and rows.size > step:
            parts = [self.responses(rows[k : k + step], s) for k in range(0, rows.size, step)]
            closed, free = (np.concatenate(column) for column in zip(*parts, strict=True))
            return closed, free
        chain = self.chain(rows, s)
        y, f = chain.ends(at_rows(self.drag, rows))
        free = chain.W * y + chain.pull * f
        heard = (chain.D * y + chain.E * f + chain.G) * chain.drive
        factor = self.law.without_poles(rows, s)
        shape = rows.size, s.shape[-1]
        whole = (np.broadcast_to(f, shape) for f in ((free + heard) * factor, free * factor))
        closed, free = (np.asarray(f) for f in whole)
        return closed, free

    def of_drag(self, rows: IndexArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return c0 and c1 of the closed characteristic function c0 + C c1, (m, k) each."""
        chain = self.chain(rows, s)
        factor = self.law.without_poles(rows, s)
        shape = rows.size, s.shape[-1]
        fixed, slope = (np.broadcast_to(c * factor, shape) for c in chain.closed_of_drag())
        return np.asarray(fixed), np.asarray(slope)

    def chain(self, rows: IndexArray, s: ComplexArray) -> Chain:
        """Return what the responses of some loops are made of; s as in `responses`."""
        s = np.atleast_2d(s)

        def own(column: FloatArray) -> FloatArray:
            return at_rows(column, rows)

        h, phi, load = own(self._h), own(self._phi), own(self._load)
        e = 1.0 + s * own(self._lag)
        shaft = own(self._inertia) * (s * s) + own(self._friction) * s
        back = own(self._beta) * s
        heard = self.law.response(rows, s)
        sensors = {name: own(column) for name, column in self.numbers.sensors.items()}
        spring = own(self._stiffness) * (1.0 + s * own(self._tau))
        ends = self._rope_ends(own(self._rope), spring, s)
        zero = np.zeros((1, 1))
        cell: Any = 1.0
        if "rope.tension" in heard and np.all(np.isfinite(sensors["cell_bandwidth"])):
            cell = sensors["cell_bandwidth"] / (s + sensors["cell_bandwidth"])
        return Chain(
            s=s,
            y=(ends[0], ends[1]),
            f=(ends[2], ends[3]),
            per_mass=s * s * ends[4],
            per_drag=s * ends[4],
            mass=own(self._mass) + own(self._rope) * self._lumps.masses[-1],
            h=h,
            phi=phi,
            load=load,
            e=e,
            shaft=shaft,
            back=back,
            W=shaft * e + back,
            pull=(load * h) * e,
            drive=h * phi,
            G=-self._payload(rows, heard, s),
            D=-(heard.get("drum.haul", zero) + heard.get("motor.speed", zero) * s / h),
            E=-heard.get("rope.tension", zero) * cell,
            H=self._hook(heard, sensors, s),
            heard=heard,
            per_current=own(self.numbers["torque_constant"]),
        )

    def _rope_ends(self, rope: FloatArray, spring: ComplexArray, s: ComplexArray) -> Any:
        """Return y and f at the drum, each without a force at the payload and per unit of it.

        The unit is the stretch d of the piece of rope above the payload: with the payload's force
        F, d = F piece/spring; the fifth number returned.  A chain of n like pieces is a power of
        one matrix, whose entries are b = sinh(n mu)/sinh(mu) and c, from q = 4 sinh^2(mu/2).
        """
        springs, masses = self._lumps.springs, self._lumps.masses
        if self.masses == 1:  # the unit is F/spring
            one = np.ones((1, 1))
            return one, springs[0] * one, 0.0 * one, spring, 1.0 / spring
        piece = springs[-1]
        z = rope * (s * s) / spring
        q = z * (piece * masses[0])
        b, c = np.zeros_like(q), np.zeros_like(q)
        step = np.empty_like(q)
        for _ in range(self.masses - 2):
            c += b
            np.multiply(q, c, out=step)
            step += 1.0
            b += step
        delta = q * b
        x0 = 1.0 + q * c + delta
        x1, delta1 = x0 + b, delta + 1.0 + q * c
        inner = masses[0] * z
        force0 = delta / piece + inner * x0
        force1 = delta1 / piece + inner * x1
        y0, y1 = x0 + springs[0] * force0, x1 + springs[0] * force1
        return y0, y1, force0 * spring, force1 * spring, piece / spring

    def _payload(self, rows: IndexArray, heard: Mapping[str, Any], s: ComplexArray) -> Any:
        """Return what the payload's motion makes of the command."""
        gain: Any = np.zeros((1, 1))
        for power, name in zip((2, 1, 0), _PAYLOAD, strict=True):
            if f"payload.{name}" in heard:
                gain = gain + heard[f"payload.{name}"] * s**power
        for bandwidth in self._low_passes:
            b = s / at_rows(bandwidth, rows)
            gain = gain / (1.0 + np.sqrt(2.0) * b + b * b)
        return gain * late(s, at_rows(self.numbers["delay"], rows))

    def _hook(
        self, heard: Mapping[str, Any], sensors: Mapping[str, FloatArray], s: ComplexArray
    ) -> Any:
        """Return what the hook's motion makes of the command."""
        if "mru.heave" not in heard:
            return np.zeros((1, 1))
        gain = heard["mru.heave"] + s * heard["mru.heave_rate"]
        if np.all(np.isfinite(sensors["mru_period"])):
            w = 2.0 * np.pi / sensors["mru_period"]
            gain = gain * (s * s / (s * s + np.sqrt(2.0) * w * s + w * w))
        return gain * late(s, np.nan_to_num(sensors["mru_delay"]))

    def noise(self, rows: IndexArray, chain: Chain, shaken: Shaken) -> FloatArray:
        """Return the density of what errors and noise of the sensors make of the command."""
        sensors = {name: at_rows(c, rows) for name, c in self.numbers.sensors.items()}
        total: Any = np.zeros((1, 1))
        for name in _PAYLOAD:
            if f"payload.{name}" in chain.heard:
                # An amplitude density a root hertz is white noise of half its square.
                white = 0.5 * sensors[f"{name}_noise"] ** 2 * _UNIT
                total = total + abs2(chain.heard[f"payload.{name}"]) * white
        if "rope.tension" in chain.heard:
            tension = at_rows(self.numbers.static_tension, rows)
            white = (np.nan_to_num(sensors["cell_noise"]) * tension) ** 2 * (SAMPLE_TIME * _UNIT)
            total = total + abs2(chain.heard["rope.tension"]) * white
        if "mru.heave" in chain.heard and np.all(np.isfinite(sensors["mru_floor"])):
            rms = at_rows(shaken.heave_rms, rows)
            error = np.maximum(sensors["mru_floor"], sensors["mru_fraction"] * rms)
            w = sensors["mru_bandwidth"]
            shape = 2.0 * np.sqrt(2.0) / np.pi * w**3 / (chain.s.imag**4 + w**4)
            gain = chain.heard["mru.heave"] + chain.s * chain.heard["mru.heave_rate"]
            total = total + abs2(gain) * (error**2 * shape)
        return np.asarray(total)

    def moments(
        self,
        rows: IndexArray,
        chain: Chain,
        outputs: Sequence[str],
        nodes: SweepNodes,
        shaken: Shaken,
        drag: FloatArray,
    ) -> dict[str, FloatArray]:
        """Return variances of outputs and of their rates by all rules, (m, 2, rules) each.

        Parameters
        ----------
        rows, chain
            Some loops, and what their responses at the nodes are made of.
        outputs, nodes, shaken
            Names of outputs, the nodes and what shakes the loops.
        drag
            Their drag coefficients, (m,) [N s/m].
        """
        y, f = chain.ends(drag[:, None])
        inverse = 1.0 / abs2(chain.closed(y, f))
        right = _both(nodes.sea if shaken.ratios is None else nodes.weights, nodes.omega)
        heave = inverse if shaken.ratios is None else inverse * shaken.ratios[rows]
        factors = at_rows(shaken.factors, rows)
        sources = [(heave, right, factors, chain.numerators_of_heave(outputs))]
        if shaken.noisy:
            white = inverse * self.noise(rows, chain, shaken)
            right = _both(nodes.weights, nodes.omega)
            sources.append((white, right, np.ones((1, 1)), chain.numerators_of_noise(outputs)))
        found = {}
        for name in outputs:
            total = np.zeros((rows.size, right.shape[1]))
            for density, weights, factor, numerators in sources:
                size = abs2(_sum_of(numerators[name], y, f))
                total += ((size * density) @ weights) * factor
            found[name] = total.reshape(rows.size, 2, -1)
        return found

    def velocity_of_drag(
        self, rows: IndexArray, chain: Chain, nodes: SweepNodes, shaken: Shaken
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return p0, p1, p2, w, (m, k): the velocity's variance is sum w/(p0 + C p1 + C^2 p2)."""
        fixed, slope = chain.closed_of_drag()
        cross = 2.0 * (fixed.real * slope.real + fixed.imag * slope.imag)
        heave: Any = nodes.sea[0]
        if shaken.ratios is not None:
            heave = shaken.ratios[rows] * nodes.weights[0]
        driven = _sum_of(chain.numerators_of_heave([VELOCITY])[VELOCITY], None, None)
        total = abs2(driven) * (heave * at_rows(shaken.factors, rows))
        if shaken.noisy:
            driven = _sum_of(chain.numerators_of_noise([VELOCITY])[VELOCITY], None, None)
            total = total + abs2(driven) * (self.noise(rows, chain, shaken) * nodes.weights[0])
        shape = rows.size, len(nodes)
        a, b, c, d = (np.broadcast_to(p, shape) for p in (abs2(fixed), cross, abs2(slope), total))
        return a, b, c, d


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """What responses are made of, (1 or m, 1 or k) each; the module's docstring has the letters.

    y and f are given without a force at the payload and per unit of it; the force is
    `per_mass` times `mass`, and `per_drag` times the drag.
    """

    s: ComplexArray
    y: tuple[ComplexArray, ComplexArray]
    f: tuple[ComplexArray, ComplexArray]
    per_mass: ComplexArray
    per_drag: ComplexArray
    mass: FloatArray
    h: FloatArray
    phi: FloatArray
    load: FloatArray
    e: ComplexArray
    shaft: ComplexArray
    back: ComplexArray
    W: ComplexArray
    pull: ComplexArray
    drive: FloatArray
    G: ComplexArray
    D: ComplexArray
    E: ComplexArray
    H: ComplexArray
    heard: Mapping[str, Any]
    per_current: FloatArray

    def ends(self, drag: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return y and f with a drag, (1 or m, 1) [N s/m]."""
        force = self.per_mass * self.mass + self.per_drag * drag
        return self.y[0] + force * self.y[1], self.f[0] + force * self.f[1]

    def closed(self, y: ComplexArray, f: ComplexArray) -> ComplexArray:
        """Return the closed characteristic function."""
        return np.asarray(self._of_y * y + self._of_f * f + self.drive * self.G)

    def closed_of_drag(self) -> tuple[ComplexArray, ComplexArray]:
        """Return c0 and c1 of the closed characteristic function c0 + C c1."""
        y, f = self.ends(np.zeros((1, 1)))
        return self.closed(y, f), self.per_drag * (self._of_y * self.y[1] + self._of_f * self.f[1])

    @property
    def _of_y(self) -> ComplexArray:
        return self.W + self.drive * self.D

    @property
    def _of_f(self) -> ComplexArray:
        return self.pull + self.drive * self.E

    def numerators_of_heave(self, outputs: Sequence[str]) -> dict[str, Numerator]:
        """Return the numerators of outputs over `closed`, for the hook's heave."""
        phi, shaft, load, W, e = self.phi, self.shaft, self.load, self.W, self.e
        moved = W + self.drive * (self.D + self.H)
        turn = (phi * self.H, -(phi * self.E + load * e), -phi * self.G)
        torque = load * (self.back + self.drive * (self.D + self.H)) - phi * shaft * self.E
        asked = self.pull * (self.D + self.H) - W * self.E
        return self._numerators(
            outputs,
            payload=moved,
            turn=turn,
            torque=(phi * shaft * self.H, torque, -phi * shaft * self.G),
            command=(W * self.H, asked, -W * self.G),
        )

    def numerators_of_noise(self, outputs: Sequence[str]) -> dict[str, Numerator]:
        """Return the numerators of outputs over `closed`, for noise on the command."""
        phi = self.phi + 0.0 * self.shaft
        return self._numerators(
            outputs,
            payload=self.drive + 0.0 * self.shaft,
            turn=(phi, None, None),
            torque=(phi * self.shaft, phi * self.load * self.h, None),
            command=(self.W, self.pull, None),
        )

    def _numerators(
        self,
        outputs: Sequence[str],
        *,
        payload: ComplexArray,
        turn: Numerator,
        torque: Numerator,
        command: Numerator,
    ) -> dict[str, Numerator]:
        every: dict[str, Numerator] = {
            "payload.displacement": (None, None, payload),
            VELOCITY: (None, None, self.s * payload),
            "drum.haul": _times(self.h, turn),
            "motor.speed": _times(self.s, turn),
            "motor.torque": torque,
            "motor.current": _times(1.0 / self.per_current, torque),
            "drive.command": command,
            "motor.voltage": command,
            "rope.tension": (None, payload, None),
        }
        return {name: every[name] for name in outputs}


_UNIT = float(White(1.0).density(1.0))  # of white noise of intensity one, a rad/s


def late(s: ComplexArray, delay: FloatArray) -> Any:
    """Return exp(-s delay); real arithmetic where s is on the imaginary axis."""
    if not np.any(delay):
        return 1.0
    turn = s.imag * delay
    found = np.empty(turn.shape, dtype=np.complex128)
    np.cos(turn, out=found.real)
    np.sin(-turn, out=found.imag)
    return found * np.exp(-s.real * delay) if np.any(s.real) else found


def abs2(values: ComplexArray) -> FloatArray:
    """Return |values|^2."""
    return np.asarray(values.real**2 + values.imag**2)


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
