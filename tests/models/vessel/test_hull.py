from __future__ import annotations

import contextlib
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.basics import GRAVITY, InputError
from models.vessel import VesselRaos
from models.vessel.crane import transport
from models.vessel.hull import Hull, ShipLines, box_hull, centre_of_mass, read_hull
from models.vessel.hull.hull import volumes
from models.vessel.hull.hydrostatics import (
    Loading,
    Waterplane,
    mass_matrix,
    moved,
    stiffness_matrix,
)
from models.vessel.hull.lines import section_coefficient, section_exponent

SHIP = ShipLines(length=80.0, beam=18.0, draught=6.0, block=0.70)


def stl(panels: npt.NDArray[np.float64], *, binary: bool = True) -> bytes:
    triangles = np.concatenate([panels[:, [0, 1, 2]], panels[:, [0, 2, 3]]])
    if binary:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        rows = np.zeros(len(triangles), dtype=kind)
        rows["corners"] = triangles
        return bytes(80) + len(triangles).to_bytes(4, "little") + rows.tobytes()
    lines = ["solid hull"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x:.6f} {y:.6e} {z:.6f}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid hull"]).encode()


def gdf(panels: npt.NDArray[np.float64], *, symmetric: bool) -> bytes:
    if symmetric:
        panels = panels[np.all(panels[..., 1] >= 0.0, axis=1)]
    lines = ["a hull", "1.0 9.81", f"0 {int(symmetric)}", str(len(panels))]
    lines += [" ".join(f"{v:.8f}" for v in corner) for panel in panels for corner in panel]
    return "\n".join(lines).encode()


def closed_box(length: float, beam: float, low: float, high: float) -> npt.NDArray[np.float64]:
    wet = box_hull(length, beam, high - low, panels=200).panels
    deck = wet[np.all(wet[..., 2] == wet[..., 2].min(), axis=1)][:, ::-1] * (1.0, 1.0, 0.0)
    return np.concatenate([wet, deck]) + np.array([0.0, 0.0, high])


def test_a_box_floats_as_its_closed_form_says() -> None:
    L, B, T = 100.0, 30.0, 4.0
    found = Waterplane.of(box_hull(L, B, T, panels=200))
    assert found.volume == pytest.approx(L * B * T, rel=1e-12)
    assert found.centre_of_buoyancy == pytest.approx((0.0, 0.0, -T / 2.0), abs=1e-9)
    assert found.area == pytest.approx(L * B, rel=1e-12)
    assert found.block == pytest.approx(1.0, rel=1e-12)
    assert found.metacentric_radii == pytest.approx((B**2 / 12.0 / T, L**2 / 12.0 / T), rel=1e-12)


@given(
    panels=st.integers(100, 600),
    block=st.floats(0.56, 0.8),
    width=st.one_of(st.just(0.0), st.floats(0.3, 0.9)),
    depth=st.floats(0.1, 0.4),
)
@settings(max_examples=15, deadline=None)
def test_a_ship_has_the_displacement_asked_and_a_closed_symmetric_surface(
    panels: int, block: float, width: float, depth: float
) -> None:
    lines = ShipLines(
        length=80.0, beam=18.0, draught=6.0, block=block, transom_width=width, transom_depth=depth
    )
    hull = lines.hull(panels=panels)
    assert volumes(hull.panels) == pytest.approx(block * 80.0 * 18.0 * 6.0, rel=1e-9)
    assert hull.symmetric
    assert (hull.length, hull.beam, hull.draught) == pytest.approx((80.0, 18.0, 6.0), rel=2e-2)


def test_a_ship_keeps_its_shape_as_the_panels_get_smaller() -> None:
    coarse, fine = (Waterplane.of(SHIP.hull(panels=n)) for n in (400, 1600))
    assert coarse.area == pytest.approx(fine.area, rel=0.01)
    assert coarse.metacentric_radii == pytest.approx(fine.metacentric_radii, rel=0.02)
    assert coarse.centre_of_buoyancy[2] == pytest.approx(fine.centre_of_buoyancy[2], rel=0.005)


