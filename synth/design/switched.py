r"""What a design's signals are with losses that switch: deviations and most probable extremes.

A limit has the loss once and in full, |static| + loss + k sigma, which is simple, smooth and on the
safe side: the signal's peak and the loss need not fall together.  Here is what is to be expected.

With the gear's and the sheaves' losses a signal is A + s (Delta + B), s the sign of the motor's
speed: A is what the linear loop makes of it, Delta what the loss at rest comes to, and B the same
share of the tension's motion, as a gear loses of the load that it carries and not of that at rest.

*Deviation.*  Delta s is friction b omega and a remnant (`models.sensing.switching`), here of the
motor's own speed, where the design has that of a drum that follows the hook: a drum that hardly
turns has a remnant that is slower and smaller.

*Extreme.*  The rate at which A + s (Delta + B) crosses a level u upwards, of Gaussian A, B and
omega (Rice 1944): with v = u - s Delta and C = A + s B, summed over s = 1 and -1,

    f_C(v) E[C'; C' > 0, s omega > 0 | C = v],

and where the motor turns to haul, the signal jumps by the loss, s (Delta + B) to either side:

    f_omega(0) (E[omega'; omega' > 0, C_+ > v_+ | omega = 0] - E[omega'; .., C_- > v_- | ..]).

Both are E[x; x > 0, y > 0] = phi(0) Phi(h/q) + c phi(h) Phi(-h c/q), q^2 = 1 - c^2, of x and y of
deviation one and correlation c, h the mean of y.  The most probable largest value in a time is the
level that is crossed once in it.

*Readings.*  A payload signal that is read every h seconds and held is a staircase: the signal,
later by h/2, and its images about every multiple of 2 pi/h (K. J. Astrom and B. Wittenmark,
*Computer-Controlled Systems*, 1997, section 7.2).  A density S(omega) before the readings comes
again at 2 pi k/h +- omega, and from there acts as noise of the readings does.  Limits are without
it.  What follows a reading has died down before the next, so that an extreme is higher over its
deviation than that of lasting noise: it is told with the images as large as they are at their most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from models.basics import ComplexArray, FloatArray, Quadrature, peak_factor
from models.sensing import SET_POINT, SwitchingNoise, SwitchingShape

if TYPE_CHECKING:
    import numpy.typing as npt

    from ..loop import Assessment
    from ..question import DesignQuestion

_SPEED, _TORQUE, _TENSION = "motor.speed", "motor.torque", "rope.tension"
_ROUNDS = 3  # of the remnant, which is part of the speed that it goes with
_SURE = 1.0 - 1e-9  # a correlation, at most
_IMAGES = 12  # multiples of the rate of readings about which a staircase is looked at
_LINES = 12  # frequencies, of equal shares of the variance, that stand for a signal that is read


@dataclass(frozen=True, kw_only=True, eq=False)
class _Turning:
    """A motion by its density on nodes, as `SwitchingShape` takes that of the hook."""

    omega: FloatArray
    velocity: FloatArray  #: Density of its velocity there.

    def density(self, omega: FloatArray, /) -> FloatArray:
        """Return the density of the displacement at `omega` [rad/s]."""
        least = float(np.max(self.velocity)) * 1e-14
        level = np.log(np.maximum(self.velocity, least))
        found = np.interp(np.log(omega), np.log(self.omega), level, left=-np.inf, right=-np.inf)
        return np.asarray(np.exp(found) / np.square(omega))


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchedSignal:
    """A + s (Delta + B) of Gaussian A, B and omega, s = sign(omega), by densities on nodes."""

    nodes: Quadrature
    densities: FloatArray  #: Of the disturbances, (w, k).
    #: Responses of A, B and omega to the disturbances, (w, k) each.
    linear: ComplexArray
    carried: ComplexArray
    speed: ComplexArray
    loss: float  #: Delta, in the signal's unit.

    def extreme(self, duration: float, way: int = 1) -> float:
        """Return how far it most probably goes up (`way` 1) or down (-1) in a time [s]."""
        moments = self._moments[way]
        largest = 3.0 * self.loss + 9.0 * math.sqrt(moments[0, 0])
        if self.loss == 0.0:
            period = 2.0 * math.pi * math.sqrt(moments[0, 0] / moments[1, 1])
            return float(peak_factor(period, duration)) * math.sqrt(moments[0, 0])

        def excess(level: float) -> float:
            return math.log(max(self.rate(level, way) * duration, 1e-300))

        # Below the level that is crossed most often it is crossed less again.
        levels = np.linspace(0.0, largest, 200)
        top = int(np.argmax([excess(level) for level in levels]))
        if excess(levels[top]) <= 0.0:
            return float(levels[top])
        return float(brentq(excess, levels[top], largest))

    def rate(self, level: float, way: int = 1) -> float:
        """Return how often it crosses a level upwards, or -level downwards [1/s]."""
        total = 0.0
        for turn in (1, -1):
            moments, v = self._moments[turn * way], level - turn * self.loss
            m0, m2, own, bend = (math.sqrt(one) for one in np.diag(moments))
            r = _correlation(turn * moments[0, 2], m0 * own)
            q = math.sqrt(1.0 - r * r)
            crossing = moments[1, 2] / (m2 * own * q)
            up = m2 * _rising(r * v / (m0 * q), turn * crossing)
            total += float(_density(v / m0)) / m0 * up
            # Jumps as the motor turns to haul, where cov(C, omega') = -cov(C', omega).
            turning = -moments[1, 2] / (m0 * bend * q)
            if self.loss:
                beyond = bend * _rising(-v / (m0 * q), turning)
                total += turn * float(_density(0.0)) / own * beyond
        return total

    @cached_property
    def _moments(self) -> dict[int, FloatArray]:
        """Covariances of C = A + s B, C', omega and omega', (4, 4), by s, 1 or -1."""
        found, s = {}, 1j * self.nodes.omega
        for way in (1, -1):
            C = self.linear + way * self.carried
            rows = np.stack([C, s * C, self.speed, s * self.speed])
            weighed = rows * (self.densities * self.nodes.weights)
            found[way] = np.asarray(np.einsum("iwk,jwk->ij", weighed.conj(), rows).real)
        return found


def _correlation(covariance: float, product: float) -> float:
    return min(max(covariance / product, -_SURE), _SURE)


def _rising(mean: float, covariance: float) -> float:
    """Return E[x; x > 0, y > 0] of Gaussian x and y of deviation one, y of a mean."""
    c = _correlation(covariance, 1.0)
    q = math.sqrt(1.0 - c * c)
    return float(_density(0.0) * ndtr(mean / q) + c * _density(mean) * ndtr(-c * mean / q))


def _density(x: npt.ArrayLike) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.square(x)) / math.sqrt(2.0 * math.pi))


def _crest(responses: ComplexArray) -> FloatArray:
    """Return by how much each signal's images are more than on average, where they are most, (o,).

    They follow a step of the readings and have died down before the next: a Gaussian number once
    a reading.  The responses (o, k) are to those of `_LINES` frequencies below and above each of
    `_IMAGES` multiples of the rate.
    """
    below, above = np.split(responses.reshape(-1, _IMAGES, 2 * _LINES), 2, axis=-1)
    turn = np.exp(2j * np.pi * np.outer(np.arange(1, _IMAGES + 1), np.arange(64) / 64))
    each = np.einsum("okl,kt->olt", above, turn) + np.einsum("okl,kt->olt", below, turn).conj()
    power = np.sum(np.abs(each) ** 2, axis=1)
    mean = power.mean(axis=-1)
    return np.asarray(np.sqrt(power.max(axis=-1) / np.where(mean > 0.0, mean, 1.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchedLoop:
    """Signals of a closed loop with its losses in them."""

    loop: Assessment
    question: DesignQuestion
    friction: float  #: What the losses come to as viscous friction at the motor [N m s/rad].

    def spectrum(self, signal: str) -> tuple[Quadrature, FloatArray]:
        """Return nodes, and there the density of a signal with the losses in it.

        A loss Delta sign(omega) is b omega and the remnant r, all of it coherent with what either
        makes of the signal.
        """
        nodes, densities, responses = self._on_nodes((signal, _SPEED))
        found, share = responses[0], self._share(signal)
        if share:
            found = found + share * self.friction * responses[1]
            at = self._names.index(SET_POINT) if SET_POINT in self._names else -1
            if at >= 0:
                found[at] -= share * self.question.data.torque_per_command(
                    np.asarray(1j * nodes.omega)
                )
        return nodes, np.sum(np.abs(found) ** 2 * densities, axis=0)

    def deviation(self, signal: str) -> float:
        """Return the standard deviation of a signal with the losses in it, in its unit."""
        nodes, density = self.spectrum(signal)
        return math.sqrt(nodes.integrate(density))

    def extreme(self, signal: str, duration: float, way: int = 1) -> float:
        """Return how far a signal most probably goes up (`way` 1) or down (-1) from rest.

        In a time [s], in the signal's unit.
        """
        return self.signal(signal).extreme(duration, way)

    def signal(self, signal: str) -> SwitchedSignal:
        """Return a signal as A + s (Delta + B)."""
        nodes, densities, responses = self._on_nodes((signal, _SPEED, _TENSION))
        plant, loss = self.question.plant, self.question.plant.loss.get(signal, 0.0)
        carried = np.zeros_like(responses[2])
        if loss:
            dry = 0.0 if signal == _TENSION else self.question.data.coulomb_friction
            part = loss - self._share(signal) * dry
            carried = part / plant.static[_TENSION] * responses[2]
        return SwitchedSignal(
            nodes=nodes,
            densities=densities,
            linear=responses[0] * self._known[3][self.loop.plant.outputs.index(signal)],
            carried=carried,
            speed=responses[1],
            loss=loss,
        )

    @cached_property
    def _names(self) -> list[str]:
        return [source.name for source in self.loop.disturbances]

    def _share(self, signal: str) -> float:
        loss = self.question.plant.loss
        return loss[signal] / loss[_TORQUE] if loss.get(signal, 0.0) else 0.0

    def _on_nodes(self, signals: tuple[str, ...]) -> tuple[Quadrature, FloatArray, ComplexArray]:
        """Return nodes, densities (w, k) and responses (o, w, k) of signals to all that shakes."""
        nodes, densities, responses, _ = self._known
        at = [self.loop.plant.outputs.index(one) for one in signals]
        return nodes, densities, responses[at]

    @cached_property
    def _known(self) -> tuple[Quadrature, FloatArray, ComplexArray, FloatArray]:
        """Nodes for all outputs of the plant, densities, responses and crests (o, k) there."""
        outputs = self.loop.plant.outputs
        nodes = self.loop.quadrature(outputs)
        omega = nodes.omega
        densities = np.stack(
            [np.broadcast_to(self._density(i, omega), omega.shape) for i in range(len(self._names))]
        )
        responses = self.loop.responses(outputs, self._names, omega)
        density = np.sum(np.abs(responses) ** 2 * densities, axis=1)
        ones = np.ones((len(outputs), omega.size))
        found = [(omega, nodes.weights, densities, responses, ones)]
        for name, omega, shares in self._images(nodes, dict(zip(outputs, density, strict=True))):
            # They stand where the first of the sources does, which has nothing there.
            from_readings = self.loop.responses(outputs, [name], omega)
            others = len(self._names) - 1
            found.append(
                (
                    omega,
                    np.ones_like(omega),
                    np.pad(shares[np.newaxis], ((0, others), (0, 0))),
                    np.pad(from_readings, ((0, 0), (0, others), (0, 0))),
                    np.broadcast_to(
                        _crest(from_readings[:, 0])[:, np.newaxis], (len(outputs), omega.size)
                    ),
                )
            )
        omega, weights, densities, responses, crests = (
            np.concatenate(part, axis=-1) for part in zip(*found, strict=True)
        )
        order = np.argsort(omega)
        nodes = Quadrature(omega=omega[order], weights=weights[order])
        return nodes, densities[:, order], responses[:, :, order], crests[:, order]

    def _images(
        self, nodes: Quadrature, density: Mapping[str, FloatArray]
    ) -> Iterator[tuple[str, FloatArray, FloatArray]]:
        """Yield noises, frequencies (k,) and variances (k,) of what signals that are held add.

        The low-passes before the readings are left out, which pass the motion.
        """
        plant = self.loop.plant
        for name, hold in zip(plant.measurements, plant.holds, strict=True):
            if hold == 0.0 or name not in self.loop.controller.measurements:
                continue
            shares = np.cumsum(density[name] * nodes.weights * (nodes.omega < math.pi / hold))
            each = (np.arange(_LINES) + 0.5) / _LINES * shares[-1]
            lines = nodes.omega[np.searchsorted(shares, each)]
            about = 2.0 * math.pi / hold * np.arange(1, _IMAGES + 1)[:, np.newaxis]
            omega = np.concatenate([about - lines, about + lines]).ravel()
            yield f"{name}_noise", omega, np.full(omega.size, shares[-1] / _LINES)

    def _density(self, index: int, omega: FloatArray) -> FloatArray:
        if self._names[index] == SET_POINT and self._remnant is not None:
            noise, shape, speed = self._remnant
            return noise.as_command(omega, shape.at(omega, speed))
        return np.asarray(self.loop.disturbances[index].density(omega))

    @cached_property
    def _remnant(self) -> tuple[SwitchingNoise, SwitchingShape[_Turning], float] | None:
        """The remnant of the loop's own speed: noise, shape, and that speed [rad/s]."""
        noise = self.question.spectra.get(SET_POINT)
        if not isinstance(noise, SwitchingNoise):
            return None
        nodes = self.loop.quadrature([_SPEED])
        sizes = {
            name: np.abs(self.loop.response(_SPEED, name, nodes.omega)) ** 2 for name in self._names
        }
        others = sum(
            sizes[source.name] * source.density(nodes.omega)
            for source in self.loop.disturbances
            if source.name != SET_POINT
        )
        density = others + sizes[SET_POINT] * noise.density(nodes.omega)
        for _ in range(_ROUNDS):
            shape = SwitchingShape(_Turning(omega=nodes.omega, velocity=density))
            speed = math.sqrt(nodes.integrate(density))
            own = noise.as_command(nodes.omega, shape.at(nodes.omega, speed))
            density = others + sizes[SET_POINT] * own
        return noise, shape, speed
