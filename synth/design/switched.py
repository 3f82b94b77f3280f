r"""What a design's signals are with losses that switch: deviations and most probable extremes.

A limit has the loss once and in full, |static| + loss + k sigma, which is simple, smooth and on the
safe side: the signal's peak and the loss need not fall together.  Here is what is to be expected.

With the gear's and the sheaves' losses a signal is A + s (Delta + B), s the sign of the motor's
speed: A is what the linear loop makes of it, Delta what the loss at rest comes to, and B the same
share of the tension's motion, as a gear loses of the load that it carries and not of that at rest.

*Deviation.*  Delta s is friction b omega and a remnant (`models.sensing.switching`), here of the
motor's own speed, where the design has that of a drum that follows the hook: a drum that hardly
turns has a remnant that is slower and smaller.

*Extreme.*  A loss is known but for its sign, so that it is no noise here: the loop without it hears
the sea and the noises, which makes A, B Gaussian, and answers to -Delta s on the motor's shaft.
That answer is told as if the motor turned with its mean period: a function Q of the phase phi of
(omega, omega'), by the harmonics of s.  Levels are crossed by C = A + s (Delta + B) + Q at the rate
(Rice 1944)

    integral of dphi/(2 pi) R exp(-R^2/2) dR f_C(u) E[C'; C' > 0 | C = u],

all of it for omega = R sigma_omega sin(phi) and omega' = R sigma_omega' cos(phi), and s the
simulation's tanh(omega/omega_0).  The most probable largest value in a time is the level that is
crossed once in it.

*Drag.*  A resonance that quadratic drag holds has lighter tails than a Gaussian one, since drag
grows with the swing: of the envelope a over its sigma the density goes as a exp(-(1 - r) a^2/2 -
r k a^3/3), k = (8/(3 pi))/sqrt(8/pi), r the drag's share of the damping (stochastic averaging;
Roberts and Spanos 1990, ch. 8).  r of a signal is how its variance falls as the drag's coefficient
rises, -dlog(sigma^2)/dlog(C), and A is as much smaller as its largest swing is.

What is no friction of the drag is a force beside it, as of the losses: of a Gaussian velocity of
autocorrelation rho, q |v| v has the autocovariance

    q^2 sigma^4 (2/pi) ((1 + 2 rho^2) asin(rho) + 3 rho sqrt(1 - rho^2)),

of which 8/pi rho is the friction's (L. E. Borgman 1967, *Spectral analysis of ocean wave forces on
piling*).  It has a sixth of the variance, about the waves and about three times their frequency,
where a resonance may lie that has little damping.

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
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from models.basics import ComplexArray, FloatArray, Quadrature, peak_factor
from models.sensing import (
    SET_POINT,
    SWITCHING_TURN,
    SwitchingNoise,
    SwitchingShape,
    density_of,
    velocity_correlation,
)

from ..loop import DragElement

if TYPE_CHECKING:
    import numpy.typing as npt

    from ..loop import Assessment
    from ..question import DesignQuestion

_SPEED, _TORQUE, _TENSION = "motor.speed", "motor.torque", "rope.tension"
_ROUNDS = 3  # of the remnant, which is part of the speed that it goes with
# Phases of a motor's motion, dense where it turns, their shares of a turn, and its sizes.
_EVENLY = 2.0 * math.pi * (np.arange(256) + 0.5) / 256
_PHASES = _EVENLY - 0.475 * np.sin(2.0 * _EVENLY)
_SHARES = (1.0 - 0.95 * np.cos(2.0 * _EVENLY)) / 256
_SIZES = 0.1 * (np.arange(70) + 0.5)
_FOLLOWS = 0.08
_ANEW = 0.9  # of a variance that need not be all in what begins anew
_LARGEST = 3.8  # sigmas of a largest swing in hours
DRAG_STEP = 1.05  #: By which drag is multiplied, for what a signal makes of it.
_SWING = 8.0 / (3.0 * math.pi) / math.sqrt(8.0 / math.pi)  # k of the envelope's density
_HARMONICS = 1200  # up to which a loss is followed; the even ones are zero
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
    """A + s (Delta + B) + Q of Gaussian A, B and omega, by densities on nodes."""

    nodes: Quadrature
    densities: FloatArray  #: Of the disturbances, (w, k).
    #: Responses of A, B and omega to the disturbances, (w, k) each.
    linear: ComplexArray
    carried: ComplexArray
    speed: ComplexArray
    loss: float  #: Delta, in the signal's unit.
    reaction: ComplexArray  #: Harmonics of Q by the phase of the speed, from 0 on; may be empty.
    turn: float = SWITCHING_TURN  #: Speed omega_0 over which s changes its side.

    def extreme(self, duration: float, way: int = 1) -> float:
        """Return how far it most probably goes up (`way` 1) or down (-1) in a time [s]."""
        cov = self._covariance
        sigma, period = math.sqrt(cov[0, 0]), 2.0 * math.pi * math.sqrt(cov[0, 0] / cov[1, 1])
        gaussian = float(peak_factor(period, duration)) * sigma
        if not self._switches:
            return gaussian

        def excess(level: float) -> float:
            return math.log(max(self.rate(level, way) * duration, 1e-300))

        high = gaussian + self.loss + 2.0 * float(np.abs(self._waves[0]).max())
        while excess(high) > 0.0:
            high *= 1.5
        low = high
        while excess(low) <= 0.0:
            high, low = low, 0.9 * low
            if low < 0.1 * gaussian:  # the loss leaves hardly a motion
                return low
        return float(brentq(excess, low, high, rtol=1e-9))

    def rate(self, level: float, way: int = 1) -> float:
        """Return how often it crosses a level upwards, or -level downwards [1/s]."""
        cov = self._covariance
        if not self._switches:
            pace = math.sqrt(cov[1, 1] / cov[0, 0]) / (2.0 * math.pi)
            return pace * math.exp(-0.5 * level**2 / cov[0, 0])
        weights, mean, climb, variance, slope, rest = self._turns
        off = level - way * mean
        density = _density(off / np.sqrt(variance)) / np.sqrt(variance)
        rise = (way * climb + slope * off) / rest
        return float(np.sum(weights * density * rest * (_density(rise) + rise * ndtr(rise))))

    @property
    def mean_period(self) -> float:
        """Mean zero-crossing period of the signal [s]."""
        return 1.0 / self.rate(0.0)

    @property
    def variance(self) -> float:
        """The variance of the signal, in its unit squared."""
        weights, mean, _, variance, _, _ = self._turns
        return float(np.sum(weights * (mean**2 + variance)) / np.sum(weights))

    @property
    def _switches(self) -> bool:
        return self.loss > 0.0 or self.reaction.size > 0

    @cached_property
    def _covariance(self) -> FloatArray:
        """Covariance of A, A', B, B', omega and omega', (6, 6)."""
        s = 1j * self.nodes.omega
        each = (self.linear, self.carried, self.speed)
        rows = np.stack([row for one in each for row in (one, s * one)])
        weighed = rows * (self.densities * self.nodes.weights)
        return np.asarray(np.einsum("iwk,jwk->ij", weighed.conj(), rows).real)

    @cached_property
    def _waves(self) -> tuple[FloatArray, FloatArray]:
        """Q and its slope over the phase, at the phases of `_turns`."""
        harmonics = np.arange(self.reaction.size)
        turned = np.exp(1j * np.outer(_PHASES, harmonics)) * self.reaction
        return 2.0 * turned.real.sum(axis=1), -2.0 * (turned.imag @ harmonics)

    @cached_property
    def _turns(self) -> tuple[FloatArray, ...]:
        """By phase and size of the motor's motion (p, r): weights, and what `rate` takes.

        Mean of C and of C', the variance of C, the slope of C' over C, and the deviation of C' that
        is left.
        """
        cov = self._covariance
        own, bend = math.sqrt(cov[4, 4]), math.sqrt(cov[5, 5])
        phase, size = _PHASES[:, np.newaxis], _SIZES[np.newaxis]
        turning = np.stack([own * size * np.sin(phase), bend * size * np.cos(phase)])
        s = np.tanh(turning[0] / self.turn)
        flip = (1.0 - s**2) * turning[1] / self.turn
        on = np.linalg.solve(cov[4:, 4:], cov[4:, :4]).T
        left = cov[:4, :4] - on @ cov[4:, :4]
        given = np.einsum("ij,jpr->ipr", on, turning)
        wave, slope = (one[:, np.newaxis] for one in self._waves)
        pace = bend / own
        mean = given[0] + s * (given[2] + self.loss) + wave
        climb = given[1] + s * given[3] + flip * (given[2] + self.loss) + slope * pace
        to_C = np.stack([np.ones_like(s), np.zeros_like(s), s, np.zeros_like(s)])
        to_slope = np.stack([np.zeros_like(s), np.ones_like(s), flip, s])
        both = np.stack([to_C, to_slope])
        products = np.einsum("aipr,ij,bjpr->abpr", both, left, both, optimize=True)
        # What follows the motor's speed in full has hardly a density of its own on this grid.
        variance = np.maximum(products[0, 0], _FOLLOWS**2 * cov[0, 0])
        ratio = products[0, 1] / variance
        rest = np.maximum(products[1, 1] - ratio * products[0, 1], 1e-12 * cov[1, 1])
        step = _SIZES[1] - _SIZES[0]
        weights = _SHARES[:, np.newaxis] * size * np.exp(-0.5 * size**2) * step
        return weights, mean, climb, variance, ratio, np.sqrt(rest)


