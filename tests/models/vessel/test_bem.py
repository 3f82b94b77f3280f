from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from vessel_tables import mirrored

import models.vessel.hull.bem as bem
from models.basics import GRAVITY, SEA_WATER_DENSITY, InputError, wave_number
from models.vessel import VesselRaos
from models.vessel.hull import (
    FloatingBody,
    Hull,
    Hydrodynamics,
    ShipLines,
    box_hull,
    read_hull,
    usual_frequencies,
    vessel_from_hull,
)
from models.vessel.hull.bem import froude_krylov, waterplane_lid
from models.vessel.hull.hydrostatics import (
    Loading,
    Waterplane,
    mass_matrix,
    moved,
    stiffness_matrix,
)
from models.vessel.hull.vessel import well_spaced

pytestmark = pytest.mark.ci  # whole optimisations in fixtures

BOX = box_hull(60.0, 14.0, 4.0, panels=120)
PLANE = Waterplane.of(BOX)
LOADING = Loading.of(PLANE, gm=1.5)


def body_of(water: Hydrodynamics, roll_damping: float = 0.05) -> FloatingBody:
    return FloatingBody(
        hydrodynamics=water,
        mass=mass_matrix(LOADING, water.point),
        stiffness=moved(stiffness_matrix(PLANE, LOADING), (0.0, 0.0, 0.0), water.point),
        centre=LOADING.centre,
        roll_damping=roll_damping,
    )


def oscillator(roll_damping: float, mass: float = 2.0, spring: float = 8.0) -> FloatingBody:
    omega = np.linspace(0.2, 6.0, 59)
    water = Hydrodynamics(
        omega=omega,
        heading=[0.0],
        added_mass=np.broadcast_to(np.eye(6), (59, 6, 6)),
        damping=np.broadcast_to(1e-6 * np.eye(6), (59, 6, 6)),
        excitation=np.ones((59, 1, 6)),
    )
    return FloatingBody(
        hydrodynamics=water,
        mass=mass * np.eye(6),
        stiffness=spring * np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 0.0]),
        centre=(0.0, 0.0, 0.0),
        roll_damping=roll_damping,
    )


# --- without the panel method -------------------------------------------------------------------


def test_an_uncoupled_body_answers_as_an_oscillator() -> None:
    body = oscillator(0.1)
    natural = math.sqrt(8.0 / 3.0)
    periods = body.natural_periods()
    assert (periods.heave, periods.roll, periods.pitch) == pytest.approx(
        (2.0 * math.pi / natural,) * 3
    )
    assert body.critical_roll_damping == pytest.approx(2.0 * math.sqrt(3.0 * 8.0))
    roll = body.motions([natural])[0, 0, 3]
    assert roll == pytest.approx(
        -1j / (2.0 * 0.1 * 8.0), rel=1e-5
    )  # F / (2 zeta C), a quarter late


def test_twice_the_damping_halves_the_roll_at_resonance_and_leaves_heave_alone() -> None:
    natural = [math.sqrt(8.0 / 3.0)]
    little, more = (oscillator(z).motions(natural)[0, 0] for z in (0.04, 0.08))
    assert abs(little[3] / more[3]) == pytest.approx(2.0, rel=1e-5)
    assert little[2] == more[2]


def test_the_table_of_motions_is_fine_where_they_bend() -> None:
    body = oscillator(0.05)
    heavily_damped = replace(body.hydrodynamics, damping=np.broadcast_to(4 * np.eye(6), (59, 6, 6)))
    rows = well_spaced(replace(body, hydrodynamics=heavily_damped))
    assert np.all(np.isin(np.round(heavily_damped.omega, 9), rows))
    assert np.all(np.diff(rows) > 0.0)
    body = replace(oscillator(0.05), stiffness=8.0 * np.diag([0.0, 0, 0, 1, 0, 0]))
    rows = well_spaced(body)
    near = np.diff(rows)[np.argmin(np.abs(rows - math.sqrt(8.0 / 3.0)))]
    assert near < 0.3 * np.diff(body.hydrodynamics.omega).min()
    table = VesselRaos(name="x", omega=rows, heading=[0.0], values=body.motions(rows))
    between = np.linspace(1.0, 3.0, 400)
    exact, straight = body.motions(between)[:, 0, 3], table.response(between, 0.0)[:, 3]
    assert np.abs(exact - straight).max() < 0.02 * np.abs(exact).max()


