"""The linear plant: the one thing that gain synthesis and linear MPC know of the world.

Any plant with named signals will do, a user's own included::

    x' = A x + B u + E w          w: disturbances, u: inputs
    y  = C x + D u + F w          measured, y_i late by delays[i]
    z  = Cz x + Dz u + Fz w       performance outputs

`Plant.linearise` makes one of the winch; synthesis takes its frequency responses
(`PlantResponse`), the verification its poles, MPC its sampled form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from ..basics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    InputError,
    ReadOnlyArrays,
    check_choice,
    check_finite,
    check_range,
    pick,
    read_only,
    signal_delays,
    signal_names,
    signal_rates,
)
from .pade import pade_bank
from .resolvent import Resolvent, Transfer
from .response import PlantResponse

if TYPE_CHECKING:
    import control

_OWNER = "linear plant"
_ROUNDING = 8.0 * float(np.finfo(float).eps)  # of a sum, relative to its parts
_HAIR = 1e-8  # relative distance at which 1/(s - pole) leaves a closed loop eight digits


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class LinearPlant(ReadOnlyArrays):
    """A linear, time-invariant plant with named signals and delayed measurements.

    Raises InputError if shapes disagree, a number is not finite, a name is repeated or unknown, or
    a delay is negative.
    """

    #: State matrices, (n, n), (n, nu), (n, nw).
    A: FloatArray
    B: FloatArray
    E: FloatArray
    #: Measurement matrices, (ny, n), (ny, nu), (ny, nw); D and F default to zero.
    C: FloatArray
    D: FloatArray
    F: FloatArray
    #: Matrices of the performance outputs, (nz, n), (nz, nu), (nz, nw); without Cz there are no
    #: outputs, Dz and Fz default to zero.
    Cz: FloatArray
    Dz: FloatArray
    Fz: FloatArray
    #: Names, by default x1.., u1.., w1.., y1.., z1..
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    disturbances: tuple[str, ...]
    measurements: tuple[str, ...]
    outputs: tuple[str, ...]
    #: Delay of each measurement [s], in order or by name; default 0.  Half of what `holds` says is
    #: part of it.
    delays: tuple[float, ...]
    #: Time for which a reading of each measurement is held [s], in order or by name; default 0, for
    #: none.  With T of that time and a delay d a response has the factor exp(-s (d - T/2)) (1 -
    #: exp(-s T))/(s T), of phase -omega d: exact below the frequencies that readings fold.
    holds: tuple[float, ...]
    #: Disturbances that are the time derivative of another one, {"rate": "of"}: their column times
    #: s is added to that of the other one in every response.
    rates: Mapping[str, str]
    units: Mapping[str, str]  #: Unit of a signal by name, for reports.
    static: Mapping[str, float]  #: Value of a signal at the operating point by name, in its unit.
    #: How far a loss that switches with the direction of motion carries a signal to either side of
    #: that value, by name, in its unit; nothing for others.
    loss: Mapping[str, float]

    def __init__(
        self,
        *,
        A: npt.ArrayLike,
        B: npt.ArrayLike,
        E: npt.ArrayLike,
        C: npt.ArrayLike,
        D: npt.ArrayLike | None = None,
        F: npt.ArrayLike | None = None,
        Cz: npt.ArrayLike | None = None,
        Dz: npt.ArrayLike | None = None,
        Fz: npt.ArrayLike | None = None,
        states: Sequence[str] = (),
        inputs: Sequence[str] = (),
        disturbances: Sequence[str] = (),
        measurements: Sequence[str] = (),
        outputs: Sequence[str] = (),
        delays: Sequence[float] | Mapping[str, float] = (),
        holds: Sequence[float] | Mapping[str, float] = (),
        rates: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        static: Mapping[str, float] | None = None,
        loss: Mapping[str, float] | None = None,
    ) -> None:
        A, B, E, C = (_matrix(n, v) for n, v in (("A", A), ("B", B), ("E", E), ("C", C)))
        Cz = np.zeros((0, A.shape[0])) if Cz is None else _matrix("Cz", Cz)
        n, nu, nw, ny, nz = A.shape[0], B.shape[1], E.shape[1], C.shape[0], Cz.shape[0]
        shapes = {"A": (n, n), "B": (n, nu), "E": (n, nw), "C": (ny, n), "D": (ny, nu)}
        shapes |= {"F": (ny, nw), "Cz": (nz, n), "Dz": (nz, nu), "Fz": (nz, nw)}
        given = {"A": A, "B": B, "E": E, "C": C, "D": D, "F": F, "Cz": Cz, "Dz": Dz, "Fz": Fz}
        for name, shape in shapes.items():
            value = given[name]
            matrix = np.zeros(shape) if value is None else _matrix(name, value)
            if matrix.shape != shape:
                raise InputError(
                    f"{_OWNER}: {name} must have the shape {shape} that A, B, E, C and Cz "
                    f"ask for, got {matrix.shape}"
                )
            object.__setattr__(self, name, read_only(matrix))
        for kind, names, letter, count in (
            ("states", states, "x", n),
            ("inputs", inputs, "u", nu),
            ("disturbances", disturbances, "w", nw),
            ("measurements", measurements, "y", ny),
            ("outputs", outputs, "z", nz),
        ):
            object.__setattr__(self, kind, signal_names(_OWNER, kind, names, letter, count))
        for name in self.disturbances:
            if name in self.inputs:
                raise InputError(
                    f"{_OWNER}: names of inputs and disturbances must differ, got {name!r} in both"
                )
        late = signal_delays(_OWNER, self.measurements, delays)
        object.__setattr__(self, "delays", late)
        held = signal_delays(_OWNER, self.measurements, holds)
        for name, delay, hold in zip(self.measurements, late, held, strict=True):
            check_range(_OWNER, f"delay of {name}", delay, low=0.5 * hold, unit="s")
        object.__setattr__(self, "holds", held)
        object.__setattr__(self, "rates", signal_rates(_OWNER, self.disturbances, rates or {}))
        known = {*self.states, *self.inputs, *self.disturbances}
        known |= {*self.measurements, *self.outputs}
        named = ("units", units or {}), ("static", static or {}), ("loss", loss or {})
        for kind, mapping in named:
            pick(_OWNER, f"signal (in {kind})", sorted(known), list(mapping))
        object.__setattr__(self, "units", MappingProxyType(dict(units or {})))
        values = {k: check_range(_OWNER, f"static {k}", v) for k, v in (static or {}).items()}
        object.__setattr__(self, "static", MappingProxyType(values))
        values = {k: check_range(_OWNER, f"loss {k}", v, low=0.0) for k, v in (loss or {}).items()}
        object.__setattr__(self, "loss", MappingProxyType(values))

    @property
    def independent_disturbances(self) -> tuple[str, ...]:
        """Names of the disturbances that are not the rate of another one."""
        return tuple(name for name in self.disturbances if name not in self.rates)

    def response(self, omega: npt.ArrayLike) -> PlantResponse:
        """Return the frequency response at `omega` [rad/s], (k,), delays exact.

        Raises InputError if a frequency is not finite or is that of an undamped pole (0 of an
        integrator).
        """
        return self.response_at(1j * check_finite(_OWNER, "omega", omega).reshape(-1))

    def response_at(self, s: npt.ArrayLike) -> PlantResponse:
        """Return the response at points `s` of the complex plane [1/s], (k,).

        Raises InputError if a point is not finite or is a pole of the plant.
        """
        points = np.array(s, dtype=np.complex128).reshape(-1)
        check_finite(_OWNER, "s", points.view(np.float64))
        if len(self.A) and np.any(points == 0.0) and _integrates(self.A):
            raise InputError(
                f"{_OWNER}: the response is asked for at s = 0, where the plant has a pole "
                "(an integrator); ask above zero"
            )
        transfer, direct, keep = self._transfer
        rows = transfer(points)
        if rows is None:
            raise InputError(
                f"{_OWNER}: the response is asked for at a pole of the plant, s = "
                f"{_nearest(self.poles(), points):.6g} 1/s"
            )
        at, of = np.nonzero(direct)
        rows[:, at, of] += direct[at, of]
        nu, ny = len(self.inputs), len(self.measurements)
        width = nu + len(keep)
        for k, base in enumerate(self.rates.values()):  # the last columns are the ones times s
            column = nu + self.independent_disturbances.index(base)
            rows[:, :, column] += points[:, None] * rows[:, :, width + k]
        rows[:, :ny] *= late_and_held(points[:, None], self.delays, self.holds)[:, :, None]
        y, z = rows[:, :ny, :width], rows[:, ny:, :width]
        return PlantResponse(
            s=points,
            zw=z[:, :, nu:],
            zu=z[:, :, :nu],
            yw=y[:, :, nu:],
            yu=y[:, :, :nu],
            inputs=self.inputs,
            disturbances=self.independent_disturbances,
            measurements=self.measurements,
            outputs=self.outputs,
        )

    def poles(self) -> ComplexArray:
        """Return the eigenvalues of A, (n,) [1/s]; delays have none."""
        return self.resolvent.poles

    def beside_poles(self, omega: FloatArray) -> FloatArray:
        """Return frequencies [rad/s], (k,), those at an undamped pole moved a hair off it.

        The responses have no value there, while those of a loop closed around the plant do,
        and next to it they are the same.
        """
        moved = np.array(omega, dtype=np.float64)
        for at in self.resolvent.undamped:
            close = np.abs(moved - at) < _HAIR * at
            moved[close] = at * (1.0 + _HAIR * np.where(moved[close] < at, -1.0, 1.0))
        return moved

    @cached_property
    def resolvent(self) -> Resolvent:
        """(s I - A)^-1, the same for all plants that are made of this one by `select`."""
        return Resolvent(self.A)

    @cached_property
    def _transfer(self) -> tuple[Transfer, FloatArray, list[int]]:
        """C (s I - A)^-1 B and D of all signals, (ny + nz, nu + nw + rates), and nw's indices.

        What is the time derivative of another signal is s times that.  An acceleration is the sum
        of forces that next to cancel at low frequency: at a hundred-thousandth of a rope's first
        mode half a per cent of it would be rounding.
        """
        keep = pick(_OWNER, "disturbance", self.disturbances, self.independent_disturbances)
        columns = [*keep, *pick(_OWNER, "disturbance", self.disturbances, list(self.rates))]
        C, B = np.vstack([self.C, self.Cz]), np.hstack([self.B, self.E[:, columns]])
        direct = np.block([[self.D, self.F[:, columns]], [self.Dz, self.Fz[:, columns]]])
        slopes = _slopes(self.A, B, C, direct)
        for i, (_, at_once) in slopes.items():
            direct[i, at_once] = 0.0
        plain = [i for i in range(len(C)) if i not in slopes]
        of_plain = self.resolvent.between(C[plain], B)

        def transfer(s: ComplexArray) -> ComplexArray | None:
            part = of_plain(s)
            if part is None or not slopes:
                return part
            rows = np.empty((s.size, *direct.shape), dtype=np.complex128)
            rows[:, plain] = part
            for i, (j, _) in slopes.items():
                rows[:, i] = s[:, None] * rows[:, j]
            return rows

        return transfer, direct, keep

    def _with(self, **changes: Any) -> LinearPlant:
        """Return it with changes that need no check: they follow from what has been checked."""
        plant = object.__new__(LinearPlant)
        for field in fields(self):
            value = changes.get(field.name, getattr(self, field.name))
            object.__setattr__(plant, field.name, value)
        plant.__post_init__()
        if "A" not in changes:
            object.__setattr__(plant, "resolvent", self.resolvent)
        return plant

    def with_element(self, output: str, disturbance: str, gain: float) -> LinearPlant:
        """Return the plant with `disturbance` += `gain` times `output` closed around it.

        Linear drag is such an element: a force of -C times the payload's velocity.

        Raises InputError if a name is unknown, or the output has a direct term.
        """
        v = pick(_OWNER, "output", self.outputs, [output])[0]
        f = pick(_OWNER, "disturbance", self.disturbances, [disturbance])[0]
        if np.any(self.Dz[v]) or np.any(self.Fz[v]):
            raise InputError(f"{_OWNER}: {output} must have no direct term to be fed back")
        row = gain * self.Cz[v]
        return self._with(
            A=self.A + np.outer(self.E[:, f], row),
            C=self.C + np.outer(self.F[:, f], row),
            Cz=self.Cz + np.outer(self.Fz[:, f], row),
        )

    def with_disturbance(
        self, name: str, per_state: Mapping[str, float], per_output: Mapping[str, float]
    ) -> LinearPlant:
        """Return the plant with one more disturbance: what it makes of states' rates and outputs.

        Raises InputError if a signal is unknown, or the name is one of an input or of a
        disturbance.
        """
        if name in (*self.inputs, *self.disturbances):
            raise InputError(f"{_OWNER}: the name of a disturbance must be new, got {name!r}")
        moved, shown = np.zeros((len(self.A), 1)), np.zeros((len(self.Cz), 1))
        moved[pick(_OWNER, "state", self.states, list(per_state)), 0] = list(per_state.values())
        shown[pick(_OWNER, "output", self.outputs, list(per_output)), 0] = list(per_output.values())
        return self._with(
            E=np.hstack([self.E, moved]),
            F=np.hstack([self.F, np.zeros((len(self.F), 1))]),
            Fz=np.hstack([self.Fz, shown]),
            disturbances=(*self.disturbances, name),
        )

    def opened(self, output: str, disturbance: str) -> LinearPlant:
        """Return the plant with an output measured and a disturbance commanded, last of their kind.

        What acts from the one to the other, such as drag, is then a loop around it like any other.
        Its measurement and its input bear their names with a question mark.

        Raises InputError if a name is unknown.
        """
        v = pick(_OWNER, "output", self.outputs, [output])
        f = pick(_OWNER, "disturbance", self.disturbances, [disturbance])
        return self._with(
            B=np.hstack([self.B, self.E[:, f]]),
            C=np.vstack([self.C, self.Cz[v]]),
            D=np.block([[self.D, self.F[:, f]], [self.Dz[v], self.Fz[np.ix_(v, f)]]]),
            F=np.vstack([self.F, self.Fz[v]]),
            Dz=np.hstack([self.Dz, self.Fz[:, f]]),
            inputs=(*self.inputs, f"{disturbance}?"),
            measurements=(*self.measurements, f"{output}?"),
            delays=(*self.delays, 0.0),
            holds=(*self.holds, 0.0),
        )

    def with_feedback(
        self, A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray
    ) -> LinearPlant:
        """Return the plant with a controller x' = A x + B y, u = C x + D y + v around it.

        Its inputs are the v that are added to the controller's commands, under their names.

        Raises InputError if a measurement is late: `without_delays` first.
        """
        if any(self.delays):
            raise InputError(
                f"{_OWNER}: no rational loop can be closed with delays {self.delays} s"
            )
        inverse = np.linalg.inv(np.eye(len(self.inputs)) - D @ self.D)
        # u = inverse (C x_c + D (C x + F w) + v), then y and z with it.
        states = inverse @ np.hstack([D @ self.C, C])
        shaken = inverse @ D @ self.F
        heard = np.hstack([self.C, np.zeros((len(self.C), len(A)))]) + self.D @ states
        heard_w = self.F + self.D @ shaken
        moved = np.hstack([self.A, np.zeros((len(self.A), len(A)))]) + self.B @ states
        own = np.hstack([np.zeros((len(A), len(self.A))), A]) + B @ heard
        return self._with(
            A=np.vstack([moved, own]),
            B=np.vstack([self.B @ inverse, B @ self.D @ inverse]),
            E=np.vstack([self.E + self.B @ shaken, B @ heard_w]),
            C=heard,
            D=self.D @ inverse,
            F=heard_w,
            Cz=np.hstack([self.Cz, np.zeros((len(self.Cz), len(A)))]) + self.Dz @ states,
            Dz=self.Dz @ inverse,
            Fz=self.Fz + self.Dz @ shaken,
            states=(*self.states, *(f"controller.x{i + 1}" for i in range(len(A)))),
        )

    def select(
        self,
        *,
        outputs: Sequence[str] | None = None,
        measurements: Sequence[str] | None = None,
        disturbances: Sequence[str] | None = None,
    ) -> LinearPlant:
        """Return the plant with some signals only, in the order given.

        Disturbances keep their rates, which stand behind them.

        Raises InputError if a name is unknown.
        """
        outputs = self.outputs if outputs is None else tuple(outputs)
        measurements = self.measurements if measurements is None else tuple(measurements)
        own = self.independent_disturbances if disturbances is None else tuple(disturbances)
        rates = {name: base for name, base in self.rates.items() if base in own}
        kept = self.disturbances if disturbances is None else (*own, *rates)
        z = pick(_OWNER, "output", self.outputs, outputs)
        y = pick(_OWNER, "measurement", self.measurements, measurements)
        w = pick(_OWNER, "disturbance", self.disturbances, kept)
        known = {*self.states, *self.inputs, *kept, *outputs, *measurements}
        return self._with(
            E=self.E[:, w],
            C=self.C[y],
            D=self.D[y],
            F=self.F[np.ix_(y, w)],
            Cz=self.Cz[z],
            Dz=self.Dz[z],
            Fz=self.Fz[np.ix_(z, w)],
            disturbances=kept,
            rates=MappingProxyType(rates),
            outputs=outputs,
            measurements=measurements,
            delays=tuple(self.delays[i] for i in y),
            holds=tuple(self.holds[i] for i in y),
            units=MappingProxyType({k: v for k, v in self.units.items() if k in known}),
            static=MappingProxyType({k: v for k, v in self.static.items() if k in known}),
            loss=MappingProxyType({k: v for k, v in self.loss.items() if k in known}),
        )

    def without_delays(self, pade_order: int = 6, *, at: str = "auto") -> LinearPlant:
        """Return a plant without delays, Pade models in their place.

        A hold becomes (1 + x^2/60)/(1 + x/2 + x^2/10 + x^3/120), x = s T, in which the delay of
        (1 - exp(-x))/x is its Pade model of order 3: within 0.01 % up to half the rate of the
        readings in gain, and 0.6 degrees in phase.

        Parameters
        ----------
        pade_order
            Order of each Pade model, 1 to 12; 0 drops the delays.
        at
            ``"measurements"``: one model for each delayed measurement, all four blocks keep
            their meaning.  ``"auto"``: at the inputs if the delays are equal and there are
            fewer inputs than measurements, for fewer states.  What the loop does is the same:
            yu is that of the delayed plant and every closed-loop response with it, while zu
            alone gains the delay and yw alone loses it.

        Raises
        ------
        InputError
            If `pade_order` or `at` is out of range.
        """
        check_range(_OWNER, "pade_order", pade_order, low=0, high=12)
        check_choice(_OWNER, "at", at, ("auto", "measurements"))
        ny, nu = len(self.measurements), len(self.inputs)
        if any(self.holds):
            return self.with_held_states().without_delays(pade_order, at=at)
        plain = self._with(delays=(0.0,) * ny)
        if pade_order == 0 or not any(self.delays):
            return plain
        if at == "auto" and len(set(self.delays)) == 1 and nu < ny:
            late = (self.delays[0],) * nu
            A2, B2, C2, D2 = pade_bank(late, pade_order)
            return plain._with(
                A=np.block([[self.A, self.B @ C2], [np.zeros((len(A2), len(self.A))), A2]]),
                B=np.vstack([self.B @ D2, B2]),
                E=np.vstack([self.E, np.zeros((len(A2), self.E.shape[1]))]),
                C=np.hstack([self.C, self.D @ C2]),
                D=self.D @ D2,
                Cz=np.hstack([self.Cz, self.Dz @ C2]),
                Dz=self.Dz @ D2,
                states=(*self.states, *_delay_states(self.inputs, late, pade_order)),
            )
        A2, B2, C2, D2 = pade_bank(self.delays, pade_order)
        names = _delay_states(self.measurements, self.delays, pade_order)
        return plain._with_filters(A2, B2, C2, D2, names)

    def with_held_states(self) -> LinearPlant:
        """Return the plant with a rational model of its holds, as `without_delays` has it."""
        ny, held = len(self.measurements), [i for i, T in enumerate(self.holds) if T > 0.0]
        A2, B2 = np.zeros((3 * len(held),) * 2), np.zeros((3 * len(held), ny))
        C2, D2 = np.zeros((ny, 3 * len(held))), np.eye(ny)
        for k, i in enumerate(held):
            at, T = slice(3 * k, 3 * k + 3), self.holds[i]
            # 120 + 60 x + 12 x^2 + x^3 below and 120 + 2 x^2 above, in time over T.
            A2[at, at] = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-120.0, -60.0, -12.0]]) / T
            B2[3 * k + 2, i], C2[i, at], D2[i, i] = 1.0 / T, [120.0, 0.0, 2.0], 0.0
        late = zip(self.delays, self.holds, strict=True)
        names = [f"{self.measurements[i]}.hold{j + 1}" for i in held for j in range(3)]
        filtered = self._with_filters(A2, B2, C2, D2, names)
        return filtered._with(
            delays=tuple(max(0.0, delay - 0.5 * hold) for delay, hold in late), holds=(0.0,) * ny
        )

    def _with_filters(
        self, A2: FloatArray, B2: FloatArray, C2: FloatArray, D2: FloatArray, names: Sequence[str]
    ) -> LinearPlant:
        """Return the plant with filters behind its measurements, and their states' names."""
        return self._with(
            A=np.block([[self.A, np.zeros((len(self.A), len(A2)))], [B2 @ self.C, A2]]),
            B=np.vstack([self.B, B2 @ self.D]),
            E=np.vstack([self.E, B2 @ self.F]),
            C=np.hstack([D2 @ self.C, C2]),
            D=D2 @ self.D,
            F=D2 @ self.F,
            Cz=np.hstack([self.Cz, np.zeros((len(self.Cz), len(A2)))]),
            states=(*self.states, *names),
        )

    def to_control(self, pade_order: int = 6) -> control.StateSpace:
        """Return a python-control system, inputs then disturbances to measurements then outputs.

        Measurement delays become Pade models of `pade_order` (0 drops them).  A disturbance
        that is the rate of another one stays an input of its own, as no proper system can
        hold its derivative.  A signal that is measured and an output keeps its name in the
        outputs, and is called ``measured_<name>`` among the measurements;
        python-control allows no dots in names, they become underscores.
        """
        import control

        plant = self.without_delays(pade_order, at="measurements")
        measured = [f"measured_{n}" if n in self.outputs else n for n in self.measurements]
        names = [
            [name.replace(".", "_") for name in group]
            for group in (
                plant.states,
                (*plant.inputs, *plant.disturbances),
                (*measured, *plant.outputs),
            )
        ]
        return control.ss(
            plant.A,
            np.hstack([plant.B, plant.E]),
            np.vstack([plant.C, plant.Cz]),
            np.block([[plant.D, plant.F], [plant.Dz, plant.Fz]]),
            states=names[0],
            inputs=names[1],
            outputs=names[2],
        )

    def __str__(self) -> str:
        """Return a small tree of sizes and names."""
        late = [
            f"{name} ({delay * 1e3:g} ms late)" if delay else name
            for name, delay in zip(self.measurements, self.delays, strict=True)
        ]
        return (
            f"LinearPlant with {len(self.states)} states\n"
            f"├ inputs: {', '.join(self.inputs)}\n"
            f"├ disturbances: {', '.join(self.independent_disturbances)}\n"
            f"├ measurements: {', '.join(late)}\n"
            f"└ outputs: {', '.join(self.outputs) or 'none'}"
        )


