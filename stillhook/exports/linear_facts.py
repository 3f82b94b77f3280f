"""A law and its plant as matrices with names: what the files of a state space hold.

    law --> controller (continuous, sampled), plant, spectra, margins, notes --> one tree

The tree is of mappings, texts, numbers, arrays and lists of names, in SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError
from models.plant import LinearPlant, build_plant
from models.sensing import HEARD, recursion_of, sensed_plant
from synth.controllers import ConstantTension, LinearFeedback
from synth.loop import LinearController, Margins
from synth.structures import Matrices, SampledLoop, sampled, sampled_loop, tracking_gain

from .._version import __version__
from .law import Law
from .margins import margins_at, resampled
from .signals import SIGNALS

SCHEMA = "stillhook-state-space-1"
"""What stands in every file, for programs that read it; another layout has another number."""

#: What a law hears that is no signal of a linear system: flags, ages and what the operator asks.
FLAGS = tuple(
    name for name in HEARD if name.endswith((".valid", ".age")) or name.startswith("operator.")
)
_OUTPUT = "payload.displacement"
_RTOL = 1e-6  # of the variance on the frequencies that a file tells
Tree = dict[str, Any]


def contents(law: Law) -> Tree:
    """Return all that the files of a law's state space hold.

    Raises InputError if the law is not linear and time invariant, as predictive control.
    """
    design = law.design
    controller = _controller(law)
    plant = design.assessment.plant if design is not None else _plant_without_drag(law)
    found: Tree = {
        "schema": SCHEMA,
        "written_by": f"Stillhook {__version__}",
        "case": law.case.name,
        "case_digest": law.case.digest,
        "law": law.inner.name if design is None else design.structure,
        "name": law.name,
        "notes": _notes(law),
        "rest": {name: float(law.rest[name]) for name in HEARD if name not in FLAGS},
        "command_at_rest": float(law.rest["drive.applied"]),
        "highest_command": law.highest,
        "command_unit": law.unit,
        "parameters": {} if design is None else dict(design.parameters),
        "parameter_units": {} if design is None else dict(design.units),
        "plant": _of_plant(plant),
    }
    if controller is not None:
        found["controller"] = _of_controller(controller, law)
    found["sampled_controller"] = sampled_controller(law, law.sample_time)
    found["margins"] = _of_margins(law)
    if design is not None:
        view = design.assessment
        nodes = view.quadrature([_OUTPUT], rtol=_RTOL)
        found["design"] = {
            "payload_rms": view.sigma(_OUTPUT),
            "significant_height": design.significant_height,
            "drag": design.drag,
            "friction": design.friction,
            "masses": design.masses,
        }
        found["limits"] = {
            "names": list(design.limits),
            "values": np.array([use.value for use in design.limits.values()]),
            "bounds": np.array([use.bound for use in design.limits.values()]),
            "units": [use.unit for use in design.limits.values()],
        }
        found["spectra"] = {
            "omega": nodes.omega,
            "weights": nodes.weights,
            "disturbances": [d.name for d in view.disturbances],
            "densities": np.array([d.density(nodes.omega) for d in view.disturbances]),
        }
    return found


def sampled_controller(law: Law, sample_time: float) -> Tree:
    """Return a law in samples of T [s], x+ = A x + B y, u = C x + D y, about rest.

    Linear feedback is sampled by Tustin's rule.  Of another recursion it is the Jacobian at rest,
    with `drive.applied`, the command followed since the sample before, among what it hears.

    Raises InputError if the law is not linear and time invariant, or cannot be sampled so.
    """
    inner = law.inner
    if isinstance(inner, LinearFeedback):
        matrices = sampled(inner.controller, sample_time)
        gain = np.zeros((len(matrices[0]), 1))
        if inner.anti_windup:
            gain = tracking_gain(matrices, sample_time)
        return {
            **_matrices(matrices),
            "K_b": gain,
            "sample_time": sample_time,
            "inputs": list(inner.controller.measurements),
            "outputs": list(inner.controller.inputs),
            "input_units": [_unit(law, name) for name in inner.controller.measurements],
            "output_units": [law.unit],
        }
    if sample_time != law.sample_time:
        found = resampled(inner, law.case, sample_time)
        if found is None:
            raise InputError(f"export: {inner.name} cannot be had at another sample time")
        inner = found
    J = _about_rest(law, inner, sample_time).controller
    heard = [
        k
        for k, name in enumerate(HEARD)
        if name not in FLAGS and (J.into_measured[:, k].any() or J.on_measured[:, k].any())
    ]
    names = [HEARD[k] for k in heard]
    A, B, C, D = J.into_state, J.into_measured[:, heard], J.on_state, J.on_measured[:, heard]
    return {
        **_matrices((A, B, C, D)),
        "K_b": np.zeros((len(A), 0)),
        "sample_time": sample_time,
        "inputs": names,
        "outputs": ["drive.command"],
        "input_units": [_unit(law, name) for name in names],
        "output_units": [law.unit],
    }


def _about_rest(law: Law, inner: Any, sample_time: float) -> SampledLoop:
    if isinstance(inner, ConstantTension):  # without its dead band, in which it does nothing
        return inner.linear_loop(law.case)
    recursion = recursion_of(inner)
    if recursion is None:
        raise InputError(
            f"export: {inner.name} is not linear and time invariant, so that it has no state "
            "space: it solves a programme in each sample; export it as c or fmu"
        )
    return sampled_loop(law.case, build_plant(law.case), recursion, sample_time)


def _controller(law: Law) -> LinearController | None:
    """Return a law in continuous time; None if it is made of samples."""
    return law.inner.controller if isinstance(law.inner, LinearFeedback) else None


def _plant_without_drag(law: Law) -> LinearPlant:
    masses = int(getattr(law.inner, "masses", 0)) or None
    return sensed_plant(law.case, masses=masses, drag=0.0)


def _of_controller(controller: LinearController, law: Law) -> Tree:
    return {
        **_matrices((controller.A, controller.B, controller.C, controller.D)),
        "inputs": list(controller.measurements),
        "outputs": list(controller.inputs),
        "input_units": [_unit(law, name) for name in controller.measurements],
        "output_units": [law.unit],
    }


def _of_plant(plant: LinearPlant) -> Tree:
    names = ("A", "B", "E", "C", "D", "F", "Cz", "Dz", "Fz")
    kinds = ("states", "inputs", "disturbances", "measurements", "outputs")
    return {
        **{name: np.asarray(getattr(plant, name)) for name in names},
        **{kind: list(getattr(plant, kind)) for kind in kinds},
        "measurement_units": [plant.units.get(name, "") for name in plant.measurements],
        "output_units": [plant.units.get(name, "") for name in plant.outputs],
        "delays": np.array(plant.delays),
        "holds": np.array(plant.holds),
        "rates": list(plant.rates),
        "rates_of": list(plant.rates.values()),
        "static": {name: float(value) for name, value in plant.static.items()},
    }


def _of_margins(law: Law) -> Tree:
    found = margins_at(law)
    if found is None:
        return {}
    told = {"continuous": found.continuous, "sampled": found.sampled}
    return {name: _numbers(margins) for name, margins in told.items() if margins is not None}


def _numbers(margins: Margins) -> Tree:
    return {
        "max_sensitivity": margins.max_sensitivity,
        "peak": margins.peak,
        "gain": margins.gain,
        "gain_down": margins.gain_down,
        "phase": margins.phase,
        "delay": margins.delay,
    }


def _notes(law: Law) -> list[str]:
    inner = law.inner
    found = [
        "SI units; all signals are deviations from `rest`, to which the command adds "
        "`command_at_rest`.",
        "The controller adds: u = +C(s) y, so that a loop is closed with positive feedback; "
        "L = -C P_yu.",
        "Drive limits, the operator's interface and what happens where a sensor is lost are not in "
        "a linear law.",
    ]
    if isinstance(inner, LinearFeedback):
        found.append(
            f"Values of the payload older than {inner.hold_for:g} s fade out within a second."
            if math.isfinite(inner.deaf_after)
            else "The law hears nothing from the payload."
        )
        if inner.anti_windup:
            found.append(
                "Anti-windup of the sampled controller: x+ = A x + B y + K_b (followed - asked), "
                "with the command that the drive followed and that asked for a sample before."
            )
    else:
        found.append("The sampled controller is the Jacobian of the law at rest.")
        if isinstance(inner, ConstantTension):
            found.append(f"It is without the dead band of {inner.dead_band:g} of the set point.")
    if law.design is None:
        found.append("Without a design there is no drag in the plant.")
    return found


def _unit(law: Law, name: str) -> str:
    found = next(signal.unit for signal in SIGNALS if signal.name == name)
    return found or law.unit


def _matrices(matrices: Matrices) -> dict[str, FloatArray]:
    return dict(zip("ABCD", map(np.asarray, matrices), strict=True))


def plant_of(tree: Mapping[str, Any]) -> LinearPlant:
    """Return the plant of a tree that was read from a file."""
    names = ("A", "B", "E", "C", "D", "F", "Cz", "Dz", "Fz")
    kinds = ("states", "inputs", "disturbances", "measurements", "outputs")
    matrices: dict[str, Any] = {name: tree[name] for name in names}
    named: dict[str, Any] = {kind: tree[kind] for kind in kinds}
    return LinearPlant(
        **matrices,
        **named,
        delays=[float(value) for value in tree["delays"]],
        holds=[float(value) for value in tree["holds"]],
        rates=dict(zip(tree["rates"], tree["rates_of"], strict=True)),
    )