def test_coefficients_between_rows_follow_a_cubic_exactly() -> None:
    omega = np.linspace(0.2, 2.0, 12)
    curve = (1.0 + omega - omega**2 + 0.3 * omega**3)[:, None, None] * np.eye(6)
    water = Hydrodynamics(
        omega=omega, heading=[0.0], added_mass=curve, damping=curve, excitation=1j * curve[:, :1]
    )
    w = 1.2345
    found = water.resampled([w])
    assert found.added_mass[0, 2, 2] == pytest.approx(1.0 + w - w**2 + 0.3 * w**3, rel=1e-12)
    with pytest.raises(InputError, match="omega must be at most 2 rad/s, got"):
        water.resampled([2.1])


@pytest.mark.parametrize("heading", [0.0, 0.7, math.pi / 2.0, 2.5])
@pytest.mark.parametrize("depth", [math.inf, 12.0])
def test_the_undisturbed_wave_lifts_a_box_as_its_integral_says(
    heading: float, depth: float
) -> None:
    hull, omega = box_hull(60.0, 14.0, 4.0, panels=600), 0.8
    k = float(wave_number(omega, depth))
    decay = (
        math.exp(-k * 4.0)
        if math.isinf(depth)
        else math.cosh(k * (depth - 4.0)) / math.cosh(k * depth)
    )
    a, b = k * math.cos(heading) / 2.0 * 60.0, k * math.sin(heading) / 2.0 * 14.0
    area = 60.0 * 14.0 * np.sinc(a / math.pi) * np.sinc(b / math.pi)
    found = froude_krylov(hull, omega=omega, heading=heading, depth=depth)[0]
    wanted = SEA_WATER_DENSITY * GRAVITY * decay * area
    assert found[2] == pytest.approx(wanted, rel=2e-4)


def test_long_waves_turn_the_hull_with_its_hydrostatic_stiffness() -> None:
    hull = ShipLines(length=80.0, beam=18.0, draught=6.0).hull(panels=200)
    plane = Waterplane.of(hull)
    loading = Loading.of(plane, gm=1.5)
    omega = 0.01
    k, heading = float(wave_number(omega)), 1.1
    slope = np.array([0, 0, 1, -1j * k * math.sin(heading), 1j * k * math.cos(heading), 0])
    force = froude_krylov(hull, omega=omega, heading=heading)[0]
    # A hull that follows the surface: stiffness, and the weight that the sloping water carries.
    sway, surge = -1j * math.sin(heading), -1j * math.cos(heading)
    inertia = mass_matrix(loading) @ np.array([surge, sway, 1.0, slope[3], slope[4], 0.0])
    wanted = stiffness_matrix(plane, loading) @ slope - omega**2 * inertia
    assert force[3:5] == pytest.approx(wanted[3:5], rel=2e-3)
    assert force[2] == pytest.approx(wanted[2], rel=2e-3)


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[int]:
    """A panel method that makes its numbers up, and counts how often it was asked."""
    asked: list[int] = []

    def pretend(hull: Hull, **given: Any) -> Hydrodynamics:
        omega, heading = given["omega"], given["heading"]
        asked.append(len(heading))
        rng = np.random.default_rng(3)
        sides = np.where(np.abs(np.sin(heading)) > 1e-9, 1.0, 0.0)[:, None]
        only = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
        force = rng.normal(size=(len(omega), len(heading), 6)) * (1.0 - only * (1.0 - sides))
        return Hydrodynamics(
            omega=omega,
            heading=heading,
            added_mass=1e5 * np.broadcast_to(np.eye(6), (len(omega), 6, 6)),
            damping=1e5 * np.broadcast_to(np.eye(6), (len(omega), 6, 6)),
            excitation=force,
            depth=given["depth"],
        )

    monkeypatch.setenv("STILLHOOK_CACHE", str(tmp_path))
    monkeypatch.setattr(bem, "solve_hull", pretend)
    monkeypatch.setattr(bem, "versions", lambda: {"capytaine": "3"})
    monkeypatch.setattr("models.vessel.hull.vessel.versions", lambda: {"capytaine": "3"})
    return asked


