r"""Loops of fourth order, thousands at once: coefficients, stability and variances.

One spring, the payload feedback of three gains, no delay and given drag: then every response is a
ratio of polynomials in s over one common denominator,

    Den = Open B + h phi q kappa,     Open = W (kappa + D) + g h D kappa e,

    D = M s^2 + C s (payload),  kappa = K (1 + tau s) (rope),  q = A (a s^2 + a1 s + a2),
    W = (I s^2 + B_v s) e + beta s (motor and drive),  e its lag,  B the sensors' low-passes,
    h = r/n, g = h (1/eta + eta)/2,  phi torque per command,  beta torque per speed

(the equations of `models.plant.line` with the rope's closed form put in).  What costs time is
1/\|Den\|^2 at every node of every loop; it is made in real arithmetic, in chunks that stay in the
cache.  All variances then are its products with a few powers of the frequency, as every
\|numerator\|^2 is a polynomial in omega^2: one matrix product for all outputs together.
"""

from collections.abc import Callable, Mapping

import numpy as np

from models.basics import BoolArray, FloatArray

from .chain import ChainLoops, Shaken
from .sweep_nodes import SweepNodes

Columns = list[FloatArray]  # coefficients of s^0, s^1, .., each (n,), or (1,) if all have the same

CHUNK = 33_000  # numbers of an array at once: two stay in the second-level cache


