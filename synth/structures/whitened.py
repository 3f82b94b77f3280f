"""A plant with white disturbances in place of its spectra, for LQG designs.

A spectrum with a peak becomes white noise through an oscillator; good enough to begin a search
from, and nothing that is reported rests on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.plant import LinearPlant

from ..loop import Disturbance


def whitened(plant: LinearPlant, disturbances: Sequence[Disturbance]) -> LinearPlant:
    """Return a plant that white noises of intensity 1 shake about as the disturbances do.

    A spectrum that is not white becomes that of an oscillator with the same peak frequency,
    peak density and variance (three numbers, for a starting point); its two states are the
    disturbance and its rate.  A white noise whose rate acts too has no finite variance and
    keeps the rate out.
    """
    n = len(plant.states)
    known = {name: k for k, name in enumerate(plant.disturbances)}
    rate_of = {base: rate for rate, base in plant.rates.items()}
    extra = 2 * sum(not _is_white(d) for d in disturbances)
    count = len(disturbances)
    A = np.zeros((n + extra, n + extra))
    E, F = np.zeros((n + extra, count)), np.zeros((len(plant.measurements), count))
    Fz = np.zeros((len(plant.outputs), count))
    C, Cz = (np.hstack([m, np.zeros((len(m), extra))]) for m in (plant.C, plant.Cz))
    A[:n, :n] = plant.A
    at = n
    for k, disturbance in enumerate(disturbances):
        column = known[disturbance.name]
        if _is_white(disturbance):
            size = np.sqrt(np.pi * float(disturbance.density(np.ones(1))[0]))
            E[:n, k], F[:, k] = size * plant.E[:, column], size * plant.F[:, column]
            Fz[:, k] = size * plant.Fz[:, column]
            continue
        peak, damping, sigma = _oscillator(disturbance)
        A[at, at + 1] = 1.0
        A[at + 1, at : at + 2] = -(peak**2), -2.0 * damping * peak
        E[at + 1, k] = np.sqrt(4.0 * damping * peak**3) * sigma
        for state, name in ((at, disturbance.name), (at + 1, rate_of.get(disturbance.name))):
            if name is not None:
                A[:n, state] += plant.E[:, known[name]]
                C[:, state] += plant.F[:, known[name]]
                Cz[:, state] += plant.Fz[:, known[name]]
        at += 2
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
        disturbances=tuple(d.name for d in disturbances),
        measurements=plant.measurements,
        outputs=plant.outputs,
    )


def _is_white(disturbance: Disturbance) -> bool:
    if disturbance.band is not None:
        return False
    density = disturbance.density(np.geomspace(1e-3, 1e3, 7))
    return bool(np.all(density == density[0]))


def _oscillator(disturbance: Disturbance) -> tuple[float, float, float]:
    """Return peak frequency [rad/s], damping ratio and standard deviation of a spectrum."""
    low, high = disturbance.band or (1e-3, 1e3)
    omega = np.geomspace(max(low, 1e-4 * high), high, 400)
    density = disturbance.density(omega)
    k = int(np.argmax(density))
    variance = float(np.trapezoid(density, omega))
    # An oscillator's density at resonance is m0 / (pi damping peak).
    damping = variance / (np.pi * omega[k] * max(float(density[k]), 1e-300))
    return float(omega[k]), float(np.clip(damping, 0.01, 2.0)), float(np.sqrt(variance))
