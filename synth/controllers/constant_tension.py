r"""Constant tension: the winch gives way to the rope's tension, and knows nothing else.

::

    set-point --(+)--> dead band --> gain --(+)--> drum-speed loop --> command
                 ^-                          ^ reference velocity - centring x (haul - reference)
        load cell at the drum

The competitor of the 1975 thesis (its chapter on methods): only the tension at the rope's upper
end is measured, and the drum pays out when it is too high.  Below the resonance of rope and
payload the tension hardly tells anything, as the payload follows the hook with next to no
force: T = M P''.  Friction and the load cell's noise demand a dead band, within which nothing
is done at all; and as constant tension is had at any depth, the payload's position is free and
drifts.  The weak centring on the drum's haul stands for the operator who now and then winds the
drum back.

The tension is proportional, w_ref = (n/r) gain (T_set - T).  There is no integral: the drum
integrates already, and an integral of the tension would turn a load cell's bias into a drum
that runs faster and faster.

The gain is a speed per force, and gain K (K = EA/L) is the bandwidth of the tension while the
payload stands still.  By default it is a quarter of the drum-speed loop's, lowered until the
linear plant with all its rope modes is stable with twice that gain too: a drum that gives way in
phase with the tension damps every mode of the rope, but load cell and drum are late.
"""

from dataclasses import dataclass

import casadi as ca

from models.basics import SynthesisError, check_range
from models.case import Case
from models.plant import Plant, build_plant

from ..structures import (
    DrumSpeedLoop,
    RecursiveController,
    SampledLoop,
    Signals,
    make_recursion,
    sampled_loop,
)

_OWNER = "constant tension"
_DEAD_BAND = 0.02  # of the set-point: what friction of sheaves and drum hides at the least [-]
_BANDWIDTH = 0.25  # of the tension over that of the drum's speed [-]
_MARGIN = 2.0  # gain margin of the loop [-]
_LESS, _TRIES = 0.8, 40  # how the gain is lowered until it has that margin


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class ConstantTension(RecursiveController):
    """Rope tension held at a set-point, within a dead band.

    Parameters
    ----------
    case
        The case; its load cell is taken as perfect if it has none.
    set_point
        Tension at the drum [N]; by default that of the load at rest.
    dead_band
        Deviation that is ignored, as a fraction of the set-point; by default two standard
        deviations of the load cell's noise, at least 0.02.
    gain
        Speed of the rope per tension [m/s/N]; by default as large as suits the case.
    centring
        Rate at which the drum is wound back [1/s].
    sample_time
        T [s].
    bandwidth
        That of the drum-speed loop [rad/s], see `DrumSpeedLoop.from_case`.

    Raises
    ------
    InputError
        If a number is out of its range.
    SynthesisError
        If the loop is not stable on the linear plant with the gain given, or with any.
    """

    set_point: float
    dead_band: float
    gain: float
    centring: float
    loop: DrumSpeedLoop

    def __init__(
        self,
        case: Case,
        *,
        set_point: float | None = None,
        dead_band: float | None = None,
        gain: float | None = None,
        centring: float = 0.01,
        sample_time: float = 0.02,
        bandwidth: float | None = None,
    ) -> None:
        plant = build_plant(case)
        rest = plant.operating_point().tension
        loop = DrumSpeedLoop.from_case(
            case, sample_time=sample_time, bandwidth=bandwidth, plant=plant
        )
        cell = case.sensors.load_cell
        band = max(_DEAD_BAND, 2.0 * cell.noise_fraction if cell else 0.0)
        self._set(
            set_point=check_range(
                _OWNER,
                "set_point",
                rest if set_point is None else set_point,
                low=0.0,
                high=10.0 * rest,
                unit="N",
            ),
            dead_band=check_range(
                _OWNER, "dead_band", band if dead_band is None else dead_band, low=0.0, high=1.0
            ),
            centring=check_range(_OWNER, "centring", centring, low=0.0, high=1.0, unit="1/s"),
            loop=loop,
        )
        chosen = self._chosen_gain(case, plant) if gain is None else gain
        self._set(gain=check_range(_OWNER, "gain", chosen, low=0.0, unit="m/s/N", open_low=True))
        if not self.linear_loop(case, plant).stable:
            raise SynthesisError(
                f"{_OWNER}: with a gain of {self.gain:.4g} m/s/N and a sample time of "
                f"{sample_time:g} s the tension is not stable on the linear plant; ask for less"
            )
        self._adopt("constant-tension", sample_time, loop.initial, self._law)

    def linear_loop(
        self,
        case: Case,
        plant: Plant | None = None,
        *,
        gain: float | None = None,
        drag: float = 0.0,
    ) -> SampledLoop:
        """Return the loop without the dead band, about the load at rest.

        The rate at which the drum gives way is the same about any set-point.

        Parameters
        ----------
        case, plant
            The case, and its plant if it is there already.
        gain
            Another gain than its own [m/s/N].
        drag
            Linear drag of the payload [N s/m].
        """
        plant = build_plant(case) if plant is None else plant
        rest = plant.operating_point().tension

        def law(xc: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
            # Of a set-point far from it the speed limit would be all that is seen.
            return self._respond(
                xc, m, rest - m["rope.tension"], self.gain if gain is None else gain
            )

        recursion = make_recursion(self.loop.initial, law)
        return sampled_loop(case, plant, recursion, self.loop.sample_time, drag=drag)

    def _chosen_gain(self, case: Case, plant: Plant) -> float:
        gain = _BANDWIDTH * self.loop.bandwidth / plant.data.stiffness
        for _ in range(_TRIES):
            if all(self.linear_loop(case, plant, gain=k * gain).stable for k in (1.0, _MARGIN)):
                return gain
            gain *= _LESS
        raise SynthesisError(
            f"{_OWNER}: no gain is stable on the linear plant at a sample time of "
            f"{self.loop.sample_time:g} s; ask for a shorter one"
        )

    def _law(self, xc: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
        error, band = self.set_point - m["rope.tension"], self.dead_band * self.set_point
        error = m["load_cell.valid"] * (ca.fmax(0, error - band) + ca.fmin(0, error + band))
        return self._respond(xc, m, error, self.gain)

    def _respond(self, xc: ca.SX, m: Signals, error: ca.SX, gain: float) -> tuple[ca.SX, ca.SX]:
        """Return next state and command for a lack of tension [N]."""
        away = m["drum.haul"] - m["reference.displacement"]
        rope_speed = m["reference.velocity"] + gain * error - self.centring * away
        return self.loop.command(xc, rope_speed, m)
