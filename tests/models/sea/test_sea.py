"""Sea spectra against closed forms, the 1975 thesis's tables and the formulas in the literature."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import waveresponse
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import gamma as gamma_function
from scipy.special import gammaincc

from models import Case, load_case
from models.basics import InputError, spectral_nodes
from models.hook import HookMotion
from models.sea import SeaSpectrum
from models.sea.sea import SPECTRA
from models.vessel import HeaveRao

# 1975 thesis, Table 3: the design sea has H_S = 8.0 ft; App. B: T_S = 8.1 s.
DESIGN_SEA = SeaSpectrum(
    kind="bretschneider-1975", significant_height=2.4384, significant_period=8.1
)
MEAN_PERIOD = 0.9 * 8.1

# 1975 thesis, Table B-2: nu = f T and S(nu) = 3.434 nu^-5 exp(-0.675 nu^-4).
TABLE_B2 = np.array(
    [
        (0.50, 0.0022),
        (0.55, 0.0465),
        (0.60, 0.243),
        (0.65, 0.710),
        (0.70, 1.24),
        (0.75, 1.77),
        (0.80, 2.02),
        (0.85, 2.13),
        (0.90, 2.07),
        (1.00, 1.75),
        (1.10, 1.34),
        (1.20, 1.00),
        (1.30, 0.735),
        (1.40, 0.534),
        (1.50, 0.393),
        (1.60, 0.296),
        (1.70, 0.224),
        (1.80, 0.171),
        (1.90, 0.132),
        (2.00, 0.103),
        (2.50, 0.0346),
        (3.00, 0.0140),
    ]
)
# Three rows of Table B-2 were miscalculated: they differ from its own formula by 9, 5 and 3 %.
MISCALCULATED = {0.55: 0.09, 0.65: 0.053, 0.75: 0.033}

# 1975 thesis, Table 5: omega [rad/s] and wave height spectrum S [m^2 s].
TABLE_5 = np.array(
    [
        (0.34, 0.0),
        (0.43, 0.006),
        (0.47, 0.125),
        (0.52, 0.655),
        (0.56, 1.91),
        (0.60, 3.34),
        (0.65, 4.77),
        (0.69, 5.44),
        (0.73, 5.74),
        (0.78, 5.58),
        (0.86, 4.71),
        (0.94, 3.61),
        (1.03, 2.69),
        (1.12, 1.98),
        (1.21, 1.44),
        (1.29, 1.06),
        (1.38, 0.80),
        (1.46, 0.60),
    ]
)
# The frequencies that Table 5 is made of: those of Table B-2 from 0.4 to 1.7.
TABLE_5_NU = np.array([0.4, *TABLE_B2[:17, 0]])


def height_density(omega):
    """S of the thesis, for wave height: eight times the variance density of the elevation."""
    return 8.0 * DESIGN_SEA.density(omega)


def test_table_b2():
    nu, printed = TABLE_B2.T
    # S(omega) = S(nu) H^2 T / 2 pi
    ours = height_density(2.0 * math.pi * nu / MEAN_PERIOD) * 2.0 * math.pi
    ours /= (0.625 * 2.4384) ** 2 * MEAN_PERIOD
    # Half a unit of the last printed digit, and what a slide rule adds.
    digits = np.array([4, 4, *[3] * 2, *[2] * 8, *[3] * 8, 4, 4])
    allowed = 0.5 * 10.0**-digits + 0.007 * ours
    allowed += ours * np.array([MISCALCULATED.get(x, 0.0) for x in nu])
    assert np.all(np.abs(ours - printed) <= allowed)


def test_table_5_spectrum_is_eight_times_the_variance_density():
    omega, printed = TABLE_5.T
    exact = 2.0 * math.pi * TABLE_5_NU / MEAN_PERIOD
    # The table's frequencies are those of Table B-2, rounded or cut to two digits ...
    assert np.all(np.abs(omega - exact) < 0.01)
    # ... and its spectrum is that table's, in metres: 16.93 m^2 s / 2 pi.
    ours = height_density(exact)
    allowed = 0.005 + 0.012 * ours
    allowed += ours * np.array([MISCALCULATED.get(x, 0.0) for x in TABLE_5_NU])
    assert np.all(np.abs(ours - printed) <= allowed)


def test_the_thesis_numbers_of_the_design_sea():
    # H^2 T = 16.93 m^2 s with H = 1.524 m (5 ft) and T = 7.29 s.
    squared_height_times_period = (0.625 * 2.4384) ** 2 * MEAN_PERIOD
    assert squared_height_times_period == pytest.approx(16.93, abs=0.005)
    # Exact integral: H_rms^2 = 3.434/(4 x 0.675) H^2, an eighth of it is the variance.
    variance = 3.434 / (4.0 * 0.675) * (0.625 * 2.4384) ** 2 / 8.0
    s = DESIGN_SEA.statistics
    assert s.m0 == pytest.approx(variance, rel=1e-6)
    assert s.significant_height == pytest.approx(2.4384, rel=4e-3)
    # App. B's peak: (f T)^4 = 4/5 x 0.675.
    grid = np.linspace(0.5, 1.0, 200001)
    top = grid[np.argmax(DESIGN_SEA.density(grid))]
    assert DESIGN_SEA.peak_frequency == pytest.approx(top, abs=3e-6)
    assert 2.0 * math.pi / DESIGN_SEA.peak_frequency == pytest.approx(8.504, abs=1e-3)


def test_the_thesis_shape_is_bretschneiders_in_other_words():
    modern = SeaSpectrum(
        kind="bretschneider",
        significant_height=DESIGN_SEA.statistics.significant_height,
        peak_period=2.0 * math.pi / DESIGN_SEA.peak_frequency,
    )
    omega = np.geomspace(0.2, 30.0, 400)
    np.testing.assert_allclose(DESIGN_SEA(omega), modern(omega), rtol=1e-6, atol=1e-30)


@given(height=st.floats(0.1, 15.0), period=st.floats(3.0, 20.0))
def test_moments_of_bretschneider(height, period):
    sea = SeaSpectrum(kind="bretschneider", significant_height=height, peak_period=period)
    omega_p = 2.0 * math.pi / period
    a, b = 5.0 / 16.0 * height**2 * omega_p**4, 1.25 * omega_p**4
    _, high = sea.band
    s = sea.statistics
    # With x = B/omega^4 the n-th moment over (0, high) is (A/4) B^(n/4 - 1) Gamma(1 - n/4, x_high).
    for n, found in ((0, s.m0), (1, s.m1), (2, s.m2)):
        order = 1.0 - n / 4.0
        tail = gammaincc(order, b / high**4) * gamma_function(order)
        assert found == pytest.approx(a / 4.0 * b ** (n / 4.0 - 1.0) * tail, rel=1e-8)
    assert s.significant_height == pytest.approx(height, rel=1e-6)
    assert s.zero_crossing_period == pytest.approx(0.7104 * period, rel=3e-3)
    assert s.mean_period == pytest.approx(0.7718 * period, rel=1e-3)


def test_m4_belongs_to_its_band():
    sea = SeaSpectrum(kind="bretschneider", significant_height=2.0, peak_period=8.0)
    a = 5.0 / 16.0 * 4.0 * sea.peak_frequency**4

    def fourth(high):
        q = spectral_nodes(sea.band[0], high)
        return float(q.integrate(q.omega**4 * sea(q.omega)))

    # A/omega of tail: every decade of band adds A ln 10, for ever.
    assert fourth(600.0) - fourth(60.0) == pytest.approx(a * math.log(10.0), rel=1e-5)
    assert sea.band[1] == 60.0
    assert sea.statistics.m4 == pytest.approx(fourth(60.0), rel=1e-8)


@pytest.mark.parametrize("gamma", [1.0, 2.0, 3.3, 5.0])
def test_jonswap_as_dnv_writes_it(gamma):
    height, period = 4.0, 10.0
    sea = SeaSpectrum(kind="jonswap", significant_height=height, peak_period=period, gamma=gamma)
    omega_p = 2.0 * math.pi / period
    # Unsorted and unevenly spaced: the library's formula is pointwise.
    omega = np.random.default_rng(3).uniform(0.3, 6.0, (5, 40))
    pm = 5.0 / 16.0 * height**2 * omega_p**4 * omega**-5 * np.exp(-1.25 * (omega_p / omega) ** 4)
    sigma = np.where(omega <= omega_p, 0.07, 0.09)
    hump = np.exp(-0.5 * ((omega - omega_p) / (sigma * omega_p)) ** 2)
    expected = (1.0 - 0.287 * math.log(gamma)) * pm * gamma**hump
    np.testing.assert_allclose(sea.density(omega), expected, rtol=1e-12)
    assert sea.statistics.significant_height == pytest.approx(height, rel=2e-3)


@pytest.mark.parametrize("order", [1.0, 2.0, 4.5])
def test_ochi_hubble(order):
    sea = SeaSpectrum(kind="ochi-hubble", significant_height=3.0, peak_period=9.0, order=order)
    assert sea.statistics.significant_height == pytest.approx(3.0, rel=1e-6)
    omega_p, omega = 2.0 * math.pi / 9.0, np.geomspace(0.3, 10.0, 50)
    d = (4.0 * order + 1.0) / 4.0 * omega_p**4
    expected = (
        9.0 / 4.0 * d**order / gamma_function(order) * omega ** (-4.0 * order - 1.0)
    ) * np.exp(-d / omega**4)
    np.testing.assert_allclose(sea(omega), expected, rtol=1e-10)


@pytest.mark.parametrize(("height", "period"), [(4.0, 7.0), (4.0, 10.0), (4.0, 14.0), (1.0, 8.0)])
def test_torsethaugen_is_the_librarys_with_its_height_put_right(height, period):
    sea = SeaSpectrum(kind="torsethaugen", significant_height=height, peak_period=period)
    assert sea.statistics.significant_height == pytest.approx(height, rel=1e-8)
    omega = np.geomspace(0.3, 6.0, 200)
    _, theirs = waveresponse.Torsethaugen(omega, freq_hz=False)(height, period, freq_hz=False)
    ratio = theirs / sea(omega)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert abs(ratio[0] - 1.0) < 0.03
    low, _ = sea.band
    # Nothing of either system lies below the band.
    assert sea.density(low) < 1e-20 * sea.density(sea.peak_frequency)


def any_sea(kind: str, height: float = 3.0, period: float = 9.0) -> SeaSpectrum:
    if kind == "measured":
        omega = 2.0 * math.pi / period * np.array([0.5, 0.8, 1.0, 1.1, 1.5, 2.0, 3.0])
        table = SeaSpectrum.from_table(omega, [0.0, 1.0, 4.0, 3.0, 1.5, 0.7, 0.1])
        return table.scaled(height)
    if kind == "sum":
        wind = SeaSpectrum(kind="jonswap", significant_height=0.8 * height, peak_period=period)
        swell = any_sea("gaussian-swell", 0.6 * height, 1.8 * period)
        return SeaSpectrum(kind="sum", parts=(wind, swell))
    if kind == "pierson-moskowitz":
        return SeaSpectrum(kind=kind, significant_height=height)
    values = {"peak_period": period}
    if kind == "bretschneider-1975":
        values = {"significant_period": period}
    elif kind == "tma":
        values["depth"] = 30.0
    elif kind == "gaussian-swell":
        values["width"] = 0.08 * 2.0 * math.pi / period
    return SeaSpectrum(kind=kind, significant_height=height, **values)


@pytest.mark.parametrize("kind", SPECTRA)
def test_what_holds_for_every_spectrum(kind):
    sea = any_sea(kind)
    # Zero at and below zero frequency, and no overflow just above it.
    tiny = np.array([-1.0, 0.0, 1e-300, 1e-12, 1e-3])
    np.testing.assert_allclose(sea.density(tiny), np.zeros(5), atol=1e-20)
    omega = np.geomspace(0.05, 100.0, 60).reshape(3, 20)
    values = sea.density(omega)
    assert values.shape == (3, 20)
    assert np.all(values >= 0.0)
    np.testing.assert_array_equal(values.ravel(), sea(omega.ravel()))
    assert sea.density(0.8).shape == ()
    # The peak is where it says, and a quadrature begins a panel there.  Torsethaugen's second
    # system shifts it by a hair, the water's depth a TMA's by more.
    grid = np.linspace(0.2, 3.0, 28001)
    top = grid[np.argmax(sea(grid))]
    assert top == pytest.approx(sea.peak_frequency, abs=0.02 if kind == "tma" else 4e-4)
    assert min(abs(w - sea.peak_frequency) for w in sea.splits) < 1e-3
    assert all(a < b for a, b in zip(sea.splits, sea.splits[1:], strict=False))
    # A crude rule on a fine uniform grid gives the same moments.
    fine = np.linspace(*sea.band, 800_001)
    for n, found in ((0, sea.statistics.m0), (1, sea.statistics.m1), (2, sea.statistics.m2)):
        crude = np.trapezoid(fine**n * sea(fine), fine)
        assert found == pytest.approx(crude, rel=1e-6)


@pytest.mark.parametrize("kind", SPECTRA)
def test_moments_are_accurate_to_a_billionth(kind):
    sea = any_sea(kind)
    low, high = sea.band
    # Gauss-Legendre on fixed panels that are cut at the splits: no adaptivity.
    edges = np.unique(np.r_[np.geomspace(low, high, 400), [w for w in sea.splits if w > low]])
    x, w = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)[:, None]
    omega = (edges[:-1, None] + half * (1.0 + x)).ravel()
    weights = (half * w).ravel()
    for n, found in ((0, sea.statistics.m0), (1, sea.statistics.m1), (2, sea.statistics.m2)):
        exact = float(weights @ (omega**n * sea(omega)))
        assert found == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("kind", SPECTRA)
@pytest.mark.parametrize(("height", "period"), [(1.0, 6.0), (3.0, 9.0), (6.0, 14.0)])
def test_significant_height_is_what_was_asked_for_within_a_percent(kind, height, period):
    sea = any_sea(kind, height, period)
    assert sea.significant_height == pytest.approx(height, rel=1e-12)
    assert sea.statistics.significant_height == pytest.approx(height, rel=0.01)


@given(
    height=st.floats(0.5, 12.0),
    steepness=st.floats(0.008, 0.05),
    kind=st.sampled_from(["jonswap", "tma", "torsethaugen"]),
    gamma=st.floats(1.0, 7.0),
    depth=st.floats(8.0, 300.0),
)
def test_no_steepness_gamma_or_depth_spoils_the_height(height, steepness, kind, gamma, depth):
    period = math.sqrt(2.0 * math.pi * height / (9.81 * steepness))
    values = {"depth": depth} if kind == "tma" else {}
    try:
        sea = SeaSpectrum(
            kind=kind, significant_height=height, peak_period=period, gamma=gamma, **values
        )
    except InputError as error:
        assert "not defined for so low a steepness" in str(error)  # noqa: PT017
        return
    assert sea.statistics.significant_height == pytest.approx(height, rel=0.01)


@pytest.mark.parametrize("kind", SPECTRA)
def test_a_record_has_the_variance_of_the_spectrum(kind):
    sea = any_sea(kind)
    # A hook that moves with the water.
    still = HeaveRao(omega=[0.01, 59.0], amplitude=[1.0, 1.0], below="hold", beyond="hold")
    motion = HookMotion(sea=sea, rao=still)
    duration, count = 1800.0, 24
    found = [
        float(np.mean(motion.record(duration, step=0.2, seed=seed).displacement ** 2))
        for seed in range(count)
    ]
    # Var of the mean square of a Gaussian record: (2 pi / T) integral of S^2 (Bendat and Piersol).
    q = sea.quadrature()
    error = math.sqrt(2.0 * math.pi / duration * float(q.integrate(sea(q.omega) ** 2)) / count)
    m0 = sea.statistics.m0
    assert abs(np.mean(found) - m0) < 3.0 * error
    assert error < 0.03 * m0


@pytest.mark.parametrize("kind", SPECTRA)
def test_scaled_keeps_the_shape(kind):
    sea = any_sea(kind)
    omega = np.geomspace(0.3, 10.0, 30)
    np.testing.assert_allclose(sea.scaled(6.0)(omega), 4.0 * sea(omega), rtol=1e-12)
    assert sea.scaled(6.0).peak_frequency == sea.peak_frequency
    assert sea.scaled(6.0).scaled(3.0)(omega) == pytest.approx(sea(omega), rel=1e-12)
    assert sea.scaled(6.0).band == sea.band


def test_another_height_is_another_shape_of_those_whose_shape_follows_from_it():
    for kind in ("torsethaugen", "pierson-moskowitz"):
        new, scaled = any_sea(kind, 6.0), any_sea(kind).scaled(6.0)
        assert new.statistics.mean_period != pytest.approx(scaled.statistics.mean_period, rel=0.01)


def test_torsethaugen_needs_some_steepness():
    with pytest.raises(InputError, match=r"significant_height 0\.3 m with peak_period 6 s"):
        any_sea("torsethaugen", 0.3, 6.0)


def test_pierson_moskowitz_as_they_wrote_it():
    sea = any_sea("pierson-moskowitz", 4.0)
    omega = np.geomspace(0.3, 6.0, 80)
    peak = sea.peak_frequency
    theirs = 0.0081 * 9.80665**2 * omega**-5 * np.exp(-1.25 * (peak / omega) ** 4)
    np.testing.assert_allclose(sea(omega), theirs, rtol=1e-12)
    # DNV-RP-C205 has T_p / sqrt(H_s) = 5 of a fully developed sea, where gamma becomes 1.
    assert 2.0 * math.pi / peak / math.sqrt(4.0) == pytest.approx(5.0, abs=0.01)


def test_tma_and_gaussian_swell_as_wavespectra_has_them():
    construct = pytest.importorskip("wavespectra.construct.frequency")
    f = np.linspace(0.03, 1.5, 30_000)
    tma = SeaSpectrum(kind="tma", significant_height=3.0, peak_period=9.0, gamma=2.0, depth=25.0)
    theirs = construct.tma(f, 1.0 / 9.0, 25.0, gamma=2.0, hs=3.0).values
    # Its wave number is an approximation, good to 1 %, and it normalises on its grid.
    ours = 2.0 * math.pi * tma(2.0 * math.pi * f)
    np.testing.assert_allclose(ours, theirs, atol=4e-3 * ours.max())
    swell = any_sea("gaussian-swell", 2.0, 14.0)
    theirs = construct.gaussian(f, 2.0, 1.0 / 14.0, 0.08 / 14.0).values
    np.testing.assert_allclose(
        2.0 * math.pi * swell(2.0 * math.pi * f), theirs, rtol=1e-9, atol=1e-12
    )


def test_a_tma_in_deep_water_is_a_jonswap():
    deep = SeaSpectrum(kind="tma", significant_height=3.0, peak_period=9.0, depth=3000.0)
    omega = np.geomspace(0.3, 20.0, 100)
    ratio = deep(omega) / any_sea("jonswap")(omega)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)


def test_a_sum_adds_up():
    wind, swell = any_sea("jonswap", 2.0, 7.0), any_sea("gaussian-swell", 1.5, 15.0)
    both = SeaSpectrum(kind="sum", parts=(wind, swell))
    omega = np.geomspace(0.1, 10.0, 300)
    np.testing.assert_allclose(both(omega), wind(omega) + swell(omega), rtol=1e-12)
    assert both.significant_height == pytest.approx(2.5)
    assert both.statistics.m0 == pytest.approx(wind.statistics.m0 + swell.statistics.m0, rel=1e-9)
    assert both.peak_frequency == pytest.approx(2.0 * math.pi / 15.0, rel=1e-6)


@given(
    gap=st.lists(st.floats(0.02, 1.0), min_size=3, max_size=30),
    seed=st.integers(0, 2**31),
    beyond=st.sampled_from(["decay", "zero"]),
)
def test_a_measured_sea_has_the_energy_of_its_table(gap, seed, beyond):
    omega = np.cumsum(gap)
    density = np.random.default_rng(seed).uniform(0.0, 5.0, omega.size)
    sea = SeaSpectrum.from_table(omega, density, beyond=beyond)
    inside = np.trapezoid(density, omega)
    last = omega[-1]
    tail = density[-1] * last**5 / 4.0 * (last**-4 - 60.0**-4) if beyond == "decay" else 0.0
    assert sea.statistics.m0 == pytest.approx(inside + tail, rel=1e-9)
    assert sea.significant_height == pytest.approx(4.0 * math.sqrt(inside + tail), rel=1e-12)
    np.testing.assert_allclose(sea(omega), density, rtol=1e-12)
    middle = 0.5 * (omega[1:] + omega[:-1])
    np.testing.assert_allclose(sea(middle), 0.5 * (density[1:] + density[:-1]), rtol=1e-12)
    assert sea(0.5 * omega[0]) == 0.0
    assert sea.band[0] == omega[0]
    assert sea(59.0 if beyond == "zero" else 61.0) == 0.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "pierson"}, "spectrum must be one of bretschneider-1975, .*; got 'pierson'"),
        ({"significant_height": 0.0}, "significant_height must be above 0 m, got 0.0"),
        ({"significant_height": math.nan}, "significant_height must be above 0 m, got nan"),
        ({"peak_period": 6e-9}, "peak_period must be at least 0.5 s, got 6e-09"),
        ({"peak_period": None}, r"jonswap needs peak_period \[s\]"),
        ({"significant_period": 8.0}, r"takes peak_period \[s\], not significant_period"),
        ({"gamma": 0.5}, r"gamma must be in \[1, 7\], got 0.5"),
        ({"kind": "tma"}, r"tma needs depth \[m\]"),
        ({"kind": "tma", "depth": -3.0}, "depth must be at least 1 m, got -3.0"),
        ({"depth": 20.0}, r"jonswap takes peak_period \[s\], not depth"),
        ({"kind": "gaussian-swell", "width": 0.3}, r"width must be in \[0.00392.*, 0.1309.*rad/s"),
        ({"kind": "pierson-moskowitz"}, "takes no period, not peak_period"),
        ({"kind": "measured", "peak_period": None}, "measured needs table"),
        ({"kind": "sum", "peak_period": None, "parts": ()}, "parts must be one or more seas"),
        (
            {"kind": "bretschneider-1975"},
            r"bretschneider-1975 takes significant_period \[s\], not peak_period",
        ),
    ],
)
def test_bad_values(values, message):
    good = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 8.0}
    with pytest.raises(InputError, match=message):
        SeaSpectrum(**{**good, **values})


def test_from_case():
    case = load_case("thesis-1975")
    assert case.sea.to_spectrum() == DESIGN_SEA
    jonswap = case.replace({"sea.spectrum": "jonswap", "sea.peak_period": 9.0, "sea.gamma": 2.0})
    assert jonswap.sea.to_spectrum() == SeaSpectrum(
        kind="jonswap", significant_height=2.4384, peak_period=9.0, gamma=2.0
    )


def test_the_thesis_sea_does_without_the_library():
    # waveresponse takes 0.7 s to import; a case that does not need it must not pay for it.
    code = (
        "import sys; from models.sea.sea import SeaSpectrum as S;"
        "S(kind='bretschneider-1975', significant_height=2.0, significant_period=8.0).statistics;"
        "sys.exit('waveresponse' in sys.modules)"
    )
    root = Path(__file__).parents[3]
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0


@pytest.mark.parametrize("kind", ["bretschneider-1975", "bretschneider"])
def test_a_sea_by_its_wind_keeps_its_height_at_another_period(kind):
    tree = load_case("thesis-1975").to_dict()
    case = Case.from_dict({**tree, "sea": {"spectrum": kind, "wind_speed": "20 knots"}})
    other = case.replace(case.sea.peaking_at(9.5)).sea
    assert other.spectral_peak_period == pytest.approx(9.5, rel=1e-12)
    assert other.significant_height == case.sea.significant_height
    assert other.wind_speed is None
