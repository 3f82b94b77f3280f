from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from models.basics import InputError
from models.vessel import MODES, VesselRaos
from models.vessel.hull import FloatingBody, Hydrodynamics, box_hull
from models.vessel.hull.hydrostatics import (
    Loading,
    Waterplane,
    mass_matrix,
    moved,
    stiffness_matrix,
)
from models.vessel.readers import read_raos

DATA = Path(__file__).parents[4] / "shared" / "data"
NAMES = tuple(mode.capitalize() for mode in MODES)
CENTRE = (1.0, 0.0, -1.5)


def read_capytaine(path: Path, **options: Any) -> VesselRaos:
    return read_raos(path, file_format="capytaine", check=False, **options)


def body(roll_damping: float = 0.0) -> FloatingBody:
    """A made-up vessel with every coupling there can be."""
    rng = np.random.default_rng(2)
    omega = np.linspace(0.3, 1.6, 6)
    plane = Waterplane.of(box_hull(60.0, 14.0, 4.0, panels=60))
    loading = Loading.of(plane, gm=1.5)

    def symmetric(scale: float) -> Any:
        root = rng.normal(size=(6, 6, 6))
        return scale * (root @ root.transpose(0, 2, 1))

    scale = np.diag([1.0, 1.0, 1.0, 5.0, 15.0, 15.0])
    return FloatingBody(
        hydrodynamics=Hydrodynamics(
            omega=omega,
            heading=np.radians([0.0, 40.0, 90.0, 180.0]),
            added_mass=scale @ symmetric(3e5) @ scale,
            damping=scale @ symmetric(1e5) @ scale,
            excitation=1e6 * (rng.normal(size=(6, 4, 6)) + 1j * rng.normal(size=(6, 4, 6))) @ scale,
            point=CENTRE,
        ),
        mass=mass_matrix(loading, CENTRE),
        stiffness=moved(stiffness_matrix(plane, loading), (0.0, 0.0, 0.0), CENTRE),
        centre=loading.centre,
        roll_damping=roll_damping,
    )


def dataset(vessel: FloatingBody | None = None, dofs: Sequence[str] = NAMES) -> xr.Dataset:
    """What Capytaine would have written: its convention, its names."""
    vessel = body() if vessel is None else vessel
    water = vessel.hydrodynamics
    wave = np.conj(water.excitation)
    square = ("influenced_dof", "radiating_dof")
    return xr.Dataset(
        {
            "added_mass": (("omega", *square), water.added_mass),
            "radiation_damping": (("omega", *square), water.damping),
            "diffraction_force": (("omega", "wave_direction", "influenced_dof"), 0.3 * wave),
            "Froude_Krylov_force": (("omega", "wave_direction", "influenced_dof"), 0.7 * wave),
            "inertia_matrix": (square, vessel.mass),
            "hydrostatic_stiffness": (square, vessel.stiffness),
        },
        coords={
            "omega": water.omega,
            "wave_direction": water.heading,
            "influenced_dof": list(dofs),
            "radiating_dof": list(dofs),
            "rotation_center": ("xyz", list(water.point)),
            "rho": 1025.0,
            "g": 9.81,
            "water_depth": math.inf,
        },
        attrs={"capytaine_version": "3.0"},
    )


def written(path: Path, data: xr.Dataset, *, engine: str = "scipy") -> Path:
    """Write as Capytaine does: complex numbers as pairs along an axis."""
    data = data.copy()
    for name in list(data.data_vars):
        if data[name].dtype.kind == "c":
            values = np.stack([data[name].values.real, data[name].values.imag])
            data[name] = (("complex", *data[name].dims), values)
            data = data.assign_coords(complex=["re", "im"])
    data.to_netcdf(path, engine=engine)  # type: ignore[call-overload]
    return path


