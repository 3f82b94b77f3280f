"""What a look shows in words, bars and charts."""

from __future__ import annotations

import math
import re
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest

import stillhook as sh
from stillhook.page.charts import (
    COLOURS,
    capability_chart,
    colour_rules,
    legend,
    limit_bars,
    nyquist_chart,
    response_chart,
    spectrum_chart,
)
from stillhook.page.curves import picture_of, prices_of
from stillhook.page.desk import Desk, Question
from stillhook.page.jobs import Capability
from stillhook.page.limit_words import WHAT_LIMITS_ARE, explained
from stillhook.page.svg import HEIGHT, WIDTH, Axis, Chart
from stillhook.text import AFTER, HOOK
from synth.design import LimitUse

GAINS = {"A": 200, "a": 50, "a1": 100, "a2": 100}


@cache
def view():
    return sh.prepare(sh.load_case("thesis-1975"))


@cache
def look():
    return view().evaluate(GAINS)


@cache
def unstable():
    return view().evaluate({**GAINS, "a2": -1e5})


def numbers(svg: str, look: str) -> np.ndarray:
    """Return the points of the curve with some classes."""
    points = re.search(rf'<polyline class="line {look}" points="([^"]*)"', svg)
    assert points is not None
    return np.array([[float(v) for v in pair.split(",")] for pair in points[1].split()])


def test_the_headline_is_that_of_the_design():
    picture, design = picture_of(look()), sh.evaluate_gains(view().case, GAINS)
    assert picture.rms == "11.7 mm"
    assert design.payload_rms == pytest.approx(0.0117, abs=1e-4)
    assert picture.share == f"{100 * design.residual:.1f} %"
    assert float(picture.sensitivity) == pytest.approx(design.margins.max_sensitivity, rel=5e-3)
    largest = float(picture.largest.split()[0])
    assert largest == pytest.approx(
        design.assessment.peak("payload.displacement", 10800) * 1e3, rel=0.02
    )
    assert picture.largest_of == "largest in 3 h"
    assert picture.sea == (view().case.sea.spectral_peak_period, 2.4384)


def test_what_breaks_is_said_in_a_sentence():
    picture = picture_of(look())
    assert picture.stable
    assert not picture.kept
    assert picture.verdict.startswith("Breaks")
    broken = next(row.label for row in picture.limits if row.enforced and not row.kept)
    assert broken in picture.verdict
    gone = picture_of(unstable())
    assert not gone.stable
    assert not gone.kept
    assert gone.verdict.startswith("Unstable, grows by a factor e every")
    assert (gone.rms, gone.share, gone.largest, gone.delay) == ("-", "-", "-", "-")


def test_prices_are_those_of_the_last_optimum():
    name = look().limits["low_frequency"].name
    rows = {row.name: row for row in picture_of(look(), {name: 3e-4}).limits}
    assert rows[name].price == "0.30 mm"
    assert not rows["max_sensitivity"].price
    uses = {
        n: LimitUse(name=n, value=1, bound=1, use=1, price=p)
        for n, p in (("dear", 1e-4), ("noise", 1e-12))
    }
    found = sh.evaluate_gains(view().case, GAINS)
    import dataclasses

    assert prices_of(dataclasses.replace(found, limits=uses)) == {"dear": 1e-4}


def test_curves_are_those_of_the_loop():
    curves, design = picture_of(look()).curves, sh.evaluate_gains(view().case, GAINS)
    want = np.abs(design.assessment.response("payload.displacement", "hook.heave", curves.omega))
    assert curves.response == pytest.approx(want, rel=0.05)
    rms = math.sqrt(np.trapezoid(curves.density, curves.omega))
    assert rms == pytest.approx(design.payload_rms, rel=0.02)
    assert np.trapezoid(curves.hook, curves.omega) == pytest.approx(design.hook_rms**2, rel=0.02)
    assert curves.band[0] < 2 * math.pi / design.case.sea.spectral_peak_period < curves.band[1]


def test_the_nyquist_curve_has_no_corners_and_passes_its_nodes():
    curves = picture_of(look()).curves
    assert curves.loop_gain.size > look().loop_gain.size
    near = look().loop_gain[np.abs(look().loop_gain) < 5.0]
    apart = [float(np.abs(curves.loop_gain - value).min()) for value in near]
    assert max(apart) < 1e-9


@pytest.mark.parametrize("chart", [response_chart, spectrum_chart, nyquist_chart])
def test_charts_are_whole_and_within_their_frame(chart):
    for found in (look(), unstable()):
        text = chart(picture_of(found))
        root = ElementTree.fromstring(text)
        if root.tag == "svg":
            assert root.get("viewBox") == f"0 0 {WIDTH:g} {HEIGHT:g}"
            assert root.get("aria-label")
            assert not re.search(r"nan|inf", text)
            # Curves are cut off by the frame, an SVG of its own.
            (inner,) = root.findall("svg")
            assert inner.get("overflow") == "hidden"
            assert {e.tag for e in root} <= {"path", "text", "svg"}