def _density(x: npt.ArrayLike) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.square(x)) / math.sqrt(2.0 * math.pi))


def swing(share: float, gaussian: float) -> float:
    """Return the largest swing over that of a Gaussian signal, which is so many sigmas.

    `share` is that of quadratic drag in what holds the signal, 0 to 1: where the densities of both
    envelopes are as small, over the sigma of the linear loop with the drag's equivalent.
    """
    if share <= 0.0:
        return 1.0

    def fallen(swing: FloatArray | float) -> Any:
        return 0.5 * (1.0 - share) * swing**2 + share * _SWING / 3.0 * swing**3

    a = np.linspace(0.0, 10.0, 1001)
    whole = math.log(np.trapezoid(a * np.exp(-fallen(a)), a))
    lasting = 0.5 * gaussian**2 - whole
    return float(brentq(lambda x: fallen(x) - lasting, 0.0, 3.0 * gaussian)) / gaussian


def remnant_of_drag(rho: FloatArray) -> FloatArray:
    """Return the autocovariance of |v| v - sqrt(8/pi) sigma v over sigma^4, by that of v."""
    rho = np.clip(rho, -1.0, 1.0)
    whole = (1.0 + 2.0 * rho**2) * np.arcsin(rho) + 3.0 * rho * np.sqrt(1.0 - rho**2)
    return np.asarray(2.0 / math.pi * whole - 8.0 / math.pi * rho)