def expected(vessel: FloatingBody) -> Any:
    water = vessel.hydrodynamics
    x, y, _ = water.point
    along = x * np.cos(water.heading) + y * np.sin(water.heading)
    k = water.omega**2 / 9.80665
    return vessel.motions() * np.exp(1j * k[:, None] * along)[..., None]


def test_motions_follow_from_the_coefficients(tmp_path: Path) -> None:
    found = read_capytaine(written(tmp_path / "ship.nc", dataset()))
    assert found.origin == CENTRE
    assert found.phase_origin == CENTRE[:2]
    assert found.values == pytest.approx(expected(body()), rel=1e-9)
    assert any("no damping of roll" in note for note in found.notes)


def test_roll_damping_is_a_share_of_the_critical(tmp_path: Path) -> None:
    path = written(tmp_path / "ship.nc", dataset())
    found = read_capytaine(path, roll_damping=0.2)
    assert found.values == pytest.approx(expected(body(0.2)), rel=1e-9)
    still, damped = read_capytaine(path).mode("roll"), found.mode("roll")
    assert np.abs(damped).max() < 0.95 * np.abs(still).max()


def test_frequencies_too_far_apart_for_the_resonance_of_roll_are_told(tmp_path: Path) -> None:
    vessel = body()
    water = vessel.hydrodynamics
    steady = np.broadcast_to(np.diag(np.diag(vessel.mass)), water.added_mass.shape)
    still = replace(water, added_mass=0.2 * steady, damping=1e-4 * steady)
    path = written(tmp_path / "ship.nc", dataset(replace(vessel, hydrodynamics=still)))
    told = [note for note in read_capytaine(path, roll_damping=0.02).notes if "resonates" in note]
    assert len(told) == 1
    assert "0.26 rad/s apart" in told[0]
    assert not [n for n in read_capytaine(path, roll_damping=0.4).notes if "resonates" in n]


def test_order_and_names_of_axes_do_not_matter(tmp_path: Path) -> None:
    plain = read_capytaine(written(tmp_path / "ship.nc", dataset()))
    turned = dataset(dofs=[f"Barge__{name.upper()}" for name in NAMES])
    order = [4, 2, 5, 0, 3, 1]
    turned = turned.isel(
        influenced_dof=order, radiating_dof=order[::-1], omega=slice(None, None, -1),
        wave_direction=[2, 0, 3, 1],
    )  # fmt: skip
    turned = turned.transpose("wave_direction", "radiating_dof", "influenced_dof", "omega", "xyz")
    assert np.allclose(
        read_capytaine(written(tmp_path / "turned.nc", turned)).values, plain.values, rtol=1e-9
    )
    assert (tmp_path / "turned.nc").read_bytes()[:3] == b"CDF"
    modern = written(tmp_path / "modern.nc", turned, engine="h5netcdf")
    assert modern.read_bytes()[:4] == b"\x89HDF"
    assert np.allclose(read_capytaine(modern).values, plain.values, rtol=1e-9)


@pytest.mark.parametrize("axis", ["freq", "period", "wavenumber", "wavelength"])
@pytest.mark.parametrize("told", [True, False])
def test_the_axis_may_be_any_measure_of_frequency(tmp_path: Path, axis: str, told: bool) -> None:
    plain = read_capytaine(written(tmp_path / "ship.nc", dataset()))
    data = dataset()
    omega = data["omega"].values
    k = omega**2 / 9.81
    values = {
        "freq": omega / 2.0 / math.pi,
        "period": 2.0 * math.pi / omega,
        "wavenumber": k,
        "wavelength": 2.0 * math.pi / k,
    }[axis]
    data = data.rename({"omega": axis}).assign_coords({axis: values})
    if told:
        data = data.assign_coords(omega=(axis, omega))
    found = read_capytaine(written(tmp_path / "other.nc", data))
    assert np.allclose(found.omega, plain.omega, rtol=1e-12)
    assert np.allclose(found.values, plain.values, rtol=1e-8)


