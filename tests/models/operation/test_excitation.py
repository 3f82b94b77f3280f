"""Motions of the hook: consistent derivatives, the same in any blocks, from every source."""

from __future__ import annotations

import itertools
import math
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation
from still_motion import StillMotion

from models import InputError, PhysicsWarning
from models.operation import RecordMotion, SineMotion, SpectrumMotion
from models.operation.contact_scenarios import boat_motion, surface_motion
from models.operation.excitation import (
    SECOND_BODY,
    SURFACE,
    LongRecord,
    seed_for,
)
from models.operation.hermite import interpolated
from models.operation.six_dof import tip_heave

NAMES = ("displacement", "velocity", "acceleration")


@pytest.fixture(scope="module")
def thesis():
    return SpectrumMotion.from_case(load_case("thesis-1975"))


@pytest.fixture(scope="module")
def crane_case():
    return load_case("subsea-crane")


@pytest.fixture(scope="module")
def crane(crane_case):
    return SpectrumMotion.from_case(crane_case)


def whole(motion):
    return motion.block(0, motion.rows)


def assert_integrates(rate, value, step, allowed):
    # Simpson's rule over pairs of steps, between which alone the third derivative jumps.
    grown = (rate[..., :-2:2] + 4.0 * rate[..., 1:-1:2] + rate[..., 2::2]) * step / 3.0
    np.testing.assert_allclose(np.diff(value[..., ::2]), grown, atol=allowed)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


class TestHermite:
    @given(
        values=st.lists(st.tuples(*[st.floats(-10.0, 10.0)] * 3), min_size=2, max_size=12),
        node_step=st.sampled_from([0.05, 0.1, 0.7]),
        ratio=st.sampled_from([0.4, 1.0, 2.0, 2.5, 7.0, 10.0, math.pi]),
    )
    def test_it_is_the_quintic_of_scipy(self, values, node_step, ratio):
        table = np.array(values)
        last = len(table) - 1
        step = node_step / ratio
        rows = math.floor(last * ratio + 1e-9) + 1
        ours = interpolated(lambda i, n: table[i : i + n], last, node_step, step)(0, rows)
        clock = np.minimum(np.arange(rows) * step, last * node_step)
        spline = BPoly.from_derivatives(node_step * np.arange(last + 1), table)
        for order, part in enumerate(ours):
            exact = spline.derivative(order)(clock) if order else spline(clock)
            scale = 100.0 / node_step**order
            np.testing.assert_allclose(part, exact, atol=1e-11 * scale)

    def test_a_polynomial_of_fifth_degree_is_met_exactly(self):
        polynomial = np.polynomial.Polynomial([0.3, -1.0, 0.5, 0.2, -0.1, 0.03])
        nodes = 0.5 * np.arange(5)
        table = np.stack([polynomial.deriv(k)(nodes) if k else polynomial(nodes) for k in range(3)])
        z, v, a = interpolated(lambda i, n: table.T[i : i + n], 4, 0.5, 0.03)(0, 67)
        t = 0.03 * np.arange(67)
        np.testing.assert_allclose(z, polynomial(t), atol=1e-14)
        np.testing.assert_allclose(v, polynomial.deriv(1)(t), atol=1e-13)
        np.testing.assert_allclose(a, polynomial.deriv(2)(t), atol=1e-12)

    def test_the_error_in_a_harmonic_is_the_one_promised(self):
        omega, node_step = 3.0, 0.2
        t = node_step * np.arange(50)
        table = np.stack(
            [np.cos(omega * t), -omega * np.sin(omega * t), -(omega**2) * np.cos(omega * t)]
        )
        z, _, _ = interpolated(lambda i, n: table.T[i : i + n], 49, node_step, 0.002)(0, 4901)
        error = np.max(np.abs(z - np.cos(omega * 0.002 * np.arange(4901))))
        bound = (omega * node_step) ** 6 / 46080.0
        assert 0.9 * bound < error < bound


