"""One table, four forms: the same figures on the terminal, in Markdown, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math

import pytest
from shown import terminal_text

from models import InputError
from stillhook.text import (
    Bar,
    Drawing,
    OutputFolder,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    csv_text,
    json_data,
    json_text,
    markdown,
)

TABLE = Table(
    columns=columns("limit; rms [m]; use; note <; empty"),
    rows=[
        ("torque | peak", 0.01234, Bar(0.5), "kept", None),
        ("speed", math.nan, Bar(1.2, kept=False), "broken", None),
        ("delay", Written(math.inf, "no bound"), Bar(0.0, enforced=False), "", None),
    ],
    notes=("use: of the limit",),
    marked=(1,),
)
REPORT = Report(
    name="crane",
    about="a trial",
    status="stable",
    ok=False,
    sections=[
        ReportSection("Limits", [TABLE, "all in H_s 2 m"]),
        ReportSection("", [Drawing("curve", "The curve", lambda: pytest.fail("drawn"))]),
    ],
)


def test_cells_are_written_in_the_unit_that_suits_them():
    assert TABLE.cells(0) == ["torque | peak", "12.3 mm", "50.0 %", "kept", ""]
    assert TABLE.cells(1) == ["speed *", "", "120 %", "broken", ""]
    assert TABLE.cells(2)[1] == "no bound"


def test_the_terminal_leaves_out_what_is_empty_and_shows_shares_as_bars():
    text = terminal_text(REPORT)
    assert text.startswith("crane: a trial\nNOT OK: stable\n")
    assert "empty" not in text
    assert "█████░░░░░ 50.0 %" in text
    assert "█████████▶  120 %" in text
    assert "  use: of the limit" in text
    assert max(map(len, text.splitlines())) <= 80


def test_a_narrow_terminal_breaks_labels_and_cuts_no_figure():
    text = terminal_text(
        Table(
            columns=columns("limit; value [W]; bound [W]"),
            rows=[("motor power, peak, with noise", 1.19994e6, 1.2e6)],
        ),
        width=32,
    )
    assert "1.20 MW" in text
    assert "…" not in text
    assert {"motor", "power,", "peak,", "noise"} <= set(text.split())


def test_markdown_escapes_bars_and_shows_the_figures_that_were_drawn():
    text = markdown(REPORT)
    assert "| torque \\| peak | 12.3 mm | 50.0 % | kept |  |" in text
    assert "**Not ok**: stable." in text
    assert "All in H_s 2 m." in text
    assert "![The curve](curve.svg)" in text
    assert "curve.svg" not in markdown(REPORT, drawn=[])


def test_csv_holds_every_digit_in_si_units():
    head, *rows = csv.reader(io.StringIO(csv_text(TABLE)))
    assert head == ["limit", "rms [m]", "use", "note", "empty"]
    assert float(rows[0][1]) == 0.01234
    assert rows[2][1:3] == ["inf", "0.0"]


def test_json_has_stable_names_and_no_nan():
    data = json.loads(json_text(REPORT))
    assert data == json_data(REPORT)
    assert {k: data[k] for k in ("name", "ok", "status")} == {
        "name": "crane",
        "ok": False,
        "status": "stable",
    }
    table, sentence = data["sections"][0]["items"]
    assert sentence == "all in H_s 2 m"
    assert table["columns"][1] == {"name": "rms", "label": "rms", "unit": "m"}
    assert [row["rms"] for row in table["rows"]] == [0.01234, None, None]
    assert [row["use"] for row in table["rows"]] == [0.5, 1.2, 0.0]
    assert data["sections"][1]["items"] == [{"figure": "curve", "caption": "The curve"}]


def test_long_tables_are_thinned_but_for_what_is_marked():
    rows = [(k,) for k in range(100)]
    table = Table(columns=columns("k"), rows=rows, marked=(37,), most=10)
    assert table.shown == sorted([*range(0, 100, 10), 37])
    assert len(csv_text(table).splitlines()) == 101


def test_a_figure_that_cannot_be_drawn_takes_an_older_one_away(tmp_path):
    def nothing():
        raise InputError("there is nothing to show")

    OutputFolder.prepare(tmp_path).write("curve.svg", "")
    assert OutputFolder.prepare(tmp_path).draw([Drawing("curve", "", nothing)]) == []
    assert [path.name for path in tmp_path.iterdir()] == [".stillhook"]