def test_a_rao_that_is_stored_is_taken_as_it_is(tmp_path: Path) -> None:
    data = dataset()
    values = np.random.default_rng(4).normal(size=(6, 4, 6)) * (1 + 2j)
    data["RAO"] = (("omega", "wave_direction", "radiating_dof"), values)
    data["rotation_center"] = ("xyz", [0.0, 0.0, -3.0])
    path = written(tmp_path / "ship.nc", data)
    assert np.allclose(read_capytaine(path).values, np.conj(values))
    # With damping of roll it is computed anew.
    assert not np.allclose(read_capytaine(path, roll_damping=0.05).values, np.conj(values))
    bare = written(tmp_path / "bare.nc", data[["RAO"]])
    assert np.allclose(read_capytaine(bare).values, np.conj(values))
    with pytest.raises(InputError, match="added_mass and radiation_damping missing"):
        read_capytaine(bare, roll_damping=0.05)


def test_frequencies_without_waves_are_left_out(tmp_path: Path) -> None:
    plain = dataset()
    ends = plain.isel(omega=[0, -1]).assign_coords(omega=[0.0, np.inf])
    for name in ("diffraction_force", "Froude_Krylov_force"):
        ends[name] = ends[name] * np.nan
    data = xr.concat(
        [plain, ends], dim="omega", data_vars="minimal", coords="minimal", compat="override"
    )
    found = read_capytaine(written(tmp_path / "ship.nc", data))
    assert np.allclose(found.omega, plain["omega"].values)
    assert np.allclose(found.values, expected(body()), rtol=1e-9)


def test_several_depths_ask_which(tmp_path: Path) -> None:
    data = dataset().drop_vars("water_depth")
    both = data.copy()
    both["added_mass"] = xr.concat([data["added_mass"], 9 * data["added_mass"]], dim="water_depth")
    both = both.assign_coords(water_depth=[20.0, np.inf])
    path = written(tmp_path / "ship.nc", both)
    with pytest.raises(InputError, match=r"2 values of water_depth \(20, inf m\); say which"):
        read_capytaine(path)
    with pytest.raises(InputError, match="water_depth must be one of 20, inf m, got 30 m"):
        read_capytaine(path, depth=30.0)
    assert read_capytaine(path, depth=20.0).depth == 20.0
    assert read_capytaine(path, depth=math.inf).depth == math.inf


def test_other_bodies_take_part_and_are_not_told(tmp_path: Path) -> None:
    one = dataset(dofs=[f"left__{name}" for name in NAMES])
    two = dataset(dofs=[f"right__{name}" for name in NAMES])
    both = xr.concat([one, two], dim="influenced_dof", join="outer", fill_value=0.0)
    both = both.assign_coords(rotation_center=("xyz", list(CENTRE)))
    path = written(tmp_path / "two.nc", both)
    with pytest.raises(InputError, match="say which body: left, right"):
        read_capytaine(path)
    alone = expected(body(0.1))
    for name in ("left", "right"):
        found = read_capytaine(path, body=name, roll_damping=0.1)
        assert np.allclose(found.values, alone, rtol=1e-9)