def image_frequencies(lines: FloatArray, hold: float) -> FloatArray:
    """Return where lines (l,) come again below and above multiples of 2 pi/hold, (2 i l,)."""
    about = 2.0 * math.pi / hold * np.arange(1, _IMAGES + 1)[:, np.newaxis]
    return np.stack([about - lines, about + lines]).ravel()


def crest(responses: ComplexArray) -> FloatArray:
    """Return by how much each signal's images are more than on average, where they are most, (o,).

    They follow a step of the readings and have died down before the next: a Gaussian number once
    a reading.  The responses (o, k) are at `image_frequencies`.
    """
    below, above = responses.reshape(len(responses), 2, _IMAGES, -1).swapaxes(0, 1)
    turn = np.exp(2j * np.pi * np.outer(np.arange(1, _IMAGES + 1), np.arange(64) / 64))
    each = np.einsum("okl,kt->olt", above, turn) + np.einsum("okl,kt->olt", below, turn).conj()
    power = np.sum(np.abs(each) ** 2, axis=1)
    mean = power.mean(axis=-1)
    return np.asarray(np.sqrt(power.max(axis=-1) / np.where(mean > 0.0, mean, 1.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchedLoop:
    """Signals of a closed loop with its losses in them."""

    loop: Assessment
    dragged: Assessment  #: The same with `DRAG_STEP` times the drag.
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
        """Return a signal as A + s (Delta + B) + Q."""
        nodes, densities, moving, still = self._known
        at = self.loop.plant.outputs.index
        plant, loss = self.question.plant, self.question.plant.loss.get(signal, 0.0)
        carried = np.zeros_like(still[0])
        if loss:
            dry = 0.0 if signal == _TENSION else self.question.data.coulomb_friction
            part = loss - self._share(signal) * dry
            carried = part / plant.static[_TENSION] * still[at(_TENSION)]
        harmonics = self._harmonics
        made = partial(
            SwitchedSignal,
            nodes=nodes,
            linear=still[at(signal)] * swing(self._held_by_drag[at(signal)], _LARGEST),
            carried=carried,
            speed=moving[at(_SPEED)],
            loss=loss,
            reaction=harmonics[at(signal)] if harmonics.size else harmonics,
        )
        if not harmonics.size:
            return made(densities=densities)
        # A resonance that outlasts a half turn is shaken at random times: what the deviation has
        # beyond what begins anew, and more than periods that scatter explain, is noise with the
        # remnant's spectrum.
        remnant = np.array([name == SET_POINT for name in self._names])[:, np.newaxis]
        known = made(densities=densities * ~remnant)
        shaken = nodes.integrate(
            np.sum(np.abs(still[at(signal)]) ** 2 * densities * remnant, axis=0)
        )
        lacks = _ANEW * self.deviation(signal) ** 2 - known.variance
        share = float(np.clip(lacks / shaken, 0.0, 1.0)) if shaken > 0.0 else 0.0
        return made(densities=densities * np.where(remnant, share, 1.0))

    @cached_property
    def _held_by_drag(self) -> FloatArray:
        """Share of quadratic drag in what holds each output, (o,), 0 to 1."""
        outputs = self.loop.plant.outputs
        if not any(element.lasting for element in self.loop.elements):
            return np.zeros(len(outputs))
        nodes, densities, still = self._shaken
        dragged = self.dragged.responses(outputs, self._names, nodes.omega, losses=False)
        now, then = (
            nodes.integrate(np.sum(np.abs(responses) ** 2 * densities, axis=1))
            for responses in (still, dragged)
        )
        return np.asarray(np.clip(np.log(now / then) / math.log(DRAG_STEP), 0.0, 1.0))

    @cached_property
    def _harmonics(self) -> ComplexArray:
        """Harmonics of what every output makes of the losses, (o, h), of a speed like sin(phi)."""
        noise = self.question.spectra.get(SET_POINT)
        if not isinstance(noise, SwitchingNoise):
            return np.zeros(0, dtype=np.complex128)
        nodes, densities, moving, _ = self._known
        row = np.abs(moving[self.loop.plant.outputs.index(_SPEED)]) ** 2
        power = np.sum(row * densities, axis=0) * nodes.weights
        speed, bend = math.sqrt(power.sum()), math.sqrt(power @ nodes.omega**2)
        phase = 2.0 * math.pi * np.arange(4 * _HARMONICS) / (4 * _HARMONICS)
        usual = math.sqrt(0.5 * math.pi) * speed / SWITCHING_TURN
        loss = noise.torque * np.fft.rfft(np.tanh(usual * np.sin(phase))) / phase.size
        odd = np.arange(1, _HARMONICS, 2)
        omega = np.asarray(odd * (bend / speed), dtype=np.float64)
        outputs, found = self.loop.plant.outputs, np.zeros((len(moving), _HARMONICS), np.complex128)
        answer = self.loop.responses(outputs, [SET_POINT], omega, losses=False)[:, 0]
        found[:, odd] = (
            -answer * loss[odd] / self.question.data.torque_per_command(np.asarray(1j * omega))
        )
        return found

    @cached_property
    def _names(self) -> list[str]:
        own = [source.name for source in self.loop.disturbances]
        return own if self._drag is None else [*own, self._drag.force]

    @property
    def _drag(self) -> DragElement | None:
        """The payload's drag; None where it has none that is quadratic."""
        drags = (one for one in self.loop.elements if isinstance(one, DragElement))
        return next((one for one in drags if one.quadratic > 0.0), None)

    @cached_property
    def _drag_remnant(self) -> tuple[FloatArray, FloatArray]:
        """Frequencies, and the density of the drag that is no friction [N2 s/rad]."""
        drag = self._drag
        assert drag is not None
        nodes = self.loop.quadrature([drag.velocity])
        density = self.loop.spectrum(drag.velocity, nodes.omega)
        moving = _Turning(omega=nodes.omega, velocity=density)
        size = drag.quadratic * nodes.integrate(density)
        return density_of(size**2 * remnant_of_drag(velocity_correlation(moving)))

    def _share(self, signal: str) -> float:
        loss = self.question.plant.loss
        return loss[signal] / loss[_TORQUE] if loss.get(signal, 0.0) else 0.0

    def _on_nodes(self, signals: tuple[str, ...]) -> tuple[Quadrature, FloatArray, ComplexArray]:
        """Return nodes, densities (w, k) and responses (o, w, k) of signals to all that shakes."""
        nodes, densities, responses, _ = self._known
        at = [self.loop.plant.outputs.index(one) for one in signals]
        return nodes, densities, responses[at]

    @cached_property
    def _known(self) -> tuple[Quadrature, FloatArray, ComplexArray, ComplexArray]:
        """Nodes for all outputs of the plant, and there densities and responses (o, w, k).

        Responses as the loop moves, and of the loop without losses, with images at their most.
        """
        outputs, (nodes, densities, still) = self.loop.plant.outputs, self._shaken
        omega = nodes.omega
        responses = self.loop.responses(outputs, self._names, omega)
        density = np.sum(np.abs(responses) ** 2 * densities, axis=1)
        found = [(omega, nodes.weights, densities, responses, still)]
        for name, omega, shares in self._images(nodes, dict(zip(outputs, density, strict=True))):
            # They stand where the first of the sources does, which has nothing there.
            from_readings = self.loop.responses(outputs, [name], omega)
            others = len(self._names) - 1
            heard = np.pad(from_readings, ((0, 0), (0, others), (0, 0)))
            most = heard * crest(from_readings[:, 0])[:, np.newaxis, np.newaxis]
            shares = np.pad(shares[np.newaxis], ((0, others), (0, 0)))
            found.append((omega, np.ones_like(omega), shares, heard, most))
        omega, weights, densities, responses, still = (
            np.concatenate(part, axis=-1) for part in zip(*found, strict=True)
        )
        order = np.argsort(omega)
        nodes = Quadrature(omega=omega[order], weights=weights[order])
        return nodes, densities[:, order], responses[:, :, order], still[:, :, order]

    @cached_property
    def _shaken(self) -> tuple[Quadrature, FloatArray, ComplexArray]:
        """The loop's own nodes, densities there, and responses without losses (o, w, k)."""
        outputs = self.loop.plant.outputs
        nodes = self.loop.quadrature(outputs)
        omega = nodes.omega
        densities = np.stack(
            [np.broadcast_to(self._density(i, omega), omega.shape) for i in range(len(self._names))]
        )
        return nodes, densities, self.loop.responses(outputs, self._names, omega, losses=False)

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
            omega = image_frequencies(lines, hold)
            yield f"{name}_noise", omega, np.full(omega.size, shares[-1] / _LINES)

    def _density(self, index: int, omega: FloatArray) -> FloatArray:
        if index == len(self.loop.disturbances):
            return np.interp(omega, *self._drag_remnant, right=0.0)
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