class TestSpectrum:
    @pytest.mark.parametrize("step", [0.01, 0.0075, 0.3])
    @pytest.mark.parametrize("name", ["thesis", "crane"])
    def test_it_is_the_record_of_the_same_seed(self, name, step, request):
        source = request.getfixturevalue(name)
        motion = source.motion(300.0, step, seed=7)
        every = round(step / 0.0025)
        record = source.hook.record(300.0, step=0.0025, seed=7)
        for part, found in zip(NAMES, whole(motion), strict=True):
            exact = getattr(record, part)[::every][: found.size]
            assert found.size == motion.rows == math.floor(300.0 / step + 1e-9) + 1
            # The displacement within 1e-7 m rms; derivatives of the tail lose a power each.
            allowed = {"displacement": 1e-7, "velocity": 1e-5, "acceleration": 2e-3}[part]
            assert rms(found - exact) < allowed

    def test_the_nodes_are_as_close_as_the_spectrum_wants(self, thesis, crane):
        # The thesis's RAO is held beyond its table, so its motion reaches higher.
        assert thesis.node_step < crane.node_step <= 0.1

    def test_velocity_is_the_derivative_at_any_step(self, crane):
        z, v, a = whole(crane.motion(60.0, 0.001, seed=3))
        for rate, value in ((v, z), (a, v)):
            assert_integrates(rate, value, 0.001, 1e-11)

    @given(cuts=st.sets(st.integers(1, 1600), max_size=6), step=st.sampled_from([0.025, 0.0301]))
    def test_blocks_make_no_difference(self, crane, cuts, step):
        motion = crane.motion(50.0, step, seed=5)
        together = whole(motion)
        at = [0, *sorted(c for c in cuts if c < motion.rows), motion.rows]
        pieces = [motion.block(i, j - i) for i, j in itertools.pairwise(at)]
        for k in range(3):
            np.testing.assert_array_equal(np.concatenate([p[k] for p in pieces]), together[k])

    def test_another_step_gives_the_same_motion(self, crane):
        coarse, fine = (whole(crane.motion(100.0, step, 2)) for step in (0.1, 0.0125))
        for a, b in zip(coarse, fine, strict=True):
            np.testing.assert_allclose(a, b[::8], atol=1e-12)

    def test_seeds_and_purposes_draw_different_waves(self, crane):
        hook = crane.hook
        motions = [
            whole(SpectrumMotion(hook=hook, purpose=purpose).motion(1200.0, 0.5, seed))[0]
            for seed, purpose in ((1, None), (2, None), (1, SECOND_BODY), (1, SURFACE))
        ]
        correlation = np.corrcoef(motions)
        # Two independent records of 1200 s and some 130 waves: 0.1 is about one deviation.
        assert np.max(np.abs(correlation - np.eye(4))) < 0.35
        again = whole(SpectrumMotion(hook=hook, purpose=SECOND_BODY).motion(1200.0, 0.5, 1))[0]
        np.testing.assert_array_equal(again, motions[2])

    def test_rows_that_are_not_there(self, crane):
        motion = crane.motion(10.0, 0.1, 1)
        assert motion.rows == 101
        for start, count in ((0, 102), (-1, 2), (101, 1)):
            with pytest.raises(InputError, match=r"motion \(jonswap .*\): has rows 0 to 100, "):
                motion.block(start, count)
        assert motion.block(100, 1)[0].shape == (1,)