class SpringLoops:
    """Closed loops of one spring without delay, as polynomials in s/reference [rad/s].

    Their controllers' parameters are a, a1 and a2, multiplied by the amplifier A.
    """

    def __init__(self, loops: ChainLoops, *, amplifier: float, reference: float) -> None:
        self.reference = reference
        n = loops.numbers
        self._count = len(loops)
        zero, one = np.zeros(1), np.ones(1)
        h, load, phi, beta = n["haul"], n["load"], n["phi"], n["beta"]
        K, mass = n["stiffness"], n["payload_mass"] + loops.lumps.masses[0] * n["rope_mass"]
        mass = mass + n["block_mass"]
        kappa = _trimmed([K, K * n["damping_time"]])
        D, e = [zero, loops.drag, mass], _trimmed([one, n["lag"]])
        shaft = [zero, n["viscous_friction"], n["inertia"]]
        W = total(product(shaft, e), [zero, beta])
        q = [amplifier * gain for gain in reversed(loops.law.values)]
        sensors: Columns = [one]
        for name in ("sensor_bandwidth", "telemetry_bandwidth"):
            if np.all(np.isfinite(n[name])):
                b = n[name]
                sensors = product(sensors, [one, np.sqrt(2.0) / b, 1.0 / b**2])
        heard = product(q, kappa)  # what the sensors' denominators leave of the feedback
        pull = product([load * d for d in D], product(kappa, product(e, sensors)))
        free = total(product(W, product(total(kappa, D), sensors)), [h * c for c in pull])
        self.closed = self._scaled(total(free, [h * phi * c for c in heard]))
        moved = product(W, product(kappa, sensors))
        drum = total(pull, [phi * c for c in heard])

        def torque() -> Columns:
            direct = [-phi * c for c in product(shaft, heard)]
            rest = product(D, product(kappa, sensors))
            return total(direct, product([zero, beta * load], rest))

        # Only what is asked for is multiplied out.
        self._numerators: dict[str, Callable[[], Columns]] = {
            "payload.displacement": lambda: moved,
            "payload.velocity": lambda: [zero, *moved],
            "motor.speed": lambda: [zero, *drum],
            "motor.torque": torque,
            "motor.current": lambda: [c / n["torque_constant"] for c in torque()],
            "drum.haul": lambda: [h * c for c in drum],
            "drive.command": lambda: product(W, heard),
            "motor.voltage": lambda: product(W, heard),
            "rope.tension": lambda: [n["reeved"] * c for c in product(D, moved)],
            "rope.lower_tension": lambda: product([zero, loops.drag, n["payload_mass"]], moved),
        }

    def __len__(self) -> int:
        return self._count

    @property
    def stable(self) -> BoolArray:
        """Whether all roots of the characteristic polynomial lie in the left half plane, (n,)."""
        return np.broadcast_to(hurwitz(self.closed), (len(self),))

    def moments(
        self, orders: Mapping[str, int], nodes: SweepNodes, shaken: Shaken
    ) -> dict[str, FloatArray]:
        """Return variances of outputs, and of their rates, by all rules, (n, orders, rules) each.

        An output's order is 2 with its rate, 1 without; what shakes the loops is without noise.
        """
        # Every variance is sum_m c_m int omega^2m S / |Den|^2, c_m of the output's |numerator|^2:
        # so 1/|Den|^2 is made once, and multiplied once with all powers, weights and rules.
        weights = nodes.sea if shaken.ratios is None else nodes.weights
        y = nodes.omega / self.reference
        squares = {name: squared(self._scaled(self._numerators[name]())) for name in orders}
        terms = [
            (name, order, c, m + order)
            for name, square in squares.items()
            for m, c in enumerate(square)
            for order in range(orders[name])
            if _there(c)
        ]
        wanted = sorted({power for *_, power in terms})
        powers = y ** (2 * np.array(wanted, dtype=np.intp)[:, None])
        left = (weights[:, None, :] * powers).reshape(-1, y.size)
        sums = np.empty((len(left), len(self)))
        even, odd = self._half(0), self._half(1)
        evens, odds = (y[:, None] ** (2 * np.arange(len(c)) + k) for k, c in enumerate((even, odd)))
        # Cases are the last axis all along: columns are then written and read as they lie.
        step = max(1, CHUNK // y.size)
        for at in range(0, len(self), step):
            part = slice(at, at + step)
            inverse = _inverse(evens @ even[:, part], odds @ odd[:, part])
            if shaken.ratios is not None:
                inverse *= shaken.ratios[part].T
            np.matmul(left, inverse, out=sums[:, part])
        folded = sums.reshape(len(weights), len(wanted), len(self))
        found = {name: np.zeros((order, len(weights), len(self))) for name, order in orders.items()}
        for name, order, c, power in terms:
            found[name][order] += c * folded[:, wanted.index(power)]
        for columns in found.values():
            columns[1:] *= self.reference**2
            columns *= shaken.factors
        return {name: columns.transpose(2, 0, 1) for name, columns in found.items()}

    def _scaled(self, columns: Columns) -> Columns:
        return [c * self.reference**j for j, c in enumerate(columns)]

    def _half(self, first: int) -> FloatArray:
        """Return every other coefficient of the characteristic polynomial at i y, (m, n)."""
        half = self.closed[first::2]
        found = np.empty((len(half), len(self)))
        for m, column in enumerate(half):
            np.multiply(column, (-1.0) ** m, out=found[m])
        return found


def _inverse(real: FloatArray, imaginary: FloatArray) -> FloatArray:
    """Return 1/|Den|^2 in place of its real part: the two apart, nothing cancels."""
    np.multiply(real, real, out=real)
    np.multiply(imaginary, imaginary, out=imaginary)
    np.add(real, imaginary, out=real)
    return np.reciprocal(real, out=real)


def product(one: Columns, other: Columns) -> Columns:
    """Return the product of two polynomials."""
    found = [np.zeros(1)] * (len(one) + len(other) - 1)
    for i, a in enumerate(one):
        for j, b in enumerate(other):
            if _there(a) and _there(b):
                found[i + j] = found[i + j] + a * b
    return found


def total(one: Columns, other: Columns) -> Columns:
    """Return the sum of two polynomials."""
    long, short = (one, other) if len(one) >= len(other) else (other, one)
    return [c + short[j] if j < len(short) else c for j, c in enumerate(long)]


def squared(columns: Columns) -> Columns:
    """Return |N(i y)|^2 as a polynomial in y^2."""
    even = [c * (-1.0) ** m for m, c in enumerate(columns[0::2])]
    odd = [c * (-1.0) ** m for m, c in enumerate(columns[1::2])]
    found = product(even, even)
    if odd:
        found = total(found, [np.zeros(1), *product(odd, odd)])
    return found


def hurwitz(columns: Columns) -> BoolArray:
    """Return whether all roots of polynomials lie in the open left half plane, (n,).

    Routh's array, all loops at once, with time scaled by the roots' geometric mean so that nothing
    overflows (Routh 1877; for the fourth order it is Lienard and Chipart's pair of inequalities).
    A zero in its first column, the boundary, counts as unstable.  The columns are the coefficients
    of s^0 to s^m, each (n,), the highest not zero.
    """
    with np.errstate(all="ignore"):
        pace = np.abs(columns[0] / columns[-1]) ** (1.0 / max(len(columns) - 1, 1))
        scale, slower = 1.0 / columns[-1], 1.0 / np.where((pace > 0.0) & (pace < np.inf), pace, 1.0)
        scaled, stable = [], columns[-1] != 0.0
        for c in reversed(columns):
            scaled.append(c * scale)
            stable = stable & (scaled[-1] > 0.0)
            scale = scale * slower
        upper, lower = scaled[0::2], scaled[1::2]
        while lower:
            stable = stable & (lower[0] > 0.0)
            ratio = upper[0] / lower[0]
            rest = [u - ratio * v for u, v in zip(upper[1:], lower[1:], strict=False)]
            upper, lower = lower, rest + upper[len(lower) :]
    return np.asarray(stable)


def _trimmed(columns: Columns) -> Columns:
    """Return a polynomial without highest coefficients that are zero in all loops."""
    while len(columns) > 1 and not np.any(columns[-1]):
        columns = columns[:-1]
    return columns


def _there(column: FloatArray) -> bool:
    return column.size > 1 or bool(column[0] != 0.0)