def late_and_held(s: ComplexArray, delays: Sequence[float], holds: Sequence[float]) -> ComplexArray:
    """Return what delays, half the holds in them, and holds make of signals at points (k, 1) [1/s].

    It is (k, ny); delays and holds are as of a `LinearPlant`, (ny,) [s].
    """
    # Signals of one sensor are alike.
    each = [*zip(delays, holds, strict=True)]
    alike = [*dict.fromkeys(each)]
    late, T = np.array(alike).reshape(-1, 2).T
    factor = np.asarray(np.exp(-s * (late - 0.5 * T)), dtype=np.complex128)
    if np.any(T):
        x = s * T
        safe = np.where(x == 0.0, 1.0, x)
        factor = factor * np.where(x == 0.0, 1.0, -np.expm1(-safe) / safe)
    return factor[:, [alike.index(own) for own in each]]


def _matrix(name: str, value: npt.ArrayLike) -> FloatArray:
    matrix = check_finite(_OWNER, name, value)
    if matrix.ndim != 2:
        raise InputError(f"{_OWNER}: {name} must be a matrix, got an array of {matrix.ndim} axes")
    return matrix


def _delay_states(names: Sequence[str], delays: Sequence[float], order: int) -> list[str]:
    late = [name for name, delay in zip(names, delays, strict=True) if delay > 0.0]
    return [f"{name}.delay{i + 1}" for name in late for i in range(order)]