class TestLongRecord:
    def test_three_hours_are_one_record(self, crane):
        step = crane.node_step
        motion = crane.motion(10800.0, step, seed=4)
        record = crane.hook.record(10800.0, step=step, seed=4)
        np.testing.assert_array_equal(motion.block(0, 1000)[0], record.displacement[:1000])

    def test_a_day_begins_as_an_hour_and_goes_on(self, crane):
        day = crane.motion(86400.0, 0.5, seed=4)
        short = crane.motion(3600.0, 0.5, seed=4)
        for a, b in zip(day.block(0, 6001), short.block(0, 6001), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)
        z, v, a = whole(day)
        assert z.size == 172801
        # Variances: 2 pi/T times the integral of S^2 is that of the sample variance (Parseval).
        q = crane.hook.quadrature
        for values, power in ((z, 0), (v, 2), (a, 4)):
            density = q.omega**power * crane.hook(q.omega)
            error = math.sqrt(2.0 * math.pi / 86400.0 * q.integrate(density**2))
            assert np.mean(values**2) == pytest.approx(float(q.integrate(density)), abs=4.0 * error)
        # It does not come back: nothing but scatter is left of its correlation after 5 minutes.
        size = 1 << (2 * z.size).bit_length()
        lags = np.fft.irfft(np.abs(np.fft.rfft(z - z.mean(), size)) ** 2, size)[: z.size]
        assert np.max(np.abs(lags[600:])) < 0.1 * lags[0]

    def test_reading_back_and_forth_gives_the_same(self, crane):
        motion = crane.motion(40000.0, 0.5, seed=4)
        late, early = motion.block(61000, 4000), motion.block(0, 100)
        fresh = crane.motion(40000.0, 0.5, seed=4)
        for one, two in ((early, fresh.block(0, 100)), (late, fresh.block(61000, 4000))):
            np.testing.assert_array_equal(one, two)

    def test_fading_keeps_the_variance_and_the_derivatives(self):
        # Records that are constant, and 1 in one piece only, show the weight of that piece.
        weights = []
        for shown in range(3):
            seeds = [9, seed_for(9, 6, 1), seed_for(9, 6, 2)]

            def record(duration, *, step, seed, seeds=seeds, shown=shown):
                n = round(duration / step) + 1
                value = float(seeds.index(seed) == shown) if seed in seeds else 0.0
                zero = np.zeros(n)
                return SimpleNamespace(
                    displacement=np.full(n, value), velocity=zero, acceleration=zero
                )

            nodes = LongRecord(SimpleNamespace(record=record), 12000.0, 0.1, 9)
            weights.append(nodes(0, 90001))
        z, v, a = np.stack(weights).transpose(2, 0, 1)
        np.testing.assert_allclose(np.sum(z**2, axis=0), 1.0, atol=1e-14)
        assert v.any()
        for rate, value in ((v, z), (a, v)):
            assert_integrates(rate, value, 0.1, 1e-12)
        # What the weights' own slope adds to the velocity's variance is nothing against waves.
        assert np.max(np.sum(v**2, axis=0)) < 1e-4 * (2.0 * math.pi / 9.0) ** 2

    def test_a_day_does_not_need_the_memory_of_a_day(self, crane):
        motion = crane.motion(86400.0, 0.01, seed=4)
        tracemalloc.start()
        try:
            for start in range(0, motion.rows, 1_000_000):
                motion.block(start, 10_000)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        # One array of a day at 10 ms has 69 MB, and there are three.
        assert peak < 30e6


class TestSineAndStill:
    def test_a_sine_is_exact_however_late(self):
        motion = SineMotion(amplitude=0.8, period=9.0, phase=0.3).motion(90000.0, 0.01, seed=1)
        start = 8_999_000
        z, v, a = motion.block(start, 1000)
        t = motion.time(start, 1000) - 89100.0  # 9900 whole periods earlier
        omega = 2.0 * math.pi / 9.0
        np.testing.assert_allclose(z, 0.8 * np.sin(omega * t + 0.3), atol=2e-11)
        np.testing.assert_allclose(v, 0.8 * omega * np.cos(omega * t + 0.3), atol=2e-11)
        np.testing.assert_allclose(a, -(omega**2) * z, atol=1e-15)

    def test_still(self):
        motion = StillMotion().motion(1.0, 0.1, seed=1)
        assert not np.any(whole(motion))
        assert motion.rows == 11

    @pytest.mark.parametrize(
        ("keywords", "message"),
        [
            (
                {"amplitude": -1.0, "period": 9.0},
                r"sine motion: amplitude must be in \[0, 100\] m, ",
            ),
            ({"amplitude": 1.0, "period": 6e-9}, r"period must be in \[0.5, 1000\] s, got 6e-09"),
        ],
    )
    def test_bad_sines(self, keywords, message):
        with pytest.raises(InputError, match=message):
            SineMotion(**keywords)

    def test_easing_starts_at_rest_and_keeps_the_derivatives(self):
        plain = SineMotion(amplitude=1.0, period=7.0, phase=1.0).motion(60.0, 0.002, seed=1)
        z, v, a = whole(plain.eased(20.0))
        assert z[0] == v[0] == a[0] == 0.0
        for rate, value in ((v, z), (a, v)):
            assert_integrates(rate, value, 0.002, 1e-12)
        for eased, whole_one in zip((z, v, a), whole(plain), strict=True):
            np.testing.assert_array_equal(eased[10000:], whole_one[10000:])
        # Half of it after half of the time.
        assert z[5000] == pytest.approx(0.5 * whole(plain)[0][5000], rel=1e-12)
        assert plain.eased(0.0) is plain