def test_sections_have_the_area_that_a_numerical_integral_finds() -> None:
    for n in (1.5, 2.0, 7.0):
        y = np.linspace(0.0, 1.0, 200_001)
        area = float(np.trapezoid((1.0 - y**n) ** (1.0 / n), y))
        assert section_coefficient(n) == pytest.approx(area, rel=1e-5)
        assert section_exponent(section_coefficient(n)) == pytest.approx(n, rel=1e-9)


def test_a_hull_with_a_hole_or_a_turned_panel_is_refused() -> None:
    whole = box_hull(50.0, 10.0, 3.0, panels=100).panels
    with pytest.raises(InputError, match="not closed below the waterline"):
        Hull(name="leaky", panels=whole[6:])
    turned = np.array(whole)
    side = np.argmax(np.abs(whole[..., 1]).min(axis=1) > 4.9)
    turned[side] = turned[side, ::-1]
    with pytest.raises(InputError, match="look inwards"):
        Hull(name="turned", panels=turned)


def test_a_hull_whose_panels_all_look_inwards_is_turned_round() -> None:
    whole = box_hull(50.0, 10.0, 3.0, panels=100)
    assert np.array_equal(
        np.sort(Hull(name="in", panels=whole.panels[:, ::-1]).panels, axis=1),
        np.sort(whole.panels, axis=1),
    )
    assert Waterplane.of(Hull(name="in", panels=whole.panels[:, ::-1])).volume > 0.0


def test_the_metacentric_height_asked_comes_back_and_agrees_with_kg() -> None:
    hull = SHIP.hull(panels=300)
    plane = Waterplane.of(hull)
    by_gm = Loading.of(plane, gm=1.8)
    assert by_gm.metacentric_heights(plane)[0] == pytest.approx(1.8, rel=1e-12)
    by_kg = Loading.of(plane, kg=by_gm.centre[2] + hull.draught)
    assert by_kg.centre == pytest.approx(by_gm.centre, rel=1e-12)
    # GM is the slope of the righting arm: roll stiffness about the centre of gravity over weight.
    stiffness = moved(stiffness_matrix(plane, by_gm), (0.0, 0.0, 0.0), by_gm.centre)
    assert stiffness[3, 3] / (by_gm.mass * GRAVITY) == pytest.approx(1.8, rel=1e-9)


@pytest.mark.parametrize(
    ("given_figures", "words"),
    [
        ({}, "got neither"),
        ({"kg": 5.0, "gm": 1.0}, "got both"),
        ({"kg": 20.0}, "below the metacentre"),
        ({"gm": -0.5}, r"gm must be in \(0, 1000\] m"),
        ({"gm": 1.0, "density": 1.025}, r"density must be in \[900, 1100\] kg/m3"),
        ({"gm": 1.0, "radii": (0.001, None, None)}, "radius of gyration of roll"),
    ],
)
def test_a_loading_that_cannot_be_is_refused(given_figures: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match=words):
        Loading.of(Waterplane.of(SHIP.hull(panels=100)), **given_figures)


point = st.tuples(*[st.floats(-40.0, 40.0)] * 3)


