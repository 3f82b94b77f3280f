"""The font of figures and pages: the glyphs that are used, and where they come from."""

from __future__ import annotations

import base64
import io
import re
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import pytest
from fontTools.ttLib import TTFont

from stillhook.text import font_face

WORDS = "AV: 3.20 mm ≤ 4 °"
FILES = {
    "regular": "DejaVuSans",
    "bold": "DejaVuSans-Bold",
    "oblique": "DejaVuSans-Oblique",
    "bold oblique": "DejaVuSans-BoldOblique",
}


def fonts(css):
    return [
        TTFont(io.BytesIO(base64.b64decode(data))) for data in re.findall(r"base64,([^)]*)\)", css)
    ]


@pytest.mark.parametrize("face", FILES)
def test_glyphs_are_those_of_the_font_that_figures_are_measured_with(face):
    (found,) = fonts(font_face(WORDS, [face]))
    file = Path(mpl.get_data_path()) / "fonts" / "ttf" / f"{FILES[face]}.ttf"
    whole = TTFont(file)
    assert {*found.getBestCmap()} == {ord(letter) for letter in WORDS}
    for letter in WORDS:
        here, there = found.getBestCmap()[ord(letter)], whole.getBestCmap()[ord(letter)]
        assert found["hmtx"][here][0] == whole["hmtx"][there][0]
        assert found["glyf"][here].numberOfContours == whole["glyf"][there].numberOfContours
    assert found["head"].unitsPerEm == whole["head"].unitsPerEm
    assert "kern" in {record.FeatureTag for record in found["GPOS"].table.FeatureList.FeatureRecord}
    assert "Bitstream" in found["name"].getDebugName(0)  # whom the glyphs are owed to


def test_rules_name_weight_and_slant():
    css = font_face({"still", "hook"}, FILES)
    rules = re.findall(r"font-weight:(\d+);font-style:(\w+);", css)
    assert rules == [("400", "normal"), ("700", "normal"), ("400", "oblique"), ("700", "oblique")]
    assert len({*re.findall(r"base64,([^)]*)\)", css)}) == len(FILES)


def test_characters_that_the_font_has_not_are_left_out():
    (found,) = fonts(font_face("a\u6df1\n"))
    assert {*found.getBestCmap()} == {ord("a")}


def test_the_same_characters_give_the_same_rules_in_every_process():
    script = f"from stillhook.text import font_face; print(font_face({WORDS!r}, {[*FILES]!r}))"
    run = subprocess.run(
        [sys.executable, "-c", script],
        env={"PYTHONHASHSEED": "7", "PYTHONUTF8": "1"},
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == font_face(sorted({*WORDS}, reverse=True), FILES)
