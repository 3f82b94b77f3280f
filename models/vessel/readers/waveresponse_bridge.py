"""To and from the RAO objects of the waveresponse library.

The library keeps one grid per motion and lets each have its own wave convention; here they are
turned into ours (counter-clockwise, going to) and back.  It says nothing about the sides of the
vessel: its documentation takes x forward, y to port, z up, as we do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...basics import InputError
from ..raos import MODES, VesselRaos

if TYPE_CHECKING:
    from waveresponse import RAO


def to_waveresponse(raos: VesselRaos) -> dict[str, RAO]:
    """Return the six motions as objects of the library: rad/s, rad, towards, counter-clockwise."""
    from waveresponse import RAO

    return {
        mode: RAO(
            raos.omega,
            raos.heading,
            raos.values[:, :, i],
            freq_hz=False,
            degrees=False,
            clockwise=False,
            waves_coming_from=False,
        )
        for i, mode in enumerate(MODES)
    }


def from_waveresponse(raos: Mapping[str, RAO], *, name: str, depth: float) -> VesselRaos:
    """Return objects of the library as one table; see :meth:`VesselRaos.from_waveresponse`."""
    strange = sorted(set(raos) - set(MODES))
    if strange or not raos:
        raise InputError(
            f"{name}: the motions are {', '.join(MODES)}; got {', '.join(strange) or 'none'}"
        )
    omega = heading = None
    values = None
    for mode, rao in raos.items():
        ours = rao.copy()
        ours.set_wave_convention(clockwise=False, waves_coming_from=False)
        frequency, direction, grid = ours.grid(freq_hz=False, degrees=False)
        if omega is None or heading is None or values is None:
            omega, heading = frequency, direction
            values = np.zeros((omega.size, heading.size, len(MODES)), dtype=np.complex128)
        if (
            omega.shape != frequency.shape
            or heading.shape != direction.shape
            or not (np.allclose(omega, frequency) and np.allclose(heading, direction))
        ):
            raise InputError(f"{name}: {mode} has other frequencies or headings than the first RAO")
        values[:, :, MODES.index(mode)] = grid
    assert omega is not None
    assert heading is not None
    assert values is not None
    return VesselRaos(
        name=name, omega=omega, heading=heading, values=values, depth=depth, source="waveresponse"
    )