def test_the_disc_of_m_s_has_its_radius():
    text = nyquist_chart(picture_of(look()))
    unit = float(re.search(r'class="unit"[^>]* r="([\d.]+)"', text)[1])
    disc = float(re.search(r'class="disc"[^>]* r="([\d.]+)"', text)[1])
    assert disc == pytest.approx(unit / view().case.limits.max_sensitivity, abs=0.1)


def test_an_axis_maps_its_ends_and_marks_round_values():
    chart = Chart(
        x=Axis(label="x", low=0.0, high=10.0),
        y=Axis(label="y", low=0.01, high=10.0, log=True),
        about="a",
    )
    (left, bottom), (right, top) = chart.points([0.0, 10.0], [0.01, 10.0])
    assert left < right
    assert bottom > top
    middle = chart.points(5.0, 10**-0.5)
    assert middle == pytest.approx([(left + right) / 2, (top + bottom) / 2])
    assert chart.x.marks() == (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)
    assert set(chart.y.marks()) >= {0.01, 0.1, 1.0, 10.0}
    far = chart.points([1e9, math.inf], [0.0, math.nan])
    assert np.all(np.isfinite(far))


def test_bars_say_use_bound_and_price():
    rows = picture_of(look(), {"low_frequency": 3e-4}).limits
    text = limit_bars(rows)
    assert text.count('class="bar ') == len(rows)
    assert 'href="#limit-max_sensitivity"' in text
    broken = next(row for row in rows if row.enforced and not row.kept)
    assert ">broken<" in text
    assert f"{100 * broken.use:.0f} %" in text
    assert "reported" in text
    widths = [float(w) for w in re.findall(r"width:([\d.]+)%", text)]
    assert max(widths) <= 100.0
    assert "no use of limits" in limit_bars(())


def test_the_capability_shows_the_sea_and_what_binds():
    found = Capability(
        periods=(5.0, 10.0, 15.0),
        heights=(math.inf, 3.0, 4.0),
        held=(2.0, 2.0, 2.0),
        binding=("", "motor.power.peak", "max_sensitivity"),
    )
    text = capability_chart(found, (10.0, 2.0), old=False)
    assert "At T_p 10 s up to H_s 3 m: then motor power, peak binds." in text
    assert numbers(text, "drum")[0, 1] < 0.0  # where nothing binds the curve leaves the frame
    assert "nothing binds" in capability_chart(found, (5.0, 2.0), old=False)
    old = capability_chart(found, (10.0, 2.0), old=True)
    assert "binds" not in old
    assert "drum old" in old
    assert "in the background" in capability_chart(None, (10.0, 2.0), old=False)
    none = Capability(periods=(), heights=(), held=(), binding=(), note="no <stable> loop")
    assert "no &lt;stable&gt; loop" in capability_chart(none, (10.0, 2.0), old=False)


def test_colours_mean_what_they_mean_in_every_figure():
    assert (COLOURS["hook"][0], COLOURS["after"][0]) == (HOOK, AFTER)
    rules = colour_rules()
    assert f"--after:{AFTER};" in rules
    assert "body--dark" in rules
    assert legend(("hook", "hook")).count("<i") == 1


def test_every_limit_is_explained():
    from stillhook.designs import LIMITS

    assert set(WHAT_LIMITS_ARE) == set(LIMITS)
    text = explained()
    assert all(f'id="limit-{name}"' in text for name in LIMITS)
    assert "limits.max_sensitivity" in text


def test_the_desk_keeps_what_did_not_change():
    desk = Desk()
    state = desk.state(sh.load_case("thesis-1975"), "payload-feedback")
    first = desk.look(Question(state=state))
    assert first.picture.rms == "11.7 mm"
    kept = desk._view
    moved = desk.look(Question(state=state.with_value("a1", 90.0)))
    assert desk._view is kept
    assert moved.picture.rms != first.picture.rms
    calm = state.with_value("sea.significant_height", 1.0)
    half = desk.look(Question(state=calm))
    assert desk._view is not kept
    want = sh.evaluate_gains(calm.case_now, GAINS).payload_rms
    assert half.picture.rms == f"{1e3 * want:.2f} mm"
    with pytest.raises(sh.InputError):
        desk.look(Question(state=state.with_value("rope.length", -5.0)))
    again = desk.look(Question(state=calm))
    assert again.picture.rms == half.picture.rms
