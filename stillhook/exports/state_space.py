"""State space: a law and its plant as matrices, for MATLAB, python-control and others.

    law --> contents --> NAME.mat, NAME.json --> read back, closed again by python-control

What is read back closes the loop once more, with python-control's own responses: the payload's
rms, M_s and the poles must be those of the design.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.io

from models.basics import ComplexArray, FloatArray, check_range
from models.sensing import HEARD, Measurement
from synth.structures import Stepper

from .exported import Exported
from .law import Law
from .linear_facts import Tree, contents, plant_of, sampled_controller
from .margins import about_rest

if TYPE_CHECKING:
    import control

TOLERANCE = 1e-6
"""Largest relative difference of the payload's rms, M_s and poles that counts as none."""

_SAMPLES = 200  # after which the sampled law is held against the law itself
_SMALL = 1e-6  # size of what it hears then: no limit within is touched
_PADE = 6
_HIGH = 0.9  # of M_s, from where the sensitivity is looked at
_HEADER = 116  # bytes of text in a MAT file, where SciPy writes the time
_DEEP = 63  # longest name of MATLAB


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlSystems:
    """A law and its plant as python-control has them; names have underscores for dots."""

    #: Inputs and disturbances to measurements and outputs, delays as Pade models of order 6.
    plant: control.StateSpace
    continuous: control.StateSpace | None  #: The law; None if it is made of samples.
    sampled: control.StateSpace  #: The law in samples.


def as_json(law: Law) -> Exported:
    """Return a law and its plant as JSON: every number with the digits that read back.

    Raises InputError if the law is not linear and time invariant.
    """
    tree = contents(law)
    text = json.dumps(_for_json(tree), indent=1, allow_nan=False) + "\n"
    said, proved = _proof(law, tree, json.loads(text))
    return Exported(
        kind="json",
        title="State space as JSON",
        files={f"{law.name}.json": text},
        about=_ABOUT_JSON.format(name=law.name, snippet=python_snippet(law)),
        proof=said,
        proved=proved,
    )


def as_mat(law: Law) -> Exported:
    """Return a law and its plant as a MAT file of version 5, which MATLAB and Octave load.

    Raises InputError if the law is not linear and time invariant.
    """
    tree = contents(law)
    file = io.BytesIO()
    scipy.io.savemat(file, {law.name: _for_matlab(tree)}, long_field_names=True, oned_as="column")  # type: ignore[arg-type]  # a file that is open will do
    stamp = f"MATLAB 5.0 MAT-file, {tree['written_by']}".encode("ascii").ljust(_HEADER)
    data = stamp[:_HEADER] + file.getvalue()[_HEADER:]
    again = io.BytesIO(data)
    read = scipy.io.loadmat(again, simplify_cells=True)[law.name]  # type: ignore[arg-type]
    said, proved = _proof(law, tree, read)
    return Exported(
        kind="mat",
        title="State space for MATLAB",
        files={f"{law.name}.mat": data},
        about=_ABOUT_MAT.format(name=law.name, snippet=_matlab_snippet(law)),
        proof=said,
        proved=proved,
    )


def to_python_control(law: Law, sample_time: float | None = None) -> ControlSystems:
    """Return a law and its plant as systems of python-control.

    Parameters
    ----------
    law
        The law.
    sample_time
        T of the sampled law [s]; by default its own.

    Raises
    ------
    InputError
        If the law is not linear and time invariant, or cannot be sampled so.
    SynthesisError
        If the law cannot be made at that sample time.
    """
    T = law.sample_time if sample_time is None else sample_time
    check_range("export", "sample_time", T, low=0.0, unit="s", open_low=True)
    tree = contents(law)
    return ControlSystems(
        plant=plant_of(tree["plant"]).to_control(_PADE),
        continuous=_system(tree["controller"]) if "controller" in tree else None,
        sampled=_system(sampled_controller(law, T), T),
    )


def _system(tree: Mapping[str, Any], sample_time: float = 0.0) -> control.StateSpace:
    import control

    n, ny, nu = _count(tree["A"]), len(_names(tree["inputs"])), len(_names(tree["outputs"]))
    shapes = {"A": (n, n), "B": (n, ny), "C": (nu, n), "D": (nu, ny)}
    matrices = [np.asarray(tree[name], dtype=np.float64).reshape(s) for name, s in shapes.items()]
    return control.ss(
        *matrices,
        sample_time,
        inputs=[name.replace(".", "_") for name in _names(tree["inputs"])],
        outputs=[name.replace(".", "_") for name in _names(tree["outputs"])],
    )


