"""The cable study against closed forms, an integral of its own, and the exact rope."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from cables import cable_study
from scipy.integrate import quad

from models import HookMotion, PhysicsWarning, load_case
from models.basics import InputError

# The thesis's rule for C: the energy of a sine of 5.7 s, here with 0.12 m of amplitude.
ENERGY = {"payload.drag": {"method": "energy", "amplitude": 0.12, "frequency": 1.1}}
LENGTHS, PAYLOADS = (1000.0, 1500.0, 2000.0), (18_422.0, 36_844.0)


@pytest.fixture(scope="module")
def case():
    return load_case("thesis-1975").replace(ENERGY)


@pytest.fixture(scope="module")
def study(case):
    return cable_study(case, LENGTHS, PAYLOADS)


def test_six_cables_by_hand(study):
    assert [(c.length, c.payload_mass) for c in study.cables] == [
        (length, mass) for length in LENGTHS for mass in PAYLOADS
    ]
    for cable in study.cables:
        K, M = 1.6e8 / cable.length, 2.0 * cable.payload_mass + 8.1 * cable.length
        # 1975 thesis, eq. 13: C = 4/(3 pi) rho C_D A omega Y
        C = 4.0 / (3.0 * math.pi) * 1000.0 * 1.05 * 20.0 * 1.1 * 0.12
        zeta = C / (2.0 * math.sqrt(K * M))
        assert cable.stiffness == pytest.approx(K, rel=1e-12)
        assert cable.moving_mass == pytest.approx(M, rel=1e-12)
        assert cable.drag == pytest.approx(C, rel=1e-12)
        assert cable.natural_frequency == pytest.approx(math.sqrt(K / M), rel=1e-12)
        assert cable.peak == pytest.approx(0.5 / (zeta * math.sqrt(1.0 - zeta**2)), rel=1e-9)
        peak_at = math.sqrt(K / M * (1.0 - 2.0 * zeta**2))
        assert cable.peak_frequency == pytest.approx(peak_at, rel=1e-6)


def test_payload_motion_by_another_integral(study, case):
    hook = HookMotion.from_case(case)
    for cable in (study.cables[0], study.worst):
        K, M, C = cable.stiffness, cable.moving_mass, cable.drag

        def variance(omega, K=K, M=M, C=C):
            G = K / (K - M * omega**2 + 1j * C * omega)
            return float(abs(G) ** 2 * hook.density(np.array([omega]))[0])

        marks = sorted({0.26, *hook.splits, cable.natural_frequency, 3.0})
        total = sum(
            quad(variance, a, b, epsabs=0.0, epsrel=1e-9, limit=400)[0] for a, b in pairwise(marks)
        )
        assert cable.payload_rms**2 == pytest.approx(total, rel=1e-4)  # |G|^2 is 2e-6 above 3


def test_the_worst_is_the_one_that_moves_most_not_the_highest_peak(study):
    assert study.worst is study.cables[-1]  # 2000 m with 36.8 t, the thesis's design case
    assert study.worst.natural_frequency == pytest.approx(0.9434, abs=1e-4)
    assert study.worst.payload_rms == max(c.payload_rms for c in study.cables)
    highest = max(study.cables, key=lambda c: c.peak)
    assert highest.length == 1000.0
    assert highest.payload_rms < study.worst.payload_rms / 3.0


def test_printed_table_marks_the_worst(study):
    lines = str(study).splitlines()
    assert len(lines) == 2 + 6
    assert [line.endswith("<- worst") for line in lines[2:]] == [False] * 5 + [True]
    words = ["2000", "36.8", "80.0", "89.9", "1176", "0.943", "72.08", "6.021", "<-", "worst"]
    assert lines[-1].split() == words


def test_a_rope_with_axial_modes():
    case = load_case("thesis-1975-rope").replace({"limits.drive": "report"})
    (cable,) = cable_study(case, lengths=[1000.0]).cables
    # nu tan nu = m L / M_1, omega = nu c / L (exact first mode of the distributed rope)
    nu = cable.natural_frequency * 1000.0 / math.sqrt(1.6e8 / 8.1)
    assert nu * math.tan(nu) == pytest.approx(8.1 * 1000.0 / 73_688.0, rel=1e-9)
    assert cable.moving_mass == pytest.approx(73_688.0 + 8100.0 / 3.0)
    # Drag that agrees with the motion: C = sqrt(8/pi) q sigma_v, and sigma_v ~ omega sigma.
    sigma_v = cable.drag / (math.sqrt(8.0 / math.pi) * 10_500.0)
    assert 0.5 < sigma_v / cable.payload_rms < 1.5
    assert cable.peak < 30.0


def test_added_mass_and_weight_follow_the_payload(study, case):
    light = study.cables[0].case
    assert light.payload.virtual_mass == pytest.approx(36_844.0)
    assert light.payload.submerged_weight == pytest.approx(0.5 * case.payload.submerged_weight)
    assert light.payload.area == case.payload.area
    assert study.case is case


def test_its_own_cable_without_further_questions(case):
    (cable,) = cable_study(case).cables
    assert (cable.length, cable.payload_mass) == (2000.0, 36_844.0)


def test_no_damping_at_all_has_no_peak():
    case = load_case("thesis-1975").replace({"payload.drag.coefficient": 0.0})
    (cable,) = cable_study(case).cables
    assert cable.peak == cable.payload_rms == math.inf


def test_overdamped_follows_the_hook():
    case = load_case("thesis-1975").replace({"payload.drag.coefficient": 4e5})
    (cable,) = cable_study(case).cables
    assert cable.peak == pytest.approx(1.0, rel=1e-6)
    assert cable.peak_frequency < 0.01


def test_bad_input(case):
    with pytest.raises(InputError, match="at least one value each"):
        cable_study(case, lengths=[])
    with pytest.raises(InputError, match=r"rope\.length"):
        cable_study(case, lengths=[-5.0])


def test_a_payload_too_heavy_for_the_motor_is_remarked_on(case):
    with (
        pytest.warns(PhysicsWarning, match="torque_continuous: .* is below the static"),
        pytest.warns(PhysicsWarning, match="current_continuous: .* is below"),
    ):
        cable_study(case, payloads=[60e3])