def _slopes(
    A: FloatArray, B: FloatArray, C: FloatArray, direct: FloatArray
) -> dict[int, tuple[int, BoolArray]]:
    """Return which signals are the time derivative of which other one, that one before it.

    So is row i of C of row j where C_i = C_j A and what C_j B brings at once is in its direct term:
    C_j A (s I - A)^-1 B + C_j B = s C_j (s I - A)^-1 B.  With it goes in which columns that is.
    """
    step = _ROUNDING * (np.abs(C) @ np.abs(A))
    least = _ROUNDING * (np.abs(C) @ np.abs(B))
    moved, through = C @ A, C @ B
    at_once = np.abs(through) > least
    # [i, j]: whether i is the derivative of j.
    same = (np.abs(C[:, None] - moved) <= step).all(axis=2)
    same &= ((np.abs(direct[:, None] - through) <= least) | ~at_once).all(axis=2)
    same &= (np.abs(C).sum(axis=1) > 0.0)[:, None] & ~np.eye(len(C), dtype=np.bool_)
    found: dict[int, tuple[int, BoolArray]] = {}
    known = np.flatnonzero(np.logical_not(same.any(axis=1))).tolist()
    for j in known:  # grows, as a derivative may have one, too; what goes in circles is in none
        for i in np.flatnonzero(same[:, j]).tolist():
            if i not in found:
                found[i] = j, at_once[j]
                if not at_once[j].any():
                    known.append(i)
    return found


def _integrates(A: FloatArray) -> bool:
    """Tell whether A is singular; LU hides it behind a pivot of rounding size."""
    values = np.linalg.svd(scipy.linalg.matrix_balance(A, permute=False)[0], compute_uv=False)
    return bool(values[-1] <= 1e-14 * values[0])


def _nearest(poles: ComplexArray, points: ComplexArray) -> complex:
    distance = np.abs(poles[:, None] - points[None, :]).min(axis=1)
    return complex(poles[int(np.argmin(distance))])
