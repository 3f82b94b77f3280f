"""A plant behind the filters that make its disturbances of white noise.

What the Riccati equations of `synth.bound.bound` need: every disturbance is white and of intensity
one, the sea's filter is part of the plant, and a command that is charged or limited is an output
as any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.basics import InputError
from models.plant import LinearPlant, ShapingFilter


def with_input_outputs(plant: LinearPlant, names: Sequence[str]) -> LinearPlant:
    """Return the plant with those of its inputs that are named among its outputs, too."""
    wanted = [n for n in dict.fromkeys(names) if n in plant.inputs and n not in plant.outputs]
    if not wanted:
        return plant
    rows = np.eye(len(plant.inputs))[[plant.inputs.index(name) for name in wanted]]
    more = len(wanted)
    return replace(
        plant,
        Cz=np.vstack([plant.Cz, np.zeros((more, len(plant.states)))]),
        Dz=np.vstack([plant.Dz, rows]),
        Fz=np.vstack([plant.Fz, np.zeros((more, len(plant.disturbances)))]),
        outputs=(*plant.outputs, *wanted),
    )


def shaped(plant: LinearPlant, sources: Mapping[str, ShapingFilter | float]) -> LinearPlant:
    """Return a plant that white noises of intensity 1 shake as the sources do.

    Parameters
    ----------
    plant
        Without delays.
    sources
        By name of a disturbance: a filter, or the intensity of white noise.  Disturbances that
        are not named rest.

    Raises
    ------
    InputError
        If a white noise has a rate that acts on the plant too.
    """
    n, count = len(plant.states), len(sources)
    extra = sum(s.order for s in sources.values() if isinstance(s, ShapingFilter))
    A = np.zeros((n + extra, n + extra))
    A[:n, :n] = plant.A
    E, F = np.zeros((n + extra, count)), np.zeros((len(plant.measurements), count))
    Fz = np.zeros((len(plant.outputs), count))
    C, Cz = (np.hstack([m, np.zeros((len(m), extra))]) for m in (plant.C, plant.Cz))
    at = n
    for k, (name, source) in enumerate(sources.items()):
        base = plant.disturbances.index(name)
        rates = [plant.disturbances.index(r) for r, of in plant.rates.items() if of == name]
        if not isinstance(source, ShapingFilter):
            if any(np.any(m[:, rates]) for m in (plant.E, plant.F, plant.Fz)):
                raise InputError(
                    f"bound: {name} acts through its rate too, so its spectrum must fall off; "
                    "got white noise"
                )
            root = np.sqrt(source)
            E[:n, k], F[:, k] = root * plant.E[:, base], root * plant.F[:, base]
            Fz[:, k] = root * plant.Fz[:, base]
            continue
        states = slice(at, at + source.order)
        A[states, states], E[states, k] = source.A, source.B[:, 0]
        row, rate = source.C[0], (source.C @ source.A)[0]
        for target, columns in ((A[:n], plant.E), (C, plant.F), (Cz, plant.Fz)):
            target[:, states] += np.outer(columns[:, base], row)
            for r in rates:
                target[:, states] += np.outer(columns[:, r], rate)
        at += source.order
    return LinearPlant(
        A=A,
        B=np.vstack([plant.B, np.zeros((extra, len(plant.inputs)))]),
        E=E,
        C=C,
        D=plant.D,
        F=F,
        Cz=Cz,
        Dz=plant.Dz,
        Fz=Fz,
        inputs=plant.inputs,
        disturbances=tuple(sources),
        measurements=plant.measurements,
        outputs=plant.outputs,
    )
