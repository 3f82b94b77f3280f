r"""Loops around a rope of N masses, with delay: thousands at once, node by node.

The rope is a recursion from the payload up, x_0 = 1 at the payload: for every mass

    delta <- delta - zeta x,   x <- x + delta,     zeta = -s^2 m h / (EA (1 + tau s))

(piece h, its mass m; `models.plant.rope.lump_rope`), which ends at the drum with Y/P = y and T/P =
f. Around it stand the winch's own equations, as in `models.plant.line`,

    open = W y + g h e f,    closed = open + h phi G,    G = q(s) low-passes exp(-s delay).

Nothing is divided by what may be zero: `open` and `closed` have no poles but stable ones, so the
zeros of `closed` are the loop's poles, and its phase along the imaginary axis counts them
(`synth.sweeps.winding_count`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray
from models.plant import RopeLumps

from .numbers import PlantNumbers, at_rows

BLOCK = 12_000  # numbers of an array at once: the half dozen in use stay in the cache


@dataclass(frozen=True, kw_only=True, eq=False)
class _Parts:
    """What the responses are made of, all of one shape."""

    closed: ComplexArray
    open: ComplexArray
    W: ComplexArray
    f: ComplexArray
    G: ComplexArray
    e: ComplexArray


class ChainLoops:
    """Closed loops of the payload feedback around a lumped rope, delay and low-passes exact.

    Parameters
    ----------
    plants
        The plants.
    gains
        A a, A a1, A a2 of each loop, (n, 3).
    drag
        Linear drag coefficient of each, (n,) or (1,) [N s/m].
    lumps
        How the rope is lumped.
    """

    def __init__(
        self, plants: PlantNumbers, gains: FloatArray, drag: FloatArray, *, lumps: RopeLumps
    ) -> None:
        self._count = max(len(plants), len(gains), drag.size)
        n = plants
        self._lumps = lumps
        self._drag = drag
        self._gains = gains
        self._tau = n.damping_time
        self._stiffness = n["axial_stiffness"] / n["rope_length"]
        self._rope = n.rope_mass
        self._mass = n["payload_mass"]
        self._h = n["drum_radius"] / n["gear_ratio"]
        self._load = n.gear_factor * self._h
        self._inertia, self._friction = n["inertia"], n["viscous_friction"]
        self._phi, self._beta, self._lag = n.drive
        self._torque_constant = n["torque_constant"]
        self._filters = [
            n[name]
            for name in ("sensor_bandwidth", "telemetry_bandwidth")
            if np.all(np.isfinite(n[name]))
        ]
        self._delay = n["delay"]

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
    def scale(self) -> float:
        """A drag that matters [N s/m]: a step for what is affine in it, so any would do."""
        return float(np.max(self._mass))

    def with_drag(self, drag: FloatArray) -> ChainLoops:
        """Return the loops with other drag [N s/m]."""
        other = object.__new__(ChainLoops)
        other.__dict__.update(self.__dict__)
        other._drag = drag
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
        parts = self._parts(rows, s)
        return parts.closed, parts.open

    def moments(
        self,
        outputs: Sequence[str],
        omega: FloatArray,
        weights: FloatArray,
        density: FloatArray | None = None,
        *,
        second: bool = False,
    ) -> dict[str, FloatArray]:
        """Return variances of outputs; as `synth.sweeps.kernel.SpringLoops.moments`."""
        found = {name: np.empty((len(self), len(weights))) for name in outputs}
        step = max(1, BLOCK // omega.size)
        s = np.asarray(1j * omega, dtype=np.complex128)
        right = (weights * omega**2 if second else weights).T.copy()
        for at in range(0, len(self), step):
            rows = np.arange(at, min(at + step, len(self)))
            parts = self._parts(rows, s)
            inverse = 1.0 / abs2(parts.closed)
            if density is not None:
                inverse *= density[rows]
            for name in outputs:
                found[name][rows] = (abs2(self._numerator(name, rows, s, parts)) * inverse) @ right
        return found

    def velocity_of_drag(
        self, rows: IndexArray, omega: FloatArray
    ) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """Return c0, c1 and |s W|^2: the payload's velocity is s W / (c0 + C c1), (m, k) each."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        none = self.with_drag(np.zeros(1))._parts(rows, s)
        unit = np.array([self.scale])
        some = self.with_drag(unit)._parts(rows, s)
        slope = (some.closed - none.closed) / unit
        driven = np.broadcast_to(abs2(none.W) * omega**2, (rows.size, omega.size))
        return none.closed, slope, driven

    def _numerator(
        self, name: str, rows: IndexArray, s: ComplexArray, parts: _Parts
    ) -> ComplexArray:
        if name == "payload.displacement":
            return parts.W
        if name == "payload.velocity":
            return np.asarray(s * parts.W)
        if name in ("drive.command", "motor.voltage"):
            return np.asarray(parts.G * parts.W)
        if name == "rope.tension":
            return np.asarray(parts.f * parts.W)
        phi, load = at_rows(self._phi, rows), at_rows(self._load, rows)
        if name in ("motor.speed", "drum.haul"):
            drum = load * parts.f * parts.e + phi * parts.G
            return np.asarray(s * drum if name == "motor.speed" else at_rows(self._h, rows) * drum)
        shaft = at_rows(self._inertia, rows) * s**2 + at_rows(self._friction, rows) * s
        torque = at_rows(self._beta, rows) * load * s * parts.f - phi * shaft * parts.G
        if name == "motor.torque":
            return np.asarray(torque)
        assert name == "motor.current", name
        return np.asarray(torque / at_rows(self._torque_constant, rows))

    def _parts(self, rows: IndexArray, s: ComplexArray) -> _Parts:
        stretch = 1.0 + s * at_rows(self._tau, rows)
        square = s * s
        springs, masses = self._lumps.springs, self._lumps.masses
        spring = at_rows(self._stiffness, rows) * stretch  # EA (1 + tau s) / L
        rope = at_rows(self._rope, rows)
        end = at_rows(self._mass, rows) + rope * masses[-1]
        # Force over the stiffness of the whole rope, from the payload up.
        force = (end * square + s * at_rows(self._drag, rows)) / spring
        x = np.ones_like(force)
        z = rope * square / spring
        if self.masses > 1:
            piece = springs[-1]
            delta = force * piece
            inner = z * (piece * masses[0])
            x = x + delta
            step = np.empty_like(x)
            for _ in range(self.masses - 2):
                np.multiply(inner, x, out=step)
                delta += step
                x += delta
            # All springs but the uppermost are alike, and all masses but the payload's.
            force = delta / piece + masses[0] * z * x
        y = x + springs[0] * force
        f = force * spring
        e = 1.0 + s * at_rows(self._lag, rows)
        shaft = at_rows(self._inertia, rows) * square + at_rows(self._friction, rows) * s
        W = shaft * e + at_rows(self._beta, rows) * s
        h = at_rows(self._h, rows)
        g = self._gains
        G = at_rows(g[:, 0], rows) * square + at_rows(g[:, 1], rows) * s + at_rows(g[:, 2], rows)
        for bandwidth in self._filters:
            b = s / at_rows(bandwidth, rows)
            G = G / (1.0 + np.sqrt(2.0) * b + b * b)
        if np.any(self._delay):
            G = G * np.exp(-s * at_rows(self._delay, rows))
        open_loop = W * y + (at_rows(self._load, rows) * h) * (e * f)
        closed = open_loop + (h * at_rows(self._phi, rows)) * G
        return _Parts(closed=closed, open=open_loop, W=W + 0.0 * x, f=f, G=G + 0.0 * x, e=e)


def abs2(values: ComplexArray) -> FloatArray:
    """Return |values|^2."""
    return np.asarray(values.real**2 + values.imag**2)