@given(first=point, second=point)
@settings(max_examples=50, deadline=None)
def test_the_mass_about_another_point_is_that_made_there(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> None:
    loading = Loading.of(Waterplane.of(box_hull(60.0, 14.0, 4.0, panels=60)), gm=1.5)
    here, there = mass_matrix(loading, first), mass_matrix(loading, second)
    scale = np.abs(there).max()
    assert np.allclose(moved(here, first, second), there, rtol=0.0, atol=1e-11 * scale)
    assert centre_of_mass(mass_matrix(loading, first), first) == pytest.approx(
        loading.centre, abs=1e-9
    )


def test_moving_matrices_uses_the_transfer_that_moves_the_motions() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(size=(2, 1, 6)) + 1j * rng.normal(size=(2, 1, 6))
    raos = VesselRaos(name="x", omega=[0.5, 1.0], heading=[0.0], values=values)
    place = (12.0, -7.0, 20.0)
    assert np.allclose(transport(place) @ raos.at(place).values[0, 0], values[0, 0])


def test_a_block_coefficient_out_of_reach_is_told_with_what_is_in_reach() -> None:
    with pytest.raises(InputError, match=r"block must be in \(0\.\d+, 0\.\d+\) with this midship"):
        ShipLines(length=80.0, beam=18.0, draught=6.0, block=0.97).hull()


@pytest.mark.parametrize("binary", [True, False])
def test_a_closed_stl_is_cut_at_the_waterline(tmp_path: Path, binary: bool) -> None:
    path = tmp_path / "barge.STL"
    path.write_bytes(stl(closed_box(60.0, 14.0, -4.0, 3.0) * 1000.0, binary=binary))
    found = Waterplane.of(read_hull(path, scale=0.001))
    exact = Waterplane.of(box_hull(60.0, 14.0, 4.0))
    assert found.volume == pytest.approx(exact.volume, rel=1e-6)
    assert found.metacentric_radii == pytest.approx(exact.metacentric_radii, rel=1e-6)
    deeper = read_hull(path, scale=0.001, draught=5.0)
    assert Waterplane.of(deeper).volume == pytest.approx(60.0 * 14.0 * 5.0, rel=1e-6)


@pytest.mark.parametrize("symmetric", [True, False])
def test_a_gdf_reads_as_the_hull_that_was_written(tmp_path: Path, symmetric: bool) -> None:
    pytest.importorskip("capytaine")
    hull = SHIP.hull(panels=200)
    path = tmp_path / "ship.gdf"
    path.write_bytes(gdf(hull.panels, symmetric=symmetric))
    found = read_hull(path)
    assert found.count == hull.count
    assert found.symmetric
    assert Waterplane.of(found).volume == pytest.approx(Waterplane.of(hull).volume, rel=1e-6)


def test_the_lid_of_a_mesh_file_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "barge.stl"
    path.write_bytes(stl(closed_box(60.0, 14.0, -4.0, 0.0)))
    assert Waterplane.of(read_hull(path)).volume == pytest.approx(60.0 * 14.0 * 4.0, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("hull.obj", b"v 0 0 0", "must be one of .stl"),
        ("hull.stl", b"", "no STL file"),
        ("hull.stl", b"this is a letter", "no STL file"),
        ("hull.stl", stl(box_hull(9.0, 3.0, 1.0).panels)[:-20], "cut off"),
        ("hull.stl", stl(box_hull(9.0, 3.0, 1.0).panels, binary=False)[:-300], "cut off"),
        (
            "hull.stl",
            stl(np.add(box_hull(9.0, 3.0, 1.0).panels, (0.0, 0.0, 9.0))),
            "above the waterline",
        ),
        ("hull.stl", b"solid x\nfacet\nvertex 1 2 nan\nendsolid", "three to a facet"),
    ],
)
def test_a_mesh_that_is_none_is_refused(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_hull(path)


@pytest.mark.parametrize("kind", ["stl", "gdf", "hst", "mar", "pnl"])
def test_damaged_meshes_end_in_one_message(tmp_path: Path, kind: str) -> None:
    pytest.importorskip("capytaine")
    rng = np.random.default_rng(11)
    hull = box_hull(60.0, 14.0, 4.0, panels=60)
    good = stl(hull.panels, binary=False) if kind == "stl" else gdf(hull.panels, symmetric=False)
    path = tmp_path / f"hull.{kind}"
    for turn in range(40):
        data = bytearray(good)
        if turn % 4 == 0:
            data = data[: int(rng.integers(1, len(data)))]
        elif turn % 4 == 1:
            for at in rng.integers(0, len(data), 30):
                data[at] = int(rng.integers(0, 256))
        elif turn % 4 == 2:
            lines = bytes(data).split(b"\n")
            rng.shuffle(lines)
            data = bytearray(b"\n".join(lines))
        else:
            data = bytearray(rng.bytes(400))
        path.write_bytes(bytes(data))
        with contextlib.suppress(InputError):
            assert math.isfinite(Waterplane.of(read_hull(path)).volume)
