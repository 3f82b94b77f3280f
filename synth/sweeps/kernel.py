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
        x = (nodes.omega / self.reference) ** 2
        squares = {name: squared(self._scaled(self._numerators[name]())) for name in orders}
        highest = max((len(c) + orders[name] - 1 for name, c in squares.items()), default=0)
        powers = x ** np.arange(highest)[:, None]
        right = (weights[:, None, :] * powers[None]).reshape(-1, x.size).T.copy()
        sums = np.empty((len(self), right.shape[1]))
        even, odd, y = self._halves(self.closed, nodes.omega)
        step = max(1, CHUNK // x.size)
        for at in range(0, len(self), step):
            part = slice(at, at + step)
            inverse = self._inverse(even[part], odd[part], y)
            if shaken.ratios is not None:
                inverse *= shaken.ratios[part]
            np.matmul(inverse, right, out=sums[part])
        folded = sums.reshape(len(self), len(weights), highest)
        found = {}
        for name, square in squares.items():
            columns = np.zeros((len(self), orders[name], len(weights)))
            for m, c in enumerate(square):
                for order in range(orders[name] if _there(c) else 0):
                    columns[:, order] += c[:, None] * folded[:, :, m + order]
            columns[:, 1:] *= self.reference**2
            found[name] = columns * shaken.factors[:, None, None]
        return found

    def _scaled(self, columns: Columns) -> Columns:
        return [c * self.reference**j for j, c in enumerate(columns)]

    def _table(self, columns: Columns) -> FloatArray:
        found = np.empty((len(self), len(columns)))
        for j, column in enumerate(columns):
            found[:, j] = column
        return found

    def _halves(
        self, columns: Columns, omega: FloatArray
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
        """Return even and odd coefficients with their signs, and the powers that they go with."""
        y = omega / self.reference
        even, odd = self._table(columns[0::2]), self._table(columns[1::2])
        even[:, 1::2] *= -1.0
        odd[:, 1::2] *= -1.0
        evens = np.stack([y ** (2 * m) for m in range(even.shape[1])])
        odds = np.stack([y ** (2 * m + 1) for m in range(odd.shape[1])])
        return even, odd, (evens, odds)

    @staticmethod
    def _inverse(
        even: FloatArray, odd: FloatArray, powers: tuple[FloatArray, FloatArray]
    ) -> FloatArray:
        """Return 1/|Den|^2, (loops, nodes): real and imaginary part apart, nothing cancels."""
        real = even @ powers[0]
        imaginary = odd @ powers[1]
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
    degree = len(columns) - 1
    sign = np.sign(columns[-1])
    with np.errstate(all="ignore"):
        pace = (np.abs(columns[0]) / np.abs(columns[-1])) ** (1.0 / degree)
        pace = np.where((pace > 0.0) & np.isfinite(pace), pace, 1.0)
        lead = columns[-1] * pace**degree
        scaled = [c * pace**j / lead for j, c in enumerate(columns)]
        stable = sign != 0.0
        for c in scaled:
            stable = stable & (c > 0.0)
        upper = scaled[degree::-2]
        lower = scaled[degree - 1 :: -2] if degree else []
        while lower:
            stable = stable & (lower[0] > 0.0)
            ratio = upper[0] / lower[0]
            padded = [*lower[1:], np.zeros(1)]
            upper, lower = (lower, [u - ratio * p for u, p in zip(upper[1:], padded, strict=False)])
    return np.asarray(stable)


def _trimmed(columns: Columns) -> Columns:
    """Return a polynomial without highest coefficients that are zero in all loops."""
    while len(columns) > 1 and not np.any(columns[-1]):
        columns = columns[:-1]
    return columns


def _there(column: FloatArray) -> bool:
    return column.size > 1 or bool(column[0] != 0.0)