class TestOtherBodies:
    def test_a_boat_follows_long_waves_only(self):
        case = load_case("subsea-crane")
        rao = boat_motion(case).hook.rao
        assert abs(rao.response(0.3)) == pytest.approx(1.0, abs=2e-4)
        assert abs(rao.response(0.9)) == pytest.approx(math.sqrt(0.5), rel=1e-3)
        assert abs(rao.response(2.0)) < 0.05
        sea = boat_motion(case).hook.sea.statistics.rms
        assert 0.7 * sea < boat_motion(case).hook.displacement.rms < sea

    @pytest.mark.filterwarnings("ignore:.*phase is missing")
    def test_the_surface_is_that_of_the_waves_that_move_the_hook(self):
        table = {
            "omega": [0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6],
            "amplitude": [1.0, 1.0, 1.05, 0.98, 0.62, 0.28, 0.12, 0.05],
        }
        case = load_case("subsea-crane").replace({"vessel.heave_rao": table})
        surface, hook = surface_motion(case, side=4.0), SpectrumMotion.from_case(case)
        z, _, _ = whole(surface.motion(600.0, 0.1, seed=6))
        heave, _, _ = whole(hook.motion(600.0, 0.1, seed=6))
        # The case's RAO has no phase and is near one where the waves are long: crest with crest.
        assert np.corrcoef(z, heave)[0, 1] > 0.93
        # A payload of 4 m averages hardly anything away.
        waves = surface.hook.displacement.rms
        assert 0.97 * 0.5 < waves < 0.25 * case.sea.significant_height

    @given(side=st.floats(0.5, 30.0), share=st.floats(0.02, 0.98))
    def test_the_surface_is_averaged_over_the_payload(self, crane_case, side, share):
        rao = surface_motion(crane_case, side=side).hook.rao
        omega = share * math.sqrt(2.0 * math.pi * 9.80665 / side)
        k = omega**2 / 9.80665
        x = np.linspace(-0.5 * side, 0.5 * side, 2001)
        mean = np.trapezoid(np.cos(k * x), x) / side
        assert abs(rao.response(omega)) == pytest.approx(mean, abs=1e-3)


def sine_record(step=0.2, count=301, amplitude=1.0, offset=0.0):
    t = step * np.arange(count)
    return t, offset + amplitude * np.sin(0.7 * t)


