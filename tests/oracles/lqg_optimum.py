"""The optimal controller of full order under white noise: what `synth.design.tune` must find."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.basics import InputError, SynthesisError, White
from models.plant import LinearPlant
from synth.loop import LinearController
from synth.structures import LqgEstimator, LqgRegulator, reduced, weighing
from synth.structures.lqg import estimator, regulator


@dataclass(frozen=True, kw_only=True, eq=False)
class LQG:
    """The optimal controller of full order; `cost` is the root of the weighted variance."""

    controller: LinearController
    cost: float
    regulator: LqgRegulator
    estimator: LqgEstimator


def lqg(plant: LinearPlant, *, minimise: Mapping[str, float], spectrum: Mapping[str, White]) -> LQG:
    """Return the controller that minimises a weighted variance under white noise.

    Parameters
    ----------
    plant
        A plant without delays and rates.
    minimise
        Weights on the variances of performance outputs by name; together they must weigh
        every input.
    spectrum
        White noises by the name of their disturbance; together they must disturb every
        measurement.

    Raises
    ------
    InputError
        If a name is unknown, or the plant has delays or rates.
    SynthesisError
        If an input is free of charge, a measurement is free of noise, a weighted output
        hears white noise directly, or a Riccati equation has no stabilising solution.
    """
    if any(plant.delays) or plant.rates:
        raise InputError("LQG: the plant must have neither delays nor rates")
    for kind, known, given in (
        ("output", plant.outputs, minimise),
        ("disturbance", plant.disturbances, spectrum),
    ):
        for name in given:
            if name not in known:
                raise InputError(
                    f"LQG: there is no {kind} {name!r}; there are: {', '.join(known) or 'none'}"
                )
    weights = np.array([minimise.get(name, 0.0) for name in plant.outputs])
    noise = np.array([spectrum[n].intensity if n in spectrum else 0.0 for n in plant.disturbances])
    if np.any(weights @ plant.Fz**2 @ noise > 0.0):
        raise SynthesisError("LQG: a weighted output hears white noise directly: infinite cost")
    Q, R, S = weighing(plant.Cz, plant.Dz, weights)
    feedback = regulator(plant, Q, R, S)
    E, F = plant.E, plant.F
    kalman = estimator(plant, (E * noise) @ E.T, (F * noise) @ F.T, (E * noise) @ F.T)
    variance = np.trace(plant.E.T @ feedback.X @ plant.E * noise) + np.trace(
        feedback.gain.T @ R @ feedback.gain @ kalman.Y
    )
    return LQG(
        controller=reduced(plant, feedback, kalman, len(plant.states)),
        cost=float(np.sqrt(variance)),
        regulator=feedback,
        estimator=kalman,
    )