def test_a_body_that_is_held_in_some_motions_moves_in_the_others(tmp_path: Path) -> None:
    data = dataset().sel(influenced_dof=["Heave", "Roll"], radiating_dof=["Heave", "Roll"])
    found = read_capytaine(written(tmp_path / "held.nc", data))
    assert not np.abs(found.mode("pitch")).any()
    assert np.abs(found.mode("heave")).all()
    assert any("no surge, sway, pitch, yaw" in note for note in found.notes)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda d: d.drop_vars("added_mass"), "added_mass missing"),
        (lambda d: d.drop_vars("inertia_matrix"), "nor the variable inertia_matrix"),
        (lambda d: d.drop_vars("hydrostatic_stiffness"), "variable hydrostatic_stiffness"),
        (lambda d: d.drop_vars("diffraction_force"), "diffraction_force missing"),
        (lambda d: d.drop_vars("wave_direction"), "no coordinate wave_direction"),
        (lambda d: d.drop_vars("influenced_dof"), "no coordinate influenced_dof"),
        (lambda d: d.rename({"omega": "row"}), "no axis of frequencies"),
        (lambda d: d.assign_coords(wave_direction=[0.0, 45, 90, 180]), "must be in radians"),
        (lambda d: d.assign_coords(omega=d["omega"] * -1.0), "at least 0 rad/s"),
        (lambda d: d.assign(added_mass=d["added_mass"] * np.nan), "not finite"),
        (lambda d: d.assign(inertia_matrix=d["inertia_matrix"] * np.inf), "must be finite"),
        (
            lambda d: d.assign(added_mass=d["added_mass"].isel(radiating_dof=0)),
            "must have the axes",
        ),
        (lambda d: d.assign_attrs(incoming_waves_convention="WAMIT"), "must be Nemoh"),
        (lambda d: d.isel(omega=[0]), "at least 2 frequencies"),
        (lambda d: d[["inertia_matrix"]], "not one of Capytaine's"),
        (
            lambda d: d.assign_coords(influenced_dof=list("abcdef")),
            "none of the degrees of freedom",
        ),
        (lambda d: d.assign_coords(forward_speed=3.0), "at forward speed"),
    ],
)
def test_what_is_missing_or_wrong_is_named(tmp_path: Path, spoil: Any, words: str) -> None:
    path = written(tmp_path / "ship.nc", spoil(dataset()))
    with pytest.raises(InputError, match=words) as caught:
        read_capytaine(path)
    assert str(path) in str(caught.value)


def test_mass_and_stiffness_may_be_given(tmp_path: Path) -> None:
    bare = dataset().drop_vars(["inertia_matrix", "hydrostatic_stiffness"])
    order = [3, 1, 0, 5, 4, 2]
    bare = bare.isel(influenced_dof=order, radiating_dof=order)
    vessel = body()
    found = read_capytaine(
        written(tmp_path / "x.nc", bare), inertia=vessel.mass, stiffness=vessel.stiffness
    )
    assert np.allclose(found.values, expected(vessel), rtol=1e-9)
    with pytest.raises(InputError, match="must be 6 by 6"):
        read_capytaine(tmp_path / "x.nc", inertia=np.eye(3), stiffness=vessel.stiffness)


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_damaged_files_end_in_one_message(tmp_path: Path, engine: str) -> None:
    rng = np.random.default_rng(8)
    path = written(tmp_path / "ship.nc", dataset(), engine=engine)
    good = path.read_bytes()
    for turn in range(8 if engine == "h5netcdf" else 60):
        data = bytearray(good)
        if turn % 4 == 0:
            data = data[: int(rng.integers(1, len(data)))]
        elif turn % 4 == 1:
            for at in rng.integers(0, len(data), 40):
                data[at] = int(rng.integers(0, 256))
        elif turn % 4 == 2:
            cut = sorted(int(v) for v in rng.integers(8, len(data), 2))
            data = data[: cut[0]] + data[cut[1] :] + data[cut[0] : cut[1]]
        else:
            data = data[:8] + rng.bytes(int(rng.integers(1, 3000)))
        path.write_bytes(bytes(data))
        with contextlib.suppress(InputError):
            assert np.all(np.isfinite(read_capytaine(path).values))


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "empty"), (b"omega,heading", "no NetCDF"), (b"\x89HDF\r\n\x1a\n", "damaged HDF5")],
)
def test_what_is_no_netcdf_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "ship.nc"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_capytaine(path)
    with pytest.raises(InputError, match="no such file"):
        read_capytaine(tmp_path / "none.nc")