class TestRecord:
    def test_it_is_resampled_with_consistent_derivatives(self):
        t, z = sine_record()
        record = RecordMotion.from_arrays(t, z, detrend="none")
        motion = record.motion(60.0, 0.013, seed=1)
        fine = motion.time(0, motion.rows)
        inside = (fine > 3.0) & (fine < 57.0)  # the spline's ends know less
        for part, exact in zip(
            whole(motion),
            (np.sin(0.7 * fine), 0.7 * np.cos(0.7 * fine), -0.49 * np.sin(0.7 * fine)),
            strict=True,
        ):
            np.testing.assert_allclose(part[inside], exact[inside], atol=2e-6)

    def test_it_is_the_spline_itself(self):
        rng = np.random.default_rng(3)
        z = rng.standard_normal(40)
        record = RecordMotion.from_arrays(0.5 * np.arange(40), z, detrend="none")
        np.testing.assert_array_equal(whole(record.motion(19.5, 0.5, 1))[0], z)
        # The third derivative is continuous at the samples, which only a spline's is.
        _, _, a = whole(record.motion(19.5, 0.001, 1))
        third = np.diff(a) / 0.001
        for node in range(2, 37):
            before, after = third[500 * node - 1], third[500 * node]
            assert abs(after - before) < 0.01 * np.max(np.abs(third))

    def test_a_record_of_a_few_waves_earns_a_remark(self, tmp_path):
        path = tmp_path / "short.csv"
        for count, short in ((101, True), (301, False)):  # 20 s and 60 s
            t, z = sine_record(count=count)
            rows = "".join(f"{a},{b}\n" for a, b in zip(t, z, strict=True))
            path.write_text(f"time,displacement\n{rows}")
            if short:
                with pytest.warns(PhysicsWarning, match=r"short\.csv, 20 s .* shorter than 60 s"):
                    assert RecordMotion.read(path).duration == pytest.approx(20.0)
            else:
                assert RecordMotion.read(path).duration == pytest.approx(60.0)

    def test_a_motion_survives_the_way_through_a_record(self, crane):
        z = crane.motion(120.0, 0.1, seed=8)
        record = RecordMotion.from_arrays(z.time(0, z.rows), whole(z)[0], detrend="none")
        again = whole(record.motion(120.0, 0.02, seed=0))
        direct = whole(crane.motion(120.0, 0.02, seed=8))
        for one, two, allowed in zip(again, direct, (1e-6, 3e-5, 2e-3), strict=True):
            np.testing.assert_allclose(one[500:-500], two[500:-500], atol=allowed)

    def test_a_file_with_units_and_comments(self, tmp_path):
        t, z = sine_record(offset=12.0)
        path = tmp_path / "heave.csv"
        lines = [f"{1e3 * a:.1f}; {100.0 * b:.6f}; 7" for a, b in zip(t + 5.0, z, strict=True)]
        path.write_text("# logged\ntime [ms]; Displacement (cm); state\n" + "\n".join(lines) + "\n")
        record = RecordMotion.read(path)
        assert record.duration == pytest.approx(60.0)
        assert record.description == "heave.csv, 60 s at 0.2 s"
        np.testing.assert_allclose(record.displacement, z - z.mean(), atol=1e-7)

    def test_the_mean_goes_unless_it_is_to_stay(self):
        t, z = sine_record()
        shifted = RecordMotion.from_arrays(t, z + 5.0).displacement
        np.testing.assert_allclose(shifted, z - z.mean(), atol=1e-12)
        with pytest.raises(InputError, match="r: detrend must be one of none, mean; got 'x'"):
            RecordMotion.from_arrays(t, z, detrend="x", source="r")

    def test_a_wrong_velocity_is_told(self):
        t, z = sine_record()
        v = 0.7 * np.cos(0.7 * t)
        RecordMotion.from_arrays(t, z, velocity=v)
        with pytest.warns(
            PhysicsWarning, match="r: velocity is not the displacement's derivative "
        ):
            RecordMotion.from_arrays(t, z, velocity=-v, source="r")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("", ": is empty; a header line and numbers are wanted"),
            (
                "t, z\n0, 1\n",
                ": the header must name the columns time, displacement; time, displacement are "
                "missing, got 't, z'",
            ),
            (
                "time [kg], displacement\n0, 1\n",
                r":1: unit of time must be a time \[s\], got '1 kg', which is a mass",
            ),
            ("time,displacement\n0,0\n0.1,nan\n", ":3: displacement must be a finite number, got "),
            ("time,displacement\n0,0\n0.1\n", ":3: displacement must be a finite number, got ''"),
            (
                "time,displacement\n0,0\n0.1,0\n0.2,0\n",
                "heave.csv: time must have at least 8 samples, got 3",
            ),
            (
                "time,displacement\n" + "".join(f"{0.1 * i + (i > 5)},0\n" for i in range(12)),
                r"heave.csv: time must be in equal steps, got 0.5 s followed by 1.6 s "
                r"\(sample 6\), most steps are 0.1 s",
            ),
            (
                "time,displacement\n" + "0,0\n" * 9,
                "heave.csv: time must be in equal steps, got 0 s followed by 0 s ",
            ),
        ],
    )
    def test_bad_files(self, text, message, tmp_path):
        path = tmp_path / "heave.csv"
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            RecordMotion.read(path)

    def test_no_such_file(self, tmp_path):
        with pytest.raises(InputError, match=r"none\.csv: no such file"):
            RecordMotion.read(tmp_path / "none.csv")

    def test_rounded_times_are_even_enough(self):
        t, z = sine_record(step=1.0 / 30.0, count=1801)
        record = RecordMotion.from_arrays(np.round(t, 3), z)
        assert record.step == pytest.approx(1.0 / 30.0, rel=1e-5)

    def test_a_run_longer_than_the_record_is_refused(self):
        t, z = sine_record()
        record = RecordMotion.from_arrays(t, z, source="heave.csv")
        assert record.motion(60.0, 0.05, 0).rows == 1201
        with pytest.raises(
            InputError,
            match=r"heave\.csv, 60 s at 0\.2 s: lasts 60 s, less than the 61 s of the run; ",
        ):
            record.motion(61.0, 0.05, 0)

    def test_arrays_that_do_not_fit(self):
        t, z = sine_record()
        with pytest.raises(InputError, match=r"as many samples as time \(301\), got 300"):
            RecordMotion.from_arrays(t, z[1:])
        with pytest.raises(InputError, match="displacement must be finite numbers, got nan at "):
            RecordMotion.from_arrays(t, np.where(t == t[4], np.nan, z))


