"""The limits of long waves: tables that keep them, and the mistakes of those that do not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from vessel_tables import DATA, orcaflex_text, swinging, wamit_text

from models.basics import InputError, PhysicsWarning
from models.vessel import VesselRaos
from models.vessel.readers import check_long_waves, read_raos, write_raos

RAOS = swinging()
NED = (1.0, -1.0, -1.0, 1.0, -1.0, -1.0)


def signed(raos: VesselRaos, *signs: float) -> VesselRaos:
    return replace(raos, values=raos.values * np.array(signs))


def headed(raos: VesselRaos, heading: np.ndarray) -> VesselRaos:
    """The table with its headings called otherwise."""
    new = np.mod(heading, 2.0 * math.pi)
    new = np.where(2.0 * math.pi - new < 1e-9, 0.0, new)
    order = np.argsort(new)
    return replace(raos, heading=new[order], values=raos.values[:, order])


def over_slope(raos: VesselRaos) -> VesselRaos:
    k = raos.wave_number(raos.omega)[:, None]
    ones = np.ones_like(k)
    return replace(raos, values=raos.values / np.stack([ones, ones, ones, k, k, k], axis=-1))


MISTAKES = {
    "lag for lead": lambda r: replace(r, values=np.conj(r.values)),
    "where the waves come from": lambda r: headed(r, r.heading + math.pi),
    "z down": lambda r: headed(signed(r, *NED), -r.heading),
    "heave positive down": lambda r: signed(r, 1, 1, -1, 1, 1, 1),
    "relative to the trough": lambda r: replace(r, values=-r.values),
    "mirrored headings": lambda r: headed(r, -r.heading),
    "y to starboard": lambda r: signed(r, 1, -1, 1, -1, 1, -1),
    "bow up": lambda r: signed(r, 1, 1, 1, 1, -1, 1),
    "roll positive port down": lambda r: signed(r, 1, 1, 1, -1, 1, 1),
    "z down, and lag for lead": lambda r: headed(
        signed(replace(r, values=np.conj(r.values)), *NED), -r.heading
    ),
    "zero up-crossing": lambda r: replace(r, values=-1j * r.values),
    "zero down-crossing": lambda r: replace(r, values=1j * r.values),
    "in degrees per metre": lambda r: signed(r, 1, 1, 1, *[math.degrees(1.0)] * 3),
    "in radians taken for degrees": lambda r: signed(r, 1, 1, 1, *[math.radians(1.0)] * 3),
    "a length of 9": lambda r: signed(r, 1, 1, 1, 95.0, 95.0, 95.0),
    "over the wave slope": over_slope,
}


def real_tables() -> list[VesselRaos]:
    if not DATA.is_dir():
        return []
    return [read_raos(DATA / "mss" / name) for name in ("supply.re1", "tanker.4")]


def without_the_longest(raos: VesselRaos, lowest: float) -> VesselRaos:
    kept = raos.omega >= lowest
    return replace(raos, omega=raos.omega[kept], values=raos.values[kept])


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_is_named(mistake: str) -> None:
    found = check_long_waves(MISTAKES[mistake](RAOS))
    assert mistake in found.mistake
    assert not found.ok
    tables = real_tables()
    # Real vessels, and tables that begin at 40, 31 and 21 s.
    for raos in [*tables, *(without_the_longest(t, w) for t in tables for w in (0.15, 0.2, 0.3))]:
        assert check_long_waves(raos).ok
        if mistake == "a length of 9":
            assert (
                "times the wave slope" in check_long_waves(signed(raos, 1, 1, 1, 9, 9, 9)).mistake
            )
        else:
            assert mistake in check_long_waves(MISTAKES[mistake](raos)).mistake


def test_a_table_that_keeps_the_limits_is_left_alone() -> None:
    found = check_long_waves(RAOS)
    assert found.ok
    assert (found.mistake, found.remarks) == ("", ())
    assert found.error < 0.05
    assert found.wave_length == pytest.approx(2.0 * math.pi * 9.80665 / 0.08**2)
    heave = next(row for row in found.rows if row.motion == "heave" and row.heading_deg == 180.0)
    assert heave.verdict == "ok"
    assert {row.motion for row in found.rows} == {"surge", "sway", "heave", "roll", "pitch"}
    # A phase origin far away is looked through.
    assert check_long_waves(RAOS.with_phase_origin((500.0, 90.0))).error == pytest.approx(
        found.error, abs=1e-9
    )


def test_limits_at_finite_depth_take_the_sweep_of_shallow_water() -> None:
    shallow = replace(RAOS, depth=12.0)
    k, deep = shallow.wave_number(shallow.omega), RAOS.wave_number(RAOS.omega)
    ratio = (k / deep)[:, None]
    sweep = 1.0 / np.tanh(k * 12.0)[:, None]
    ones = np.ones_like(ratio)
    scaled = RAOS.values * np.stack([sweep, sweep, ones, ratio, ratio, ratio], axis=-1)
    found = check_long_waves(replace(shallow, values=scaled))
    assert found.error < 0.05
    surge = next(row for row in found.rows if row.motion == "surge")
    assert abs(surge.expected) == pytest.approx(1.0 / math.tanh(float(k[0]) * 12.0))


def test_what_no_mistake_explains_is_a_warning_only(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    odd = replace(RAOS, values=RAOS.values * np.exp(2j * rng.normal(size=(8, 1, 6))))
    found = check_long_waves(odd)
    assert (found.mistake, found.ok) == ("", False)
    path = write_raos(tmp_path / "odd.csv", odd)
    with pytest.warns(PhysicsWarning, match="no usual mistake of convention explains it"):
        raos = read_raos(path)
    assert any(note.startswith("check: ") for note in raos.notes)


def test_a_table_of_short_waves_is_read_with_a_remark() -> None:
    found = check_long_waves(without_the_longest(RAOS, 0.6))
    assert not found.mistake
    assert "too short" in found.remarks[0]
    assert not found.ok  # it says nothing


def test_motions_that_are_not_given_are_not_held_against_it() -> None:
    found = check_long_waves(signed(RAOS, 0, 0, 1, 1, 0, 0))
    assert found.ok
    assert {row.motion for row in found.rows} == {"heave", "roll"}


@pytest.mark.parametrize(
    ("words", "change"),
    [
        ("lag for lead", {"sense": ("leads", "lags")}),
        ("heave positive down", {"HeavePositive": ("up", "down")}),
        ("bow up", {"PitchPositiveBow": ("down", "up")}),
        ("in degrees per metre", {"RAOResponseUnits": ("degrees", "radians")}),
        ("over the wave slope", {"RAOWaveUnit": ("max wave slope", "amplitude")}),
        ("relative to the trough", {"RAOPhaseRelativeToConvention": ("crest", "trough")}),
    ],
)
def test_an_orcaflex_file_with_a_wrong_key_is_refused_by_its_name(
    words: str, change: dict[str, tuple[str, str]], tmp_path: Path
) -> None:
    key, (right, wrong) = next(iter(change.items()))
    key = "RAOPhaseConvention" if key == "sense" else key
    wave = right if key == "RAOWaveUnit" else "amplitude"
    angles = "radians" if key == "RAOWaveUnit" else "degrees"
    text = orcaflex_text(RAOS, wave=wave, angles=angles)
    assert f"{key}: {right}" in text
    path = tmp_path / "a.yml"
    path.write_text(text.replace(f"{key}: {right}", f"{key}: {wrong}"))
    with pytest.raises(InputError, match="in long waves") as raised:
        read_raos(path)
    assert words in str(raised.value)
    assert "--no-check" in str(raised.value)
    assert read_raos(path, check=False).heading.size == 12


def test_a_wamit_file_of_another_ulen_names_the_length(tmp_path: Path) -> None:
    path = tmp_path / "a.4"
    path.write_text(wamit_text(RAOS, length=310.0))
    with pytest.raises(InputError, match=r"length of 3\d\d m"):
        read_raos(path)
    assert check_long_waves(read_raos(path, length=310.0)).ok
