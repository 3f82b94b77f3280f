"""The figures: they show the numbers of the design, with labels, units and a finding."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from designs import infeasible_design, loopless_design, thesis_design, unstable_design

from models import InputError
from stillhook.designs.figures import limits, nyquist, payload_spectrum, responses
from stillhook.designs.motion import MotionView
from stillhook.text import picture

FIGURES = {f.__name__: f for f in (payload_spectrum, responses, nyquist, limits)}

LABELS = {
    "payload_spectrum": [("frequency [rad/s]", "variance density [m² s/rad]")],
    "responses": [
        ("", "payload over hook |P/Z| [m/m]"),
        ("frequency [rad/s]   (shaded: 90 % of the hook's motion)", "drum over hook |X/Z| [m/m]"),
    ],
    "nyquist": [("real part of L [-]", "imaginary part of L [-]")],
    "limits": [("use of the limit [%]   (hatched: reported, not enforced)", "")],
}


def line(axes, label):
    (found,) = [item for item in axes.get_lines() if str(item.get_label()).startswith(label)]
    return np.asarray(found.get_xdata()), np.asarray(found.get_ydata())


def finding(figure) -> str:
    return figure.get_suptitle()


@pytest.mark.parametrize("name", FIGURES)
def test_axes_are_labelled_with_units_and_titles_say_what_was_found(name):
    figure = FIGURES[name](thesis_design())
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes] == LABELS[name]
    assert len(finding(figure)) > 20
    title = figure.axes[0].get_title(loc="left")
    assert title == "thesis-1975: $H_s$ 2.44 m, $T_S$ 8.10 s, bretschneider-1975"


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("make", [thesis_design, infeasible_design])
def test_no_text_is_smaller_than_nine_points_or_leaves_the_figure(name, make):
    figure = FIGURES[name](make())
    figure.draw_without_rendering()
    texts = [
        text
        for text in figure.findobj(mpl.text.Text)
        if text.get_text() and text.get_visible() and text.get_window_extent().width > 0.0
    ]
    assert min(text.get_fontsize() for text in texts) >= 9.0
    title = figure.get_window_extent()
    headings = [t for t in texts if t.get_text() == finding(figure)]
    headings += [axes.title for axes in figure.axes] + [figure.axes[0]._left_title]
    assert all(t.get_window_extent().x1 <= title.x1 for t in headings)


def test_spectrum_integrates_to_the_variances():
    design = thesis_design()
    axes = payload_spectrum(design).axes[0]
    for label, rms, share in (
        ("hook", design.hook_rms, 0.998),
        ("payload, drum held", design.payload_rms_before, 0.999),
        ("payload, with the gains", design.payload_rms, 0.95),
    ):
        omega, density = line(axes, label)
        found = math.sqrt(float(np.trapezoid(density, omega)))
        # The axis ends where nearly all of each variance is in view.
        assert share < found / rms < 1.002, label
        assert axes.get_xlim()[1] >= omega[-1]
        low, high = axes.get_ylim()
        assert low < density.max() < high


def test_responses_are_those_of_one_spring_in_closed_form():
    design = thesis_design()
    case = design.case
    upper, lower = responses(design).axes
    omega, held = line(upper, "drum held")
    K, M, C = case.rope.stiffness, case.moving_mass, 1187.2
    s = 1j * omega
    assert np.allclose(held, np.abs(K / (M * s**2 + C * s + K)), rtol=1e-9)
    # 1975 thesis: T_2 = T/G - 1 ties the drum's motion to the payload's.
    payload = design.assessment.response("payload.displacement", "hook.heave", omega)
    assert np.allclose(line(upper, "with the gains")[1], np.abs(payload), rtol=1e-9)
    drum = np.asarray(lower.get_lines()[0].get_ydata())
    assert np.allclose(drum, np.abs(payload * (M * s**2 + C * s + K) / K - 1.0), rtol=1e-6)


def test_responses_mark_the_peak_and_the_limit():
    upper, lower = responses(thesis_design()).axes
    # The digest of the thesis: peak |X/Z| 5.08 at 7.67 rad/s.
    assert [text.get_text() for text in lower.texts] == ["peak 5.08 at 7.67 rad/s"]
    corner, ratio = line(upper, "limit: 0.1 up to 0.01 rad/s")
    assert corner[1] == 0.01
    assert ratio[0] == 0.1


def test_nyquist_curve_touches_the_circle_of_its_sensitivity():
    design = thesis_design()
    figure = nyquist(design)
    real, imaginary = line(figure.axes[0], "L(iω)")
    distance = np.abs(real + 1j * imaginary + 1.0)
    assert design.margins is not None
    assert distance.min() == pytest.approx(1.0 / design.margins.max_sensitivity, rel=1e-3)
    ring = line(figure.axes[0], "$M_s$ = 5.15")
    assert np.allclose(np.hypot(ring[0] + 1.0, ring[1]), 1.0 / design.margins.max_sensitivity)
    assert finding(figure) == "L stays 0.194 away from -1, phase margin 11.3°"
    assert "the curve crosses the axis at -10.9" in [t.get_text()[2:] for t in figure.axes[0].texts]


def test_nyquist_curve_is_smooth_where_it_is_in_view_and_the_view_is_small():
    axes = nyquist(thesis_design()).axes[0]
    real, imaginary = line(axes, "L(iω)")
    left, right = axes.get_xlim()
    seen = (real > left) & (real < right) & (np.abs(imaginary) < axes.get_ylim()[1])
    steps = np.abs(np.diff(real + 1j * imaginary))[seen[1:] & seen[:-1]]
    assert steps.max() < 0.02 * (right - left)
    # At low frequency this L is in the millions.
    assert np.abs(real).max() > 1e3
    assert right - left < 10.0


def test_bars_are_the_uses_and_say_value_and_bound():
    design = thesis_design()
    axes = limits(design).axes[0]
    bars = {
        label.get_text(): bar.get_width()
        for label, bar in zip(axes.get_yticklabels(), axes.patches, strict=True)
    }
    assert len(bars) == len(design.limits)
    speed = design.limits["motor.speed.peak"]
    assert bars["motor speed, peak"] == pytest.approx(100.0 * speed.use)
    assert bars["motor torque, peak"] == 200.0  # cut off, and said so
    texts = [text.get_text() for text in axes.texts]
    assert "5.15  (≤ 2.00)   257 % ▸" in texts
    assert "1678 rpm  (≤ 1200 rpm)" in texts
    assert [bar.get_hatch() for bar in axes.patches] == [None] * 2 + ["///"] * 8


def test_findings_of_limits():
    assert finding(limits(thesis_design())) == (
        "Broken: sensitivity peak $M_s$; 6 reported ones exceeded"
    )
    kept = dataclasses.replace(thesis_design().limits["low_frequency"], use=1.0)
    design = dataclasses.replace(thesis_design(), limits={"low_frequency": kept})
    assert finding(limits(design)) == "Every enforced limit is kept, 1 used up"


def test_prices_stand_in_the_bars():
    use = dataclasses.replace(thesis_design().limits["max_sensitivity"], use=1.0, price=4.2e-4)
    design = dataclasses.replace(thesis_design(), limits={"max_sensitivity": use})
    assert "price 0.42 mm per %" in limits(design).axes[0].texts[0].get_text()


def test_an_unstable_loop_has_no_compensated_payload():
    design = unstable_design()
    spectrum = payload_spectrum(design)
    labels = [str(item.get_label()) for item in spectrum.axes[0].get_lines()]
    assert [label.partition(":")[0] for label in labels] == ["hook", "payload, drum held"]
    assert finding(spectrum) == "The loop is unstable: no compensated payload to show"
    assert len(responses(design).axes) == 1
    assert finding(nyquist(design)) == "The loop is unstable"
    with pytest.raises(InputError, match="the loop is unstable, so there is no use of limits"):
        limits(design)


def test_a_loop_without_gains_has_no_nyquist_curve():
    with pytest.raises(InputError, match="all gains are zero, so there is no loop"):
        nyquist(loopless_design())


@pytest.mark.ci
def test_figures_leave_matplotlib_as_it_was_and_need_no_pyplot():
    before = dict(mpl.rcParams)
    picture(limits(thesis_design()), "png")
    assert dict(mpl.rcParams) == before
    script = (
        "import sys, stillhook.designs.figures; print([m for m in sys.modules if 'matplot' in m])"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True
    )
    assert run.stdout.strip() == "[]"  # matplotlib comes with the first figure
    assert "matplotlib.pyplot" not in limits.__globals__


def test_the_same_design_gives_the_same_files():
    for kind, start in (("svg", b"<?xml"), ("png", b"\x89PNG")):
        one, other = (picture(limits(thesis_design()), kind) for _ in range(2))
        assert one.startswith(start)
        assert one == other


def test_motion_of_an_unstable_loop_has_a_before_and_no_after():
    (_, (name, before, *_)) = MotionView(unstable_design()).motions()
    assert name == "payload, drum held"
    assert before == pytest.approx(5.99, abs=0.01)  # digest of the 1975 thesis


def test_motion_periods_against_a_sum_over_a_fine_grid():
    view = MotionView(thesis_design())
    omega = np.linspace(*view.hook.band, 2_000_000)
    density = view.held_density(omega)
    m0, m2 = (float(np.trapezoid(omega**n * density, omega)) for n in (0, 2))
    assert view.held_period == pytest.approx(2.0 * math.pi * math.sqrt(m0 / m2), rel=1e-4)
    name, rms, significant, largest = view.motions()[1]
    expected = rms * math.sqrt(2.0 * math.log(10800.0 / view.held_period))
    assert (name, significant) == ("payload, drum held", 4.0 * rms)
    assert largest == pytest.approx(expected, rel=1e-12)