class TestSixDof:
    @given(
        angles=st.tuples(*[st.floats(-0.6, 0.6)] * 3),
        tip=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
        heave=st.floats(-5.0, 5.0),
    )
    def test_the_exact_rotation_is_that_of_scipy(self, angles, tip, heave):
        roll, pitch, yaw = angles
        turned = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(tip)
        exact = heave + turned[2] - tip[2]
        assert tip_heave(heave, roll, pitch, tip=tip, exact=True) == pytest.approx(exact, abs=1e-11)

    @given(angles=st.tuples(*[st.floats(-0.02, 0.02)] * 2))
    def test_small_angles_are_linear(self, angles):
        tip = (-25.0, 15.0, 20.0)
        linear = tip_heave(0.1, *angles, tip=tip)
        exact = tip_heave(0.1, *angles, tip=tip, exact=True)
        # Second order in the angles: 20 m (phi^2 + theta^2)/2 and less from the other two.
        assert abs(linear - exact) < 30.0 * (angles[0] ** 2 + angles[1] ** 2) + 1e-15

    def test_signs(self):
        # A bow-up pitch is negative; a positive roll lifts the port side.
        assert tip_heave(0.0, 0.0, -0.1, tip=(10.0, 0.0, 0.0)) == pytest.approx(1.0)
        assert tip_heave(0.0, 0.1, 0.0, tip=(0.0, 10.0, 0.0)) == pytest.approx(1.0)

    def test_a_file(self, tmp_path):
        t = 0.1 * np.arange(601)
        heave, roll, pitch = np.sin(0.7 * t), 4.0 * np.sin(0.5 * t), 2.0 * np.cos(0.6 * t)
        path = tmp_path / "mru.csv"
        path.write_text(
            "time,surge,heave,roll [deg],pitch [deg]\n"
            + "".join(
                f"{a:.1f},0,{b:.9f},{c:.9f},{d:.9f}\n"
                for a, b, c, d in zip(t, heave, roll, pitch, strict=True)
            )
        )
        source = RecordMotion.read(path, tip=(-20.0, 8.0, 15.0), detrend="none")
        found = whole(source.motion(60.0, 0.1, seed=0))[0]
        wanted = heave + 20.0 * np.radians(pitch) + 8.0 * np.radians(roll)
        np.testing.assert_allclose(found, wanted, atol=1e-8)
        assert source.description == "mru.csv, 60 s at 0.1 s, tip at (-20, 8, 15) m"
        with pytest.raises(InputError, match=r"mru\.csv: tip must be x, y and z \[m\], got 2 "):
            RecordMotion.read(path, tip=(1.0, 2.0))

    def test_degrees_are_noticed(self):
        t = 0.1 * np.arange(100)
        with pytest.warns(PhysicsWarning, match="six-dof: roll reaches 5 rad; angles are in rad"):
            tip_heave(0 * t, 5.0 * np.cos(t), 0 * t, tip=(0.0, 1.0, 0.0))

    def test_motions_of_unequal_length(self):
        t = 0.1 * np.arange(100)
        with pytest.raises(InputError, match="heave, roll and pitch must be equally long, got "):
            tip_heave(t, t[1:], t, tip=(0.0, 1.0, 0.0))
