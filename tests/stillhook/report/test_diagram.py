"""The block diagram of a design: it names what the structure hears and commands, legibly."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import matplotlib as mpl
import pytest
from designs import loopless_design, thesis_design
from matplotlib.transforms import Bbox

import stillhook as sh
from stillhook.report.diagram import block_diagram
from synth.structures import structure_names, structures_aboard

CRANE = sh.load_case("subsea-crane")
THESIS = sh.load_case("thesis-1975")
TORQUE = CRANE.replace({"winch.motor.speed_gain": 0.0, "winch.drive.command_delay": 0.012})
DRAWN = {
    **{f"{name}, crane": (CRANE, name) for name in (*structure_names(), "high-order")},
    **{f"{name}, thesis": (THESIS, name) for name in structures_aboard(THESIS)},
    "drum-feedback, torque": (TORQUE, "drum-feedback"),
}
#: What is said of a measurement on its arrow.
SAID = {
    "payload.acceleration": "acceleration P'' [m/s²]",
    "payload.velocity": "velocity P' [m/s]",
    "payload.displacement": "displacement P [m]",
    "mru.heave": "heave Z [m]",
    "mru.heave_rate": "heave rate Z' [m/s]",
    "drum.haul": "haul X [m]",
    "motor.speed": "motor speed ω [rad/s]",
    "rope.tension": "tension at drum [N]",
}
BOXES = {"payload": "telemetry", "mru": "MRU", "drum": "encoder", "rope": "load cell"}


def design_of(case, structure):
    """A design whose figures are another's: the diagram shows case and structure alone."""
    height = case.sea.significant_height
    return replace(thesis_design(), case=case, structure=structure, significant_height=height)


@cache
def figure_of(name):
    figure = block_diagram(design_of(*DRAWN[name]))
    figure.draw_without_rendering()
    return figure


def texts_of(figure):
    (axes,) = figure.axes
    hidden = {*axes.xaxis.findobj(mpl.text.Text), *axes.yaxis.findobj(mpl.text.Text)}
    every = [text for text in figure.findobj(mpl.text.Text) if text not in hidden]
    return [text for text in every if text.get_text().strip()]


def words_of(figure):
    return [line for text in texts_of(figure) for line in text.get_text().split("\n")]


@pytest.mark.parametrize("name", DRAWN)
def test_every_measurement_and_its_instrument_is_named_and_no_other(name):
    words = words_of(figure_of(name))
    heard = design_of(*DRAWN[name]).measurements
    assert heard
    assert {y for y, said in SAID.items() if said in words} == {*heard}
    families = {measurement.partition(".")[0].replace("motor", "drum") for measurement in heard}
    assert {family for family, box in BOXES.items() if box in words} == families


@pytest.mark.parametrize("name", DRAWN)
def test_no_words_lie_on_others_on_an_edge_or_on_an_arrow(name):
    figure = figure_of(name)
    (axes,) = figure.axes
    texts = [(text.get_text(), text.get_window_extent()) for text in texts_of(figure)]
    assert len(texts) > 12
    pairs = itertools.combinations(texts, 2)
    assert [(one, other) for (one, a), (other, b) in pairs if a.overlaps(b)] == []
    frames = [patch for patch in axes.patches if isinstance(patch, mpl.patches.Rectangle)]
    edges = [frame.get_window_extent() for frame in frames]
    assert len(edges) > 6
    for said, box in texts:
        for edge in edges:
            within = edge.containsx(box.x0) and edge.containsx(box.x1)
            assert (within and edge.containsy(box.y0)) or not edge.overlaps(box), said
    arrows = [child for child in axes.texts if getattr(child, "arrow_patch", None) is not None]
    assert len(arrows) > 7
    for arrow in arrows:
        line = Bbox(axes.transData.transform([arrow.xyann, arrow.xy]))
        line = Bbox.from_extents(*line.min, *line.max)
        assert [said for said, box in texts if box.overlaps(line)] == []


@pytest.mark.parametrize("name", DRAWN)
def test_words_are_large_enough_and_stay_inside(name):
    figure = figure_of(name)
    whole = figure.get_window_extent()
    assert figure.get_figwidth() <= 7.6
    for text in texts_of(figure):
        assert text.get_fontsize() >= 9.0
        box = text.get_window_extent()
        assert whole.x0 <= box.x0 < box.x1 <= whole.x1
        assert whole.y0 <= box.y0 < box.y1 <= whole.y1


@pytest.mark.parametrize(
    ("name", "command", "unit"),
    [
        ("combined, crane", "u: motor speed", "[rad/s]"),
        ("drum-feedback, torque", "u: motor torque", "[N m]"),
        ("drum-feedback, thesis", "u: armature voltage", "[V]"),
    ],
)
def test_the_command_is_that_of_the_drive(name, command, unit):
    texts = [text.get_text().replace("\n", " ") for text in texts_of(figure_of(name))]
    assert command in texts
    assert unit in texts
    heading = f"{name.partition(',')[0]} sets the {command.removeprefix('u: ')}, hearing payload"
    assert figure_of(name).get_suptitle().startswith(heading)


def test_the_law_is_told_with_its_sign():
    for name, law in (
        ("payload-feedback", "u = -A (a P'' + a1 P' + a2 P)."),
        ("payload-feedback-lead", "u = +C y, with y all that the controller hears."),
        ("feed-forward", "u = +C y, with y all that the controller hears."),
    ):
        said = [word for word in words_of(figure_of(f"{name}, crane")) if word.startswith("u = ")]
        assert said == [f"{law}  Z and P count upwards, X and ω when hauling in."]


def test_delays_are_those_of_the_case():
    assert {"30 ms late", "20 ms late"} <= {*words_of(figure_of("combined, crane"))}
    assert {"30 ms late", "12 ms late"} <= {*words_of(figure_of("drum-feedback, torque"))}
    assert "no delay" in words_of(figure_of("payload-feedback, thesis"))


def test_a_search_that_found_nothing_has_a_loop_to_show():
    assert "payload" in words_of(block_diagram(loopless_design()))