def test_a_hull_is_solved_once_whatever_its_loading(solved: list[int]) -> None:
    first = vessel_from_hull(BOX, gm=1.5)
    again = vessel_from_hull(BOX, gm=1.5)
    assert (first.kept, again.kept) == (False, True)
    assert np.array_equal(first.raos.values, again.raos.values)
    assert vessel_from_hull(BOX, gm=1.0, roll_damping=0.1).kept
    assert len(solved) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"depth": 30.0},
        {"density": 1000.0},
        {"lid": False},
        {"heading_step": math.radians(30.0)},
        {"omega": [0.2, 0.4, 0.6, 0.8]},
    ],
)
def test_whatever_the_coefficients_hang_on_makes_them_computed_anew(
    solved: list[int], change: dict[str, Any]
) -> None:
    vessel_from_hull(BOX, gm=1.5)
    assert not vessel_from_hull(BOX, gm=1.5, **change).kept
    assert not vessel_from_hull(box_hull(60.0, 14.0, 4.1, panels=120), gm=1.5).kept
    assert len(solved) == 3


def test_a_damaged_or_forbidden_cache_costs_only_time(solved: list[int], tmp_path: Path) -> None:
    whole = vessel_from_hull(BOX, gm=1.5)
    (place,) = (tmp_path / "hulls").iterdir()
    for damage in (b"", b"nonsense", place.read_bytes()[:-40], bytes(place.stat().st_size)):
        place.write_bytes(damage)
        found = vessel_from_hull(BOX, gm=1.5)
        assert not found.kept
        assert np.array_equal(found.raos.values, whole.raos.values)
    place.unlink()
    place.parent.rmdir()
    place.parent.write_text("a file where the folder should be")
    assert not vessel_from_hull(BOX, gm=1.5).kept
    assert len(solved) == 6


def test_a_hull_with_two_like_sides_is_solved_for_one(solved: list[int]) -> None:
    found = vessel_from_hull(BOX, gm=1.5).raos
    assert solved == [13]
    assert np.allclose(np.degrees(found.heading), np.arange(0.0, 360.0, 15.0))
    assert np.allclose(mirrored(found).values, found.values)


def test_a_hull_with_unlike_sides_is_solved_all_round(solved: list[int]) -> None:
    panels = np.array(BOX.panels)
    panels[..., 1] += 0.5 * (panels[..., 1] > 6.0)
    found = vessel_from_hull(Hull(name="lopsided", panels=panels), gm=1.5)
    assert solved == [24]
    assert not found.hull.symmetric


