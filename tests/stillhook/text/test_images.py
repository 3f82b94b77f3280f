"""Figures as images: words are text, and an SVG says what it shows, alone and among others."""

from __future__ import annotations

import base64
import io
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from designs import thesis_design
from fontTools.ttLib import TTFont
from matplotlib import rc_context
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from models.basics import InputError
from stillhook.designs.figures import limits, nyquist, payload_spectrum, responses
from stillhook.text import (
    Drawing,
    OutputFolder,
    characters_of,
    headline,
    inline_svg,
    panel,
    picture,
    styled,
)
from stillhook.text.style import drawn

SVG, LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
FINDING = "In H_s 2.44 m the load < 3 mm & <still>"
DESIGN_FIGURES = (payload_spectrum, responses, nyquist, limits)


@drawn
def trial():
    """A figure with all that is special: formulas, hatches, markers, colours, powers, curves."""
    figure, axes = panel()
    axes.barh([1, 2], [30.0, 50.0], hatch="///", edgecolor="white")
    axes.plot([1.0, 1e3], [1.0, 2.0], marker="o", label="$M_s$ = 2.00, at its limit")
    axes.plot(np.geomspace(1.0, 1e3, 40), 1.5 + np.sin(np.arange(40.0)), clip_on=True)
    hole = Path([(5.0, 1.2), (9.0, 1.2), (9.0, 1.8), (5.0, 1.2)], [1, 2, 2, 79])
    axes.add_patch(PathPatch(Path.make_compound_path(hole, hole, hole)))
    axes.set_xscale("log")
    axes.set_xlabel("use [%]   (hatched: reported)")
    axes.set_ylabel("of the hook's motion, slanted", fontstyle="italic")
    axes.legend()
    return headline(figure, FINDING, "trial: T_p 8 s")


def svg(**given):
    return ET.fromstring(picture(trial(), "svg", **given))


def as_matplotlib_writes(figure, fonttype):
    target = io.BytesIO()
    with styled(), rc_context({"svg.fonttype": fonttype}):
        figure.savefig(target, format="svg", metadata={"Date": None})
    return target.getvalue()


def words(root):
    return ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]


def referred(root):
    """Every id that something refers to."""
    links = [e.get(LINK, "")[1:] for e in root.iter() if e.get(LINK, "").startswith("#")]
    values = [value for element in root.iter() for value in element.attrib.values()]
    labelled = root.get("aria-labelledby", "").split()
    return {*links, *re.findall(r"url\(#(.*?)\)", " ".join(values)), *labelled}


def ids(root):
    found = [element.get("id") for element in root.iter() if element.get("id") is not None]
    assert len(found) == len({*found})
    return {*found}


def test_words_are_text_and_formulas_stand_in_reading_order():
    said = words(svg())
    assert "In Hs 2.44 m the load < 3 mm & <still>" in said
    assert "trial: Tp 8 s" in said
    assert "Ms = 2.00, at its limit" in said
    assert "use [%]   (hatched: reported)" in said
    assert {"100", "103"} <= {*said}  # powers of ten


def test_spaces_stay_as_many_as_matplotlib_left_room_for():
    # A browser joins spaces unless it is told of each text, not of all, that they count.
    keep = "{http://www.w3.org/XML/1998/namespace}space"
    texts = [text for text in svg().iter(f"{SVG}text") if len(text) or "  " in text.text]
    assert len(texts) > 4
    assert {text.get(keep) for text in texts} == {"preserve"}


def test_every_letter_of_a_formula_stays_where_matplotlib_put_it():
    figure = trial()
    there = ET.fromstring(as_matplotlib_writes(figure, "none"))
    here = ET.fromstring(picture(figure, "svg"))

    def letters(root):
        for span in root.iter(f"{SVG}tspan"):
            places = span.attrib["x"].split()
            assert len(places) == len(span.text)
            for x, letter in zip(places, span.text, strict=True):
                yield letter.replace("\xa0", " "), (float(x), float(span.attrib["y"]))

    (said, places), (others, near) = (
        zip(*sorted(letters(root)), strict=True) for root in (there, here)
    )
    assert said == others
    assert np.allclose(places, near, rtol=0.0, atol=0.00501)


def test_curves_are_those_that_matplotlib_wrote_to_a_hundredth_of_a_point():
    figure = trial()
    there = ET.fromstring(as_matplotlib_writes(figure, "none"))
    here = ET.fromstring(picture(figure, "svg"))
    paths = [[path.attrib["d"] for path in root.iter(f"{SVG}path")] for root in (there, here)]
    assert len(paths[0]) > 10
    assert "Q" in "".join(paths[0]) or "C" in "".join(paths[0])
    for before, after in zip(*paths, strict=True):
        (commands, places), (others, near) = absolute(before), absolute(after)
        assert commands == others
        assert np.allclose(places, near, rtol=0.0, atol=0.00501)


