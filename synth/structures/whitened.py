"""A plant with white disturbances in place of its spectra, for LQG designs.

A spectrum with a peak becomes white noise through an oscillator; good enough to begin a search
from, and nothing that is reported rests on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from models.plant import LinearPlant, ShapingFilter

from ..loop import Disturbance


def whitened(plant: LinearPlant, disturbances: Sequence[Disturbance]) -> LinearPlant:
    """Return a plant that white noises of intensity 1 shake about as the disturbances do.

    A spectrum that is not white becomes that of an oscillator with the same peak frequency,
    peak density and variance (three numbers, for a starting point); its two states are the
    disturbance and its rate.  A white noise whose rate acts too has no finite variance and
    keeps the rate out.
    """
    sources = {
        d.name: np.pi * float(d.density(np.ones(1))[0]) if _is_white(d) else _oscillator(d)
        for d in disturbances
    }
    return shaped(plant, sources)


def shaped(plant: LinearPlant, sources: Mapping[str, ShapingFilter | float]) -> LinearPlant:
    """Return a plant that white noises of intensity 1 shake as the sources do.

    Parameters
    ----------
    plant
        Without delays.
    sources
        By name of a disturbance: a filter, or the intensity of white noise.  Disturbances that
        are not named rest.  A white noise whose rate acts too has no finite variance and keeps
        the rate out.
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


def _is_white(disturbance: Disturbance) -> bool:
    if disturbance.band is not None:
        return False
    density = disturbance.density(np.geomspace(1e-3, 1e3, 7))
    return bool(np.all(density == density[0]))


def _oscillator(disturbance: Disturbance) -> ShapingFilter:
    """Return an oscillator with the peak frequency, peak density and variance of a spectrum."""
    low, high = disturbance.band or (1e-3, 1e3)
    omega = np.geomspace(max(low, 1e-4 * high), high, 400)
    density = disturbance.density(omega)
    k = int(np.argmax(density))
    variance, peak = float(np.trapezoid(density, omega)), float(omega[k])
    # An oscillator's density at resonance is m0 / (pi damping peak).
    damping = variance / (np.pi * omega[k] * max(float(density[k]), 1e-300))
    damping = float(np.clip(damping, 0.01, 2.0))
    return ShapingFilter(
        A=np.array([[0.0, 1.0], [-(peak**2), -2.0 * damping * peak]]),
        B=np.array([[0.0], [np.sqrt(4.0 * damping * peak**3) * np.sqrt(variance)]]),
        C=np.array([[1.0, 0.0]]),
        variance_error=0.0,
        shape_error=np.nan,
    )
