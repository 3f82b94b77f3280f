"""The rows of numbers that a run's recursion reads, one for each control sample.

    hook, deck, surface --+
    noise, telemetry, MRU -+--> row: motions at the ends of every step | sensors | flags
    schedule -------------+

Everything that does not hang on the plant is made here, chunk by chunk, from the seed alone; the
layout is that of `models.simulation.closed_loop`.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..basics import FloatArray
from ..operation import Motion, MotionBlock, Schedule
from ..sensing import NOISE, MruModel, MruState, SensorModel, TelemetrySchedule

FLAGS = ("engaged", "brake")
"""The last columns: share of the controller's command that reaches the drive, brake closed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RowMaker:
    """Makes the rows of one run."""

    #: The hook's motion first, then whatever else moves, at the integration step.
    motions: tuple[Motion, ...]
    substeps: int  #: Integration steps in a sample.
    #: What belongs to the sensors, and what is asked of the run.
    sensors: SensorModel
    telemetry: TelemetrySchedule
    mru: MruModel
    schedule: Schedule
    seed: int  #: Seed of the run.
    closing_time: float  #: Time that the brake takes to close [s]; it opens at once.
    always_braked: bool = False  #: The brake stays closed, whatever the schedule says.

    def start(self) -> MruState:
        """Return the state of the reference unit before the first row."""
        z, v = self.mru.heard(self._hook, 0, 1)
        return self.mru.initial(float(z[0]), float(v[0]))

    def block(self, start: int, count: int, mru: MruState) -> tuple[FloatArray, MruState]:
        """Return the rows of the samples from `start` on (count, columns), and the MRU's state."""
        n = self.substeps
        moved = [_moved(motion, start * n, count * n + 1) for motion in self.motions]
        columns = 3 * len(moved) * (n + 1)
        rows = np.empty((count, columns + len(self.sensors.row) + len(FLAGS)))
        for j in range(n + 1):
            for i, ends in enumerate(moved):
                for k, values in enumerate(ends):
                    column = 3 * (len(moved) * j + i) + k
                    rows[:, column] = values[j : j + (count - 1) * n + 1 : n]
        heave, rate = (values[: count * n : n] for values in moved[0][:2])
        if self.mru.coherent:
            heave, rate = self.mru.heard(self._hook, start, count)
        shown, mru = self.mru.block(mru, heave, rate)
        planned = self.schedule.block(start, count)
        noise = np.zeros((count, len(NOISE)))
        if self.sensors.noisy:  # numbers that nobody reads are not drawn
            noise = self.sensors.noise(self.seed, start, count)
        link = self.telemetry.block(start, count)
        sensed = self.sensors.rows(noise, link, shown, planned.reference, planned.switches)
        rows[:, columns : -len(FLAGS)] = sensed
        rows[:, -2] = planned.engage
        rows[:, -1] = self._brake(planned.brake, start)
        return rows, mru

    def _hook(self, start: int, count: int) -> tuple[FloatArray, FloatArray]:
        """Return the hook's displacement and velocity at samples.

        Before and after the run it goes on as if turned about its ends: at zero it would jump, and
        a unit that hears what is to come would show that.
        """
        n, motion = self.substeps, self.motions[0]
        last = (motion.rows - 1) // n
        turn, place = np.divmod(np.arange(start, start + count), last)
        odd = turn % 2 != 0
        place = np.where(odd, last - place, place)
        low, high = int(place.min()), int(place.max())
        z, v = (values[::n] for values in motion.block(low * n, (high - low) * n + 1)[:2])
        first, end = (float(motion.block(k * n, 1)[0][0]) for k in (0, last))
        z = z[place - low]
        further = np.where(odd, (turn + 1) * end - (turn - 1) * first, turn * (end - first))
        return further + np.where(odd, -z, z), v[place - low]

    def trip(self, rows: FloatArray, first: int, since: float) -> None:
        """Write into rows of `block` that the brake closes at a time [s] and the command ends.

        `first` is the number of the first sample in them.
        """
        time = self.schedule.sample_time * np.arange(first, first + len(rows)) - since
        closed = np.clip(time / self.closing_time, 0.0, 1.0) if self.closing_time else time >= 0.0
        late = time > 0.0
        rows[late, -2] = 0.0
        rows[late, -1] = np.maximum(rows[late, -1], closed[late])

    def _brake(self, wanted: FloatArray, start: int) -> FloatArray:
        """Return how far the brake is closed, following the order at a limited rate."""
        if self.always_braked:
            return np.ones(len(wanted))
        if self.closing_time <= 0.0 or not wanted.any():
            return wanted
        back = math.ceil(self.closing_time / self.schedule.sample_time)
        first = max(0, start - back)
        before = self.schedule.block(first, start - first).brake
        asked = np.concatenate([before, wanted])
        # The brake closes after its order, and is fully open as soon as it is to be open: the
        # mean of the orders over the closing time, where it is asked for.
        if first == 0:
            asked = np.concatenate([np.full(back - start, asked[0]), asked])
        total = np.concatenate([[0.0], np.cumsum(asked)])
        mean = (total[back:] - total[:-back]) / back
        result: FloatArray = np.minimum(mean[-len(wanted) :], wanted)
        return result


def _moved(motion: Motion, start: int, count: int) -> MotionBlock:
    """Return rows of a motion; after its end it stands still where it is.

    The last sample of a run is logged at the end of the motion; the step after it has none.
    """
    there = min(count, motion.rows - start)
    z, v, a = motion.block(start, there)
    if there == count:
        return z, v, a
    rest = np.zeros(count - there)
    return np.append(z, rest + z[-1]), np.append(v, rest), np.append(a, rest)