def test_what_it_was_made_from_stands_in_the_notes(solved: list[int]) -> None:
    found = vessel_from_hull(BOX, gm=1.5, command="stillhook vessel hull --box 60,14,4")
    text = "\n".join(found.raos.notes)
    for word in ("shape box", "digest", "5 % of critical", "1025 kg/m3", "capytaine 3", "made by"):
        assert word in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"roll_damping": 5.0}, r"roll_damping must be in \[0, 1\]"),
        ({"heading_step": math.radians(7.0)}, "must divide the circle"),
        ({"omega": [0.5, 0.4, 0.6, 0.7]}, "strictly ascending"),
        ({"omega": [0.5, 0.6]}, "at least 4 rows"),
        ({"gm": None}, "got neither"),
    ],
)
def test_figures_out_of_range_are_refused(
    solved: list[int], change: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        vessel_from_hull(BOX, **{"gm": 1.5, **change})
    assert not solved


def test_long_ships_get_more_frequencies() -> None:
    short, long = (box_hull(length, 20.0, 6.0, panels=100) for length in (60.0, 300.0))
    assert np.allclose(usual_frequencies(short), np.linspace(0.15, 2.0, 38))
    omega = usual_frequencies(long)
    assert (omega[0], omega[-1]) == (0.15, 2.0)
    assert np.diff(omega**2 / GRAVITY).max() * 150.0 < 1.0


def test_what_to_take_with_care_is_told(solved: list[int]) -> None:
    rough = vessel_from_hull(BOX, gm=0.1, roll_damping=0.0, omega=np.linspace(0.2, 2.0, 6))
    text = " ".join(rough.warnings)
    for words in ("four panels", "no damping of roll", "0.15 m", "radii of", "take 37 frequ"):
        assert words in text


def test_the_lid_covers_the_waterplane() -> None:
    for hull in (BOX, ShipLines(length=80.0, beam=18.0, draught=6.0).hull(panels=300)):
        lid = waterplane_lid(hull)
        assert lid is not None
        cross = np.cross(lid[:, 2] - lid[:, 0], lid[:, 3] - lid[:, 1])[:, 2] / 2.0
        assert np.abs(cross).sum() == pytest.approx(Waterplane.of(hull).area, rel=1e-4)
        assert not np.any(lid[..., 2])


def test_two_hulls_have_no_simple_lid() -> None:
    one = np.array(BOX.panels)
    both = np.concatenate([np.add(one, (0.0, 12.0, 0.0)), np.subtract(one, (0.0, 12.0, 0.0))])
    assert waterplane_lid(Hull(name="catamaran", panels=both)) is None


def test_without_capytaine_the_message_tells_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "capytaine", None)
    monkeypatch.setenv("STILLHOOK_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=r"pip install -e '\.\[bem\]'"):
        vessel_from_hull(BOX, gm=1.5)
    (tmp_path / "box.gdf").write_text("a box\n1 9.81\n0 0\n1\n", encoding="ascii")
    with pytest.raises(InputError, match=r"pip install -e '\.\[bem\]'"):
        read_hull(tmp_path / "box.gdf")


# --- with it ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def water() -> Hydrodynamics:
    pytest.importorskip("capytaine")
    from models.vessel.hull.bem import solve_hull

    headings = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    return solve_hull(BOX, omega=[0.02, 0.4, 0.7, 1.0], heading=headings)


def test_in_long_waves_the_box_goes_with_the_surface(water: Hydrodynamics) -> None:
    k, b = float(wave_number(0.02)), water.heading
    found = body_of(water).motions()[0]
    assert np.abs(found[:, 2] - 1.0).max() < 1e-4
    assert np.abs(found[:, 4] / k - 1j * np.cos(b)).max() < 4e-3
    assert np.abs(found[:, 3] / k + 1j * np.sin(b)).max() < 4e-3
    assert np.abs(found[:, 0] + 1j * np.cos(b)).max() < 4e-3
    assert np.abs(found[:, 1] + 1j * np.sin(b)).max() < 4e-3


def test_rigid_transfer_is_a_computation_about_the_tip(water: Hydrodynamics) -> None:
    from models.vessel.hull.bem import solve_hull

    tip = (-20.0, 9.0, 25.0)
    there = solve_hull(BOX, omega=water.omega, heading=water.heading[:5], point=tip)
    direct = body_of(there).motions()
    here = VesselRaos(
        name="box", omega=water.omega, heading=water.heading, values=body_of(water).motions()
    )
    moved = here.at(tip).values[:, :5]
    assert np.abs(moved - direct).max() < 1e-11 * np.abs(direct).max()


def test_waves_from_the_other_side_are_the_mirror_image(water: Hydrodynamics) -> None:
    half = replace(water, heading=water.heading[:9], excitation=water.excitation[:, :9])
    scale = np.abs(water.excitation).max(axis=(0, 1))
    assert np.all(np.abs(half.mirrored().excitation - water.excitation) < 1e-9 * scale.max())


def test_waves_made_and_waves_felt_belong_together(water: Hydrodynamics) -> None:
    from models.vessel.hull.bem import solve_hull

    # Haskind and Newman: B_ii = k / (8 pi rho g c_g) times the integral of |F_i|^2 over headings;
    # damping by radiation and force by diffraction are two routes to it.
    hull = ShipLines(length=60.0, beam=14.0, draught=4.0).hull(panels=480)
    found = solve_hull(hull, omega=[0.5, 0.8], heading=water.heading)
    for row, omega in enumerate(found.omega):
        k, group = omega**2 / GRAVITY, GRAVITY / (2.0 * omega)
        integral = (np.abs(found.excitation[row]) ** 2).mean(axis=0) * 2.0 * math.pi
        wanted = k / (8.0 * math.pi * SEA_WATER_DENSITY * GRAVITY * group) * integral
        assert np.diag(found.damping[row]) == pytest.approx(wanted, rel=0.05)
    coarse = replace(
        water, omega=water.omega[1:], added_mass=water.added_mass[1:], damping=water.damping[1:],
        excitation=water.excitation[1:],
    )  # fmt: skip
    assert found.energy_error() < 0.04 < coarse.energy_error()


def test_added_mass_and_damping_are_symmetric_and_take_energy(water: Hydrodynamics) -> None:
    w = water.omega[1:, None, None]
    impedance = water.damping[1:] + 1j * w * water.added_mass[1:]
    size = np.abs(np.einsum("kii->ki", impedance))
    pairs = np.sqrt(size[:, :, None] * size[:, None, :])
    assert np.all(np.abs(impedance - impedance.transpose(0, 2, 1)) <= 0.1 * pairs)
    # Roll of a box makes next to no waves: on so few panels its damping is lost in the noise.
    assert np.all(np.einsum("kii->ki", water.damping)[1:, [0, 1, 2, 4, 5]] > 0.0)


def test_capytaines_hydrostatics_tend_to_ours(water: Hydrodynamics) -> None:
    import capytaine as cpt

    from models.vessel.hull.bem import capytaine_mesh

    # One point a panel: their error falls with the panels' size squared.
    point = (3.0, 0.0, 1.0)
    ours = moved(stiffness_matrix(PLANE, LOADING), (0.0, 0.0, 0.0), point)[2:5, 2:5]
    theirs = []
    for panels in (380, 1500):
        hull = box_hull(60.0, 14.0, 4.0, panels=panels)
        across = len(np.unique(np.round(hull.panels[..., 1], 6))) - 1
        body = cpt.FloatingBody(
            mesh=capytaine_mesh(hull),
            dofs=cpt.rigid_body_dofs(rotation_center=point),
            center_of_mass=LOADING.centre,
        )
        stiffness = body.compute_hydrostatic_stiffness(rho=SEA_WATER_DENSITY, g=GRAVITY)
        theirs.append((1.0 / across**2, stiffness.values[2:5, 2:5]))
    (a, first), (b, second) = theirs
    limit = (first * b - second * a) / (b - a)
    assert limit[1, 1] == pytest.approx(ours[1, 1], rel=1e-6)
    assert limit[0] == pytest.approx(ours[0], rel=1e-6, abs=1e-6 * ours[0, 0])
    assert abs(second[1, 1] / ours[1, 1] - 1.0) < 0.02


def test_the_undisturbed_wave_pushes_as_capytaine_says(water: Hydrodynamics) -> None:
    import capytaine as cpt
    from capytaine.bem.airy_waves import froude_krylov_force

    from models.vessel.hull.bem import capytaine_mesh

    hull = box_hull(60.0, 14.0, 4.0, panels=1500)
    body = cpt.FloatingBody(mesh=capytaine_mesh(hull), dofs=cpt.rigid_body_dofs())
    problem = cpt.DiffractionProblem(
        body=body, omega=0.8, wave_direction=0.6, rho=SEA_WATER_DENSITY, g=GRAVITY
    )
    given: npt.NDArray[np.complex128] = np.array(list(froude_krylov_force(problem).values()))
    found = froude_krylov(hull, omega=0.8, heading=0.6)[0]
    assert np.abs(found - np.conj(given)).max() < 0.01 * np.abs(found).max()
    assert found[:3] == pytest.approx(np.conj(given)[:3], rel=0.01)
