"""Disturbances of each row of a sweep: densities of the hook's motion on common nodes.

Mostly the sea does not vary, or only its height, which is a factor; with its period, a standard
spectrum keeps its shape, S(omega; H, T) = (H/H0)^2 (T/T0) S(omega T/T0; H0, T0).  Whether that
holds for the case at hand is tried on some rows; where it does not, every different sea goes
through its own case.
"""

import numpy as np

from models.basics import FloatArray
from models.case import Case
from models.hook import HookMotion
from models.sensing import SwitchingShape
from models.spread import Spread

_HEIGHT = "sea.significant_height"
_PERIODS = ("sea.peak_period", "sea.significant_period")
_SEA = ("sea.", "vessel.")
_TRIED = 5
_AGREE = 1e-10
_PROBES = np.geomspace(0.05, 50.0, 60)


class SeaRows:
    """Densities of the hook's motion of the rows of a spread on a case."""

    def __init__(self, case: Case, spread: Spread) -> None:
        self.spread = spread
        self.hook = HookMotion.from_case(case, warn=False)
        self._columns = [j for j, p in enumerate(spread.paths) if p.startswith(_SEA)]
        self._known: dict[bytes, HookMotion] = {}
        self._shapes: dict[bytes, SwitchingShape] = {}
        names = {spread.paths[j] for j in self._columns}
        # How the density follows from the case's own: a factor, a stretch, or not at all.
        self._height = _HEIGHT if _HEIGHT in names else None
        self._period = next((p for p in _PERIODS if p in names), None)
        self._scales = True
        self._scales = self._holds(names)

    @property
    def varies(self) -> bool:
        """Whether rows differ in more than a factor."""
        return not self._scales or self._period is not None

    def frame(self) -> tuple[float, float, list[float]]:
        """Return the band that holds all densities, and where they have kinks or end [rad/s]."""
        hooks = [self.hook]
        if self.varies:
            # Ends and some in between: a kink that lies elsewhere meets panels that are short.
            hooks += [self._own(row) for row in self._some(16)]
        low, high = min(h.band[0] for h in hooks), max(h.band[1] for h in hooks)
        splits = sorted({w for h in hooks for w in (*h.band, *h.splits) if w > 0.0})
        return low, high, splits

    def factors(self, rows: FloatArray) -> FloatArray:
        """Return the factor on the common density of each row, (n,) or (1,)."""
        if not self._scales or self._height is None or not len(rows):
            return np.ones(1)
        j = self.spread.paths.index(self._height)
        factor: FloatArray = (rows[:, j] / self.spread.nominal[self._height]) ** 2
        return factor

    def heave_rms(
        self, rows: FloatArray, ratios: FloatArray | None, weights: FloatArray
    ) -> FloatArray:
        """Return the standard deviation of the hook's heave of each row, (n,) or (1,) [m].

        `weights` are those of the nodes that `ratios` are at.
        """
        own = float(self.hook.displacement.rms)
        common = np.array([own**2]) if ratios is None else ratios @ weights
        return np.asarray(np.sqrt(common * self.factors(rows)))

    def density(self, omega: FloatArray) -> FloatArray:
        """Return the case's own density at nodes, (k,) [m2 s/rad]."""
        return np.asarray(self.hook.density(omega))

    def ratios(self, rows: FloatArray, omega: FloatArray) -> FloatArray | None:
        """Return density over factor of each row at the nodes, (n, k); None if it is common."""
        if not self.varies:
            return None
        if not self._scales or self._period is None:
            return np.stack([np.asarray(self._own(row).density(omega)) for row in rows])
        j = self.spread.paths.index(self._period)
        stretch = rows[:, j] / self.spread.nominal[self._period]
        sea = np.asarray(self.hook.sea.density((stretch[:, None] * omega).ravel()))
        heave = np.abs(self.hook.rao.response(omega)) ** 2
        return np.asarray(sea.reshape(len(rows), -1) * stretch[:, None] * heave)

    def switching(self, rows: FloatArray, omega: FloatArray, haul: FloatArray) -> FloatArray:
        """Return the density of what losses are besides friction, (n, k) or (1, k) [s/rad].

        Over their square, see `models.sensing.SwitchingShape`; `haul` is the rope that a turn of
        each motor hauls, (n,) or (1,) [m].
        """
        if self.varies:
            found = np.empty((len(rows), omega.size))
            for k, (row, per) in enumerate(np.broadcast(range(len(rows)), haul)):
                shape = self._shape(rows[row])
                found[k] = shape.at(omega, float(shape.hook.velocity.rms) / float(per))
            return found
        own = self._shape(np.array([self.spread.nominal[path] for path in self.spread.paths]))
        speeds = np.sqrt(self.factors(rows)) * float(self.hook.velocity.rms) / haul
        if np.ptp(speeds) == 0.0:
            return own.at(omega, float(speeds[0]))[None]
        return own.rows(omega, speeds)

    def _shape(self, row: FloatArray) -> SwitchingShape:
        key = row[self._columns].tobytes()
        if key not in self._shapes:
            if len(self._shapes) > 100:
                self._shapes.clear()
            self._shapes[key] = SwitchingShape(self._own(row) if self.varies else self.hook)
        return self._shapes[key]

    def _holds(self, names: set[str]) -> bool:
        """Return whether the scaling holds on some rows, and nothing else of the sea varies."""
        if names - {self._height, self._period}:
            return False
        if self._period is not None:
            plain = np.abs(self.hook.rao.response(_PROBES)) ** 2 * self.hook.sea.density(_PROBES)
            if not np.allclose(plain, self.hook.density(_PROBES), rtol=_AGREE, atol=0.0):
                return False
        for row in self._some(_TRIED) if names else ():
            own = np.asarray(self._own(row).density(_PROBES))
            common = self.ratios(row[None], _PROBES)
            found = self.density(_PROBES) if common is None else common[0]
            found = found * self.factors(row[None])[0]
            if np.any(np.abs(found - own) > _AGREE * np.maximum(own, 1e-12 * own.max())):
                return False
        return True

    def _some(self, count: int) -> list[FloatArray]:
        """Return rows at the ends of what varies of the sea, and some in between."""
        own = list(self.spread.distributions.values())
        middle = np.array([field.nominal for field in self.spread.fields])
        rows = []
        for j in self._columns:
            for end in own[j].ends:
                row = middle.copy()
                row[j] = end
                rows.append(row)
        return [*rows, *self.spread.sample(count, "random")]

    def _own(self, row: FloatArray) -> HookMotion:
        """Return the hook's motion of a row, through its own case."""
        key = row[self._columns].tobytes()
        if key not in self._known:
            if len(self._known) > 20_000:
                self._known.clear()
            assert self.spread.case is not None
            changes = {self.spread.paths[j]: float(row[j]) for j in self._columns}
            self._known[key] = HookMotion.from_case(self.spread.case.variant(changes))
        return self._known[key]