def test_a_file_that_is_cut_off_is_told_to_be(tmp_path: Path) -> None:
    path = written(tmp_path / "ship.nc", dataset(), engine="h5netcdf")
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(InputError, match=r"damaged HDF5 file .*truncated"):
        read_capytaine(path)


def test_a_file_that_capytaine_wrote_gives_capytaines_rao(tmp_path: Path) -> None:
    cpt = pytest.importorskip("capytaine")
    from capytaine.post_pro.rao import rao

    from models.vessel.hull.bem import capytaine_mesh, quiet

    with quiet():
        made = cpt.FloatingBody(
            mesh=capytaine_mesh(box_hull(60.0, 14.0, 4.0, panels=60)),
            dofs=cpt.rigid_body_dofs(rotation_center=CENTRE),
            center_of_mass=CENTRE,
        )
        matrix = xr.Dataset(
            coords={
                "omega": [0.4, 0.8, 1.2],
                "wave_direction": [0.0, 0.9, math.pi],
                "radiating_dof": list(made.dofs),
                "rho": [1025.0],
            }
        )
        found = cpt.BEMSolver().fill_dataset(matrix, made, progress_bar=False)
        theirs = rao(found)
        path = tmp_path / "box.nc"
        cpt.export_dataset(path, found)
        ours = read_capytaine(path)
    theirs = theirs.transpose("omega", "wave_direction", "radiating_dof").sel(
        radiating_dof=[mode.capitalize() for mode in MODES]
    )
    back = ours.with_phase_origin((0.0, 0.0))
    there = [int(np.argmin(np.abs(back.heading - b))) for b in (0.0, 0.9, math.pi)]
    assert np.allclose(back.values[:, there], np.conj(theirs.values), rtol=1e-9, atol=1e-12)
    assert ours.origin == CENTRE


@pytest.mark.skipif(not DATA.is_dir(), reason="the shared example files are not here")
def test_the_barge_of_another_program_moves_as_our_own_computation_says() -> None:
    pytest.importorskip("capytaine")
    from models.vessel.hull.bem import solve_hull

    path = DATA / "mafredo" / "barge_100x30x4.nc"
    with pytest.raises(InputError, match="nor the variable inertia_matrix"):
        read_raos(path)
    hull = box_hull(100.0, 30.0, 4.0, panels=150)
    plane = Waterplane.of(hull)
    loading = Loading.of(plane, kg=6.0, density=1000.0)
    mass = mass_matrix(loading)
    stiffness = stiffness_matrix(plane, loading)
    given = read_capytaine(path, roll_damping=0.2, inertia=mass, stiffness=stiffness)
    rows = [int(np.argmin(np.abs(given.omega - w))) for w in (0.2, 0.3, 0.4, 0.5, 0.6)]
    columns = [j for j, b in enumerate(given.heading) if b <= math.pi + 1e-9]
    water = solve_hull(
        hull, omega=given.omega[rows], heading=given.heading[columns], density=1000.0
    )
    ours = FloatingBody(
        hydrodynamics=water, mass=mass, stiffness=stiffness, centre=loading.centre,
        roll_damping=0.2,
    ).motions()  # fmt: skip
    theirs = given.values[np.ix_(rows, columns)]
    off = np.abs(ours - theirs).max(axis=1) / np.abs(theirs).max(axis=(0, 1))
    # In shorter waves the file is too coarse to be held against anything: of its added masses,
    # those of surge by pitch and of pitch by surge, which should be one, are 12 % apart.
    assert off[:, [0, 1, 2, 4, 5]].max() < 0.02
    assert off.max() < 0.06
    with xr.open_dataset(path, engine="h5netcdf") as raw:
        pair = raw["added_mass"].sel(omega=0.5)
        one = float(pair.sel(radiating_dof="Surge", influenced_dof="Pitch"))
        other = float(pair.sel(radiating_dof="Pitch", influenced_dof="Surge"))
    assert abs(one / other - 1.0) > 0.1