def _proof(law: Law, tree: Tree, read: Mapping[str, Any]) -> tuple[str, bool]:
    """Return what comparing a file that was read back with the law has shown, and if it agrees."""
    same = _sampled_difference(law, read["sampled_controller"])
    found = [f"the law itself over {_SAMPLES} samples to {same:.1e}"]
    worst = same
    if law.design is not None:
        rms, peak, poles = _loop_differences(law, read)
        found.append(
            f"the design, closed again by python-control: the load's rms to {rms:.1e}, M_s to "
            f"{peak:.1e}, poles to {poles:.1e}"
        )
        worst = max(worst, rms, peak, poles)
    said = f"The file was read back and held against {'; and against '.join(found)}, relative."
    return said, bool(worst <= TOLERANCE)


def _sampled_difference(law: Law, tree: Mapping[str, Any]) -> float:
    """Return the largest difference of commands of the sampled law, over the largest command."""
    recursion = about_rest(law.inner, law.case)
    if recursion is None:
        return math.nan
    stepper = Stepper(recursion.function, recursion.initial)
    rest = law.rest
    begin = float(stepper.run(rest.values)[0])
    system, names = _system(tree, law.sample_time), _names(tree["inputs"])
    gain = np.asarray(tree["K_b"], dtype=np.float64).ravel()
    rng = np.random.default_rng(0)
    x, worst, most, followed, asked = np.zeros(len(system.A)), 0.0, 0.0, begin, begin
    for _ in range(_SAMPLES):
        heard = rest.values.copy()
        y = _SMALL * rng.standard_normal(len(names))
        if gain.size:  # the drive does not follow all of it
            followed = asked + _SMALL * rng.standard_normal()
            heard[HEARD.index("drive.applied")] = followed
            x = x + gain * (followed - asked)
        for name, value in zip(names, y, strict=True):
            heard[HEARD.index(name)] += value
        command = float(stepper.run(Measurement(heard).values)[0])
        u = float((system.C @ x + system.D @ y)[0])
        asked = command
        x = system.A @ x + system.B @ y
        worst, most = max(worst, abs(command - begin - u)), max(most, abs(u))
    return worst / most