def absolute(path):
    """Return the commands of a path, and its places [pt], whichever way it tells them."""
    here = start = np.zeros(2)
    commands, places = "", []
    for command, numbers in re.findall(r"([MLQCZmlqcz])([^A-Za-z]*)", path):
        given = np.array(numbers.split(), dtype=float).reshape(-1, 2)
        commands += command.upper()
        if command in "zZ":
            here = start
            continue
        found = given + (here if command.islower() else 0.0)
        places += [*found]
        here = found[-1]
        start = here if command in "mM" else start
    return commands, np.array(places)


def test_a_figure_says_what_it_shows_and_what_it_found():
    root = svg(name="own/trial 1", caption="Use of < & H_s")
    title, about = root[0], root[1]
    assert (title.tag, about.tag) == (f"{SVG}title", f"{SVG}desc")
    assert title.text == "Use of < & H_s"
    assert about.text == f"{FINDING}. trial: T_p 8 s"
    assert root.get("role") == "img"
    assert root.get("aria-labelledby") == f"{title.get('id')} {about.get('id')}"
    # Without a caption the finding is the title.
    assert svg()[0].text == FINDING
    assert svg()[1].text == "trial: T_p 8 s"
    silent = ET.fromstring(picture(drawn(lambda: panel()[0])(), "svg", name="silent"))
    assert [each.text for each in silent if each.tag in (f"{SVG}title", f"{SVG}desc")] == ["silent"]


def test_figures_in_one_page_refer_to_nothing_but_their_own():
    one = ET.fromstring(inline_svg(Drawing("limits", "The limits", trial)))
    other = ET.fromstring(inline_svg(Drawing("2nd of/them", "The same", trial)))
    assert not ids(one) & ids(other)
    for root in (one, other):
        assert len(referred(root)) > 4
        assert referred(root) == ids(root)
    assert all(name.startswith("limits-") for name in ids(one))
    assert all(re.fullmatch(r"_2nd_of_them-[\w-]+", name) for name in ids(other))


def test_a_page_is_handed_an_element_that_changes_nothing_around_it():
    text = inline_svg(Drawing("trial", "A trial", trial))
    assert text.startswith("<svg ")
    assert "<style" not in text
    assert "<metadata" not in text
    root = ET.fromstring(text)
    assert root.get("stroke-linejoin") == "round"  # what matplotlib says of everything there is
    assert root.get("font-family") == "'DejaVu Sans', Verdana, sans-serif"
    assert not [e for e in root.iter() if "font-family" in e.get("style", "")]


@pytest.mark.parametrize("make", [trial, lambda: limits(thesis_design())], ids=["trial", "limits"])
def test_a_file_carries_every_glyph_that_it_shows(make):
    image = picture(make(), "svg")
    root = ET.fromstring(image)
    rules = re.findall(
        r"@font-face\{font-family:'DejaVu Sans';font-weight:(\d+);font-style:(\w+);"
        r"src:url\(data:font/woff;base64,([^)]*)\) format\('woff'\)\}",
        root.findtext(f"{SVG}style"),
    )
    carried = {
        (weight, style): {*TTFont(io.BytesIO(base64.b64decode(data))).getBestCmap()}
        for weight, style, data in rules
    }
    shown = {}
    for element in [*root.iter(f"{SVG}text"), *root.iter(f"{SVG}tspan")]:
        style = dict(part.split(": ") for part in element.get("style", "").split(";") if part)
        slant = {"italic": "oblique"}.get(style.get("font-style"), style.get("font-style"))
        face = style.get("font-weight", "400"), slant or "normal"
        shown.setdefault(face, set()).update(map(ord, element.text or ""))
    shown = {face: letters for face, letters in shown.items() if letters}
    assert {("400", "normal"), ("700", "normal"), ("400", "oblique")} <= {*shown}
    assert carried == shown
    # The words of a page know the same, and a file can leave it to its page.
    named = {"regular": ("400", "normal"), "bold": ("700", "normal"), "oblique": ("400", "oblique")}
    told = characters_of(image.decode())
    assert {named[face]: {*map(ord, told[face])} for face in told} == shown
    assert "@font-face" not in picture(make(), "svg", font=False).decode()


def test_the_same_figure_gives_the_same_file():
    assert picture(trial(), "svg") == picture(trial(), "svg")


@pytest.mark.parametrize("make", DESIGN_FIGURES, ids=lambda make: make.__name__)
def test_text_takes_less_than_half_of_what_outlines_took(make):
    figure = make(thesis_design())
    outlines = len(as_matplotlib_writes(figure, "path"))
    assert len(picture(figure, "svg")) < 0.45 * outlines
    assert len(picture(figure, "svg", font=False)) < 0.35 * outlines


def test_a_folder_is_given_files_that_tell_their_drawings(tmp_path):
    folder = OutputFolder.prepare(tmp_path, ("svg",))
    (path,) = folder.draw([Drawing("trial", "A trial", trial)])
    assert path.read_bytes() == picture(trial(), "svg", name="trial", caption="A trial")


def test_what_cannot_be_drawn_is_no_element():
    def nothing():
        raise InputError("there is nothing to show")

    with pytest.raises(InputError, match="nothing to show"):
        inline_svg(Drawing("curve", "", nothing))