def _loop_differences(law: Law, read: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return relative differences of the payload's rms, M_s and poles."""
    assert law.design is not None
    view = law.design.assessment
    rms, sensitivity = closed_again(read)
    grid = view.grid
    own_sizes = np.abs(1.0 / (1.0 + view.loop_gain(grid)))
    peak = float(own_sizes.max())
    grid = grid[own_sizes > _HIGH * peak]  # python-control takes a millisecond for each of them
    poles = _closed_poles(read)
    own = view.poles
    # Models of delays are no poles of the loop, and differ by where they are put.
    plant = law.design.assessment.plant
    slow = own[np.abs(own) * max(plant.delays, default=0.0) < 1.0]
    off = max((float(np.abs(poles - p).min() / max(abs(p), 1e-3)) for p in slow), default=0.0)
    found = view.sigma("payload.displacement")
    return abs(rms / found - 1.0), abs(sensitivity(grid).max() / peak - 1.0), off


def closed_again(read: Mapping[str, Any]) -> tuple[float, Callable[[FloatArray], FloatArray]]:
    """Return the payload's rms [m] and |S| over omega [rad/s], by python-control, of what was read.

    Delays are exact.
    """
    p, spectra = read["plant"], read["spectra"]
    system = _open_loop(p)
    law = _system(read["controller"])
    ny, names = len(_names(p["measurements"])), _names(p["disturbances"])
    rates, bases = _names(p["rates"]), _names(p["rates_of"])

    def blocks(omega: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """P from (command, disturbances), (y and z, 1 + nw, k), C (1, ny, k) and 1 + L, (k,)."""
        s = 1j * omega
        P, C = system(s, squeeze=False), law(s, squeeze=False)
        for rate, base in zip(rates, bases, strict=True):
            P[:, 1 + names.index(base)] += s * P[:, 1 + names.index(rate)]
        late, held = (np.atleast_1d(p[name])[:, None] for name in ("delays", "holds"))
        factor = np.exp(-s * (late - 0.5 * held))
        x = s * np.where(held > 0.0, held, 1.0)
        factor = factor * np.where(held > 0.0, -np.expm1(-x) / x, 1.0)
        P[:ny] *= factor[:, None]
        return P, C, 1.0 - np.sum(C[0] * P[:ny, 0], axis=0)

    omega, weights = np.atleast_1d(spectra["omega"]), np.atleast_1d(spectra["weights"])
    P, C, difference = blocks(omega)
    at = ny + _names(p["outputs"]).index("payload.displacement")
    variance = 0.0
    sources = _names(spectra["disturbances"])
    densities = np.asarray(spectra["densities"]).reshape(len(sources), -1)
    for name, density in zip(sources, densities, strict=True):
        w = 1 + names.index(name)
        command = np.sum(C[0] * P[:ny, w], axis=0) / difference
        F = P[at, w] + P[at, 0] * command
        variance += float(np.sum(np.abs(F) ** 2 * density * weights))
    return math.sqrt(variance), lambda w: np.asarray(np.abs(1.0 / blocks(w)[2]))


def _open_loop(p: Mapping[str, Any]) -> control.StateSpace:
    import control

    n, nu, nw = _count(p["A"]), len(_names(p["inputs"])), len(_names(p["disturbances"]))
    ny, nz = len(_names(p["measurements"])), len(_names(p["outputs"]))
    shapes = {"A": (n, n), "B": (n, nu), "E": (n, nw), "C": (ny, n), "D": (ny, nu), "F": (ny, nw)}
    shapes |= {"Cz": (nz, n), "Dz": (nz, nu), "Fz": (nz, nw)}
    m = {name: np.asarray(p[name], dtype=np.float64).reshape(s) for name, s in shapes.items()}
    direct = np.block([[m["D"], m["F"]], [m["Dz"], m["Fz"]]])
    return control.ss(m["A"], np.hstack([m["B"], m["E"]]), np.vstack([m["C"], m["Cz"]]), direct)


def _closed_poles(read: Mapping[str, Any]) -> ComplexArray:
    """Return poles of the loop with Pade models of its delays, by python-control."""
    import control

    p = {name: _listed(name, value) for name, value in read["plant"].items()}
    ny = len(p["measurements"])
    for name, rows, columns in (("B", "states", "inputs"), ("E", "states", "disturbances"),
                                ("C", "measurements", "states"), ("D", "measurements", "inputs"),
                                ("F", "measurements", "disturbances"), ("Cz", "outputs", "states"),
                                ("Dz", "outputs", "inputs"), ("Fz", "outputs", "disturbances"),
                                ("A", "states", "states")):  # fmt: skip
        p[name] = np.asarray(p[name], dtype=np.float64).reshape(len(p[rows]), len(p[columns]))
    whole = plant_of(p).to_control(_PADE)
    closed = control.feedback(whole[:ny, :1], _system(read["controller"]), sign=1)
    return np.asarray(closed.poles(), dtype=np.complex128)


def _listed(name: str, value: Any) -> Any:
    """Return a field of a plant as it was written: a MAT file knows no list of one."""
    if name in ("delays", "holds"):
        return np.atleast_1d(value).tolist()
    named = ("states", "inputs", "disturbances", "measurements", "outputs", "rates", "rates_of")
    return _names(value) if name in named else value


def _names(value: Any) -> list[str]:
    return [value] if isinstance(value, str) else [str(name) for name in value]


def _count(A: Any) -> int:
    return math.isqrt(np.asarray(A).size)


def _for_json(value: Any) -> Any:
    """Return plain data; what has no number or no bound is null."""
    if isinstance(value, Mapping):
        return {key: _for_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _for_json(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_for_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _for_matlab(value: Any) -> Any:
    """Return data as SciPy writes them: structs, cells of names, numbers by name as two columns."""
    if isinstance(value, Mapping):
        if all("." not in name and len(name) <= _DEEP for name in value):
            return {name: _for_matlab(item) for name, item in value.items()}
        texts = all(isinstance(item, str) for item in value.values())
        numbers = list(value.values())
        return {
            "names": _cells(list(value)),
            "values": _cells(numbers) if texts else np.array(numbers),
        }
    if isinstance(value, list):
        return _cells(value)
    return value


def _cells(names: Sequence[str]) -> Any:
    found = np.empty((len(names), 1), dtype=object)
    found[:, 0] = names
    return found


def python_snippet(law: Law) -> str:
    """Return a program that closes the loop of the JSON file, or runs the sampled law alone."""
    if law.design is None:
        return _PYTHON_ALONE.format(name=law.name)
    return _PYTHON.format(name=law.name)


def _matlab_snippet(law: Law) -> str:
    return (_MATLAB_ALONE if law.design is None else _MATLAB).format(name=law.name)


_PYTHON_ALONE = """\
import json, pathlib, numpy as np, control
data = json.loads(pathlib.Path("{name}.json").read_text())
c = data["sampled_controller"]
n, ny = len(c["A"]), len(c["inputs"])
A, B = np.reshape(c["A"], (n, n)), np.reshape(c["B"], (n, ny))
law = control.ss(A, B, np.reshape(c["C"], (1, n)), np.reshape(c["D"], (1, ny)), c["sample_time"])
print(law.poles())
"""

_PYTHON = '''\
import json, pathlib, numpy as np, control
data = json.loads(pathlib.Path("{name}.json").read_text())
p, c, sea = data["plant"], data["controller"], data["spectra"]
n, ny, nw = len(p["states"]), len(p["measurements"]), len(p["disturbances"])
plant = control.ss(p["A"], np.hstack([p["B"], p["E"]]), np.vstack([p["C"], p["Cz"]]),
                   np.block([[np.array(p["D"]), np.array(p["F"])],
                             [np.array(p["Dz"]), np.array(p["Fz"])]]))
m = len(c["A"])
law = control.ss(np.reshape(c["A"], (m, m)), np.reshape(c["B"], (m, ny)),
                 np.reshape(c["C"], (1, m)), np.reshape(c["D"], (1, ny)))

def closed(omega):
    """Payload over every disturbance, and the sensitivity; delays are exact."""
    s = 1j * omega
    P, C = plant(s, squeeze=False), law(s, squeeze=False)
    for rate, of in zip(p["rates"], p["rates_of"]):   # such a disturbance is s times another
        P[:, 1 + p["disturbances"].index(of)] += s * P[:, 1 + p["disturbances"].index(rate)]
    late, held = np.array(p["delays"])[:, None], np.array(p["holds"])[:, None]
    x = s * np.where(held > 0, held, 1)
    P[:ny] *= (np.exp(-s * (late - held / 2)) * np.where(held > 0, -np.expm1(-x) / x, 1))[:, None]
    S = 1 / (1 - np.sum(C[0] * P[:ny, 0], axis=0))
    z = ny + p["outputs"].index("payload.displacement")
    return P[z, 1:] + P[z, 0] * S * np.einsum("yk,ywk->wk", C[0], P[:ny, 1:]), S

omega = np.array(sea["omega"])
F, _ = closed(omega)
rows = [p["disturbances"].index(name) for name in sea["disturbances"]]
rms = np.sqrt(np.sum(np.abs(F[rows]) ** 2 * np.array(sea["densities"]) * sea["weights"]))
peak = np.abs(closed(np.geomspace(1e-3, 1e3, 20000))[1]).max()
print(f"payload rms {{rms:.6g}} m, M_s {{peak:.4f}}")
'''

_MATLAB_ALONE = """\
load {name}.mat
c = {name}.sampled_controller;
C = ss(c.A, c.B, c.C, c.D, c.sample_time);
pole(C)
"""

_MATLAB = """\
load {name}.mat
p = {name}.plant;  c = {name}.controller;  ny = numel(p.measurements);
P = ss(p.A, p.B, p.C, p.D, 'OutputDelay', p.delays);   % p.holds are in the delays already
C = ss(c.A, c.B, c.C, c.D);
L = -C*P;                       % u = +C y
S = feedback(1, L);
norm(pade(S, 6), inf)           % M_s, compare {name}.margins.continuous.max_sensitivity
pole(feedback(pade(P, 6), C, +1))
"""

_ABOUT_JSON = """\
`{name}.json` holds the law in continuous time where it has one, sampled, and the linear plant with
its sensors; numbers are in SI and read back to the last bit, `null` is a number without bound.
The program needs numpy and python-control:

```python
{snippet}```
"""

_ABOUT_MAT = """\
`{name}.mat` is of version 5, which MATLAB and Octave load as a struct `{name}`; names of signals
are cells of text. With the Control System Toolbox (not run here):

```matlab
{snippet}```
"""
