"""A report for clients: every figure of its pages leads to the file and the field it came from."""

from __future__ import annotations

import csv
import json
import math
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import pytest

import stillhook as sh
from models import InputError
from models.casefile import read_yaml
from stillhook.report.sources import value_at

CASE = "thesis-1975"
BLOCK = sh.TitleBlock(client="Lifting & Sons", project="<Template>", author="A. B.")
#: Names that have a digit in them and are no figures.
NAMES = ("a1", "a2", "SHA-256", "P''", "route 1", "route 2", "Route 1")


class Page(HTMLParser):
    """What stands in a page: its figures by id, and the words that are none."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.figures: dict[str, dict[str, str]] = {}
        self.heads: list[dict[str, str]] = []  # above the first chapter
        self.words: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.elements: list[str] = []
        self._open: list[str] = []
        self._figure: dict[str, str] | None = None
        self._quiet = 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.elements.append(tag)
        self.ids += [found["id"]] if "id" in found else []
        self.links += [v for k, v in attributes if k in ("src", "href", "xlink:href", "action")]
        if tag in ("meta", "link", "input", "br"):
            return
        quiet = tag in ("svg", "style", "pre", "code", "title") or found.get("class") in (
            "no",
            "origin",
        )
        self._open.append("quiet" if quiet or self._quiet else tag)
        self._quiet += self._open[-1] == "quiet"
        if tag == "data":
            self._figure = {"place": found["title"], "value": found.get("value", ""), "text": ""}
            self.heads += [] if "id" in found else [self._figure]
            if "id" in found:
                self.figures[found["id"]] = self._figure

    def handle_startendtag(self, tag, attributes):
        self.ids += [value for name, value in attributes if name == "id"]
        self.links += [v for k, v in attributes if k in ("src", "href", "xlink:href")]

    def handle_endtag(self, tag):
        if tag in ("meta", "link", "input", "br"):
            return
        self._quiet -= self._open.pop() == "quiet"
        if tag == "data":
            self._figure = None

    def handle_data(self, data):
        if self._figure is not None:
            self._figure["text"] += data
        elif not self._quiet:
            self.words.append(data)


@cache
def small_report() -> dict[str, bytes]:
    """Return the files of a report with a small study of each kind."""
    import tempfile

    case = sh.load_case(CASE)
    design = sh.evaluate_gains(case, case.gains or {"A": 200, "a": 50, "a1": 100, "a2": 100})
    study = sh.operability(design, periods=[7.0, 9.0], payload_rms="50 mm", scatter="example")
    with tempfile.TemporaryDirectory() as folder:
        sh.write_report(
            folder,
            design=design,
            operability=study,
            windows=sh.weather_windows(study, _seas(), "12h"),
            failures=sh.failure_modes(case, design, seeds=1, lasting=10.0, wait=70.0),
            runs=sh.simulate(case, design, seeds=2, duration="2 min"),
            held=sh.simulate(case, "none", seeds=2, duration="2 min"),
            sensitivity=sh.sensitivity(design, second=0),
            sweep=sh.sweep(design, samples=32),
            robustness=sh.robustness(design, {"payload.mass": 0.3}, draws=10),
            comparison=sh.compare(
                case, ["none", "feed-forward"], seeds=2, duration="1 min", jobs=1, traces=False
            ),
            block=BLOCK,
        )
        return contents(Path(folder))


def contents(folder: Path) -> dict[str, bytes]:
    every = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in every}


def _seas():
    from synth.operability import example_series

    return example_series()


@pytest.fixture(scope="module")
def files():
    return small_report()


@pytest.fixture(scope="module")
def page(files):
    return Page(files["report.html"].decode())


@pytest.fixture(scope="module")
def sources(files):
    own = json.loads(files["report.json"])
    case, design = (
        read_yaml(files[name].decode(), name)[0] for name in ("case.yaml", "design.yaml")
    )
    return {"report.json": own, "case.yaml": case, "design.yaml": design}


def test_every_figure_of_the_page_leads_to_the_field_it_came_from(page, sources):
    figures = sources["report.json"]["figures"]
    assert list(page.figures) == [figure["id"] for figure in figures]
    assert len(figures) > 500
    for figure in figures:
        shown = page.figures[figure["id"]]
        assert shown["text"] == figure["text"]
        assert shown["place"] == f"{figure['file']}#{figure['field']}"
        found = value_at(sources[figure["file"]], figure["field"])
        if shown["value"]:
            assert float(shown["value"]) == figure["value"]
            assert found == pytest.approx(figure["value"], rel=1e-12, abs=1e-300), figure
        elif isinstance(figure["value"], str):
            assert found == figure["value"]


def test_the_head_of_the_page_says_what_the_title_block_does(page, sources):
    assert len(page.heads) == 7
    for shown in page.heads:
        file, _, field = shown["place"].partition("#")
        assert value_at(sources[file], field) == shown["text"]


#: How a figure in SI is written, by its unit: by what its text has to be multiplied.
FACTORS = {
    "mm": 1e-3, "mm/s": 1e-3, "mm/s2": 1e-3, "ms": 1e-3, "kN": 1e3, "MN": 1e6, "kN m": 1e3,
    "kN/m": 1e3, "MN/m": 1e6, "kN s/m": 1e3, "kW": 1e3, "MW": 1e6, "t": 1e3, "t m2": 1e3,
    "rpm": 2.0 * math.pi / 60.0, "deg": math.pi / 180.0, "%": 1e-2,
}  # fmt: skip


def test_the_text_of_a_figure_says_its_value(sources):
    checked = 0
    for figure in sources["report.json"]["figures"]:
        form = re.fullmatch(r"(?:x )?(-?[\d.]+(?:e[+-]?\d+)?) ?([^\d]*)", figure["text"])
        value, unit = figure["value"], figure["unit"]
        if form is None or not unit or not isinstance(value, int | float):
            continue
        said = float(form[1]) * FACTORS.get(form[2], 1.0)
        if form[2] in FACTORS or form[2] == unit:
            assert said == pytest.approx(value, rel=6e-3, abs=1e-9), figure
            checked += 1
    assert checked > 200


def test_no_number_of_the_page_is_without_an_origin(page):
    text = " ".join(page.words)
    for name in NAMES:
        text = text.replace(name, "")
    text = re.sub(r"\[\d+\]", "", text)  # places in a list, of a field's name
    loose = [*re.finditer(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w])", text)]
    assert not loose, [text[max(0, m.start() - 40) : m.end() + 40] for m in loose]


def test_the_page_asks_for_nothing_and_its_ids_do_not_collide(page, files):
    assert not [link for link in page.links if not link.startswith(("#", "data:image/png;"))]
    assert not {"script", "iframe", "img", "link", "object"} & {*page.elements}
    assert "@import" not in files["report.html"].decode()
    ids = page.ids
    assert len(ids) == len({*ids})
    for target in {link[1:] for link in page.links if link[0] == "#"}:
        assert target in ids
    for target in re.findall(r"url\(#([^)]+)\)", files["report.html"].decode()):
        assert target in ids


def test_what_a_user_typed_is_shown_and_not_run(files, page):
    text = files["report.html"].decode()
    assert "<Template>" not in text
    assert "&lt;Template&gt;" in text
    assert "Lifting & Sons" in [shown["text"] for shown in page.heads]


def test_all_chapters_are_there_in_the_order_that_clients_know(page, sources):
    named = list(dict.fromkeys(f["chapter"] for f in sources["report.json"]["figures"]))
    assert named == [
        "Identification", "Summary", "Basis of design", "Vessel and sea", "System", "Design",
        "Stability", "Utilisation of limits", "Loads", "Robustness", "Operability", "Alternatives",
        "Energy and heat", "Failure modes", "Verification",
    ]  # fmt: skip
    words = " ".join(page.words)
    for term in ("DAF", "MPM", "significant double amplitude", "Residual motion", "hook load"):
        assert term in words
    assert "Not part of this issue" not in words


def test_the_summary_says_what_the_design_says(sources):
    own, design = sources["report.json"]["results"], sources["design.yaml"]
    assert own["motion"]["residual"] == pytest.approx(design["payload_rms"] / design["hook_rms"])
    assert own["motion"]["held"]["rms"] == pytest.approx(design["payload_rms_before"])
    (wanted,) = own["requirement"]
    assert wanted["bound"] == 0.05
    assert wanted["value"] == pytest.approx(design["payload_rms"])
    assert wanted["kept"] == (design["payload_rms"] <= 0.05)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("required", ["1 m", "1 mm"])
def test_a_design_that_misses_the_requirement_is_not_ok_for_the_client(tmp_path, required):
    case = sh.load_case(CASE).replace({"limits.max_sensitivity": 10.0})
    design = sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    assert design.ok
    sh.write_report(tmp_path, design=design, requirement={"payload_rms": required})
    told = json.loads((tmp_path / "report.json").read_text())["results"]["identification"]
    text = " ".join(Page((tmp_path / "report.html").read_text()).words)
    assert told["ok"] == (required == "1 m")
    assert ("NOT ok" in text) == (required == "1 mm")
    assert ("does not keep what is required: payload.rms" in told["status"]) == (required == "1 mm")


def test_the_digest_is_that_of_the_case(sources):
    own = sources["report.json"]["results"]
    assert own["identification"]["digest"] == sh.load_case(CASE).digest


def test_every_input_of_the_case_stands_in_the_basis_of_design(sources):
    figures = sources["report.json"]["figures"]
    shown = {f["field"] for f in figures if f["file"] == "case.yaml"}

    def leaves(tree, place=""):
        if isinstance(tree, dict):
            for name, item in tree.items():
                yield from leaves(item, f"{place}/{name}")
        elif isinstance(tree, list):
            for k, item in enumerate(tree):
                yield from leaves(item, f"{place}/{k}")
        else:
            yield place

    heads = ("/stillhook", "/name", "/description")
    assert {place for place in leaves(sources["case.yaml"]) if place not in heads} == shown


def test_both_forms_of_the_controller_are_the_one_that_is_simulated(sources):
    from synth.controllers import LinearFeedback

    case = sh.load_case(CASE)
    law = LinearFeedback(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    told = sources["report.json"]["results"]["controller"]
    assert told["continuous"] == [[-200.0 * 50.0, -200.0 * 100.0, -200.0 * 100.0]]
    assert told["discrete"] == told["continuous"]
    assert told["sample_time"] == law.sample_time
    assert [one["name"] for one in told["signals"]] == list(law.controller.measurements)


def test_every_table_lies_beside_the_page_as_data(files, sources):
    loads = files["tables/09-loads-1.csv"].decode().splitlines()
    heads = next(csv.reader(loads[:1]))
    assert len(heads) == 5
    rows = {row[0]: row[1:] for row in csv.reader(loads[1:])}
    told = sources["report.json"]["results"]["loads"]
    ends = [told[who][end] for who in ("held", "compensated") for end in ("hook_load", "drum")]
    found = [float(cell) for cell in rows["dynamic amplification factor (DAF)"]]
    assert found == [end["daf"] for end in ends]
    for name, content in files.items():
        if name.startswith("tables/"):
            lengths = {len(row) for row in csv.reader(content.decode().splitlines())}
            assert len(lengths) == 1, name


def test_every_failure_that_was_run_says_what_the_load_does(sources, page):
    told = sources["report.json"]["results"]["failures"]
    ran = [mode for mode in told["modes"] if mode["first"]]
    assert len(ran) > 3
    said = [shown["text"] for shown in page.figures.values()]
    for mode in ran:
        assert mode["effect"] in said


def test_the_pdf_is_the_same_document_twice(files):
    assert files["report.pdf"].startswith(b"%PDF-")


def design_of(bundled: str, **changes: object) -> sh.Design:
    case = sh.load_case(bundled)
    return sh.evaluate_gains(
        case.replace(changes) if changes else case, {"a": 5, "a1": 10, "a2": 10}
    )


@pytest.fixture
def quick(monkeypatch):
    """Draw nothing: that takes seconds, and is not what is asked."""
    from stillhook.report import document

    def nothing(drawing):
        raise InputError("nothing to draw")

    monkeypatch.setattr(document, "inline_svg", nothing)


@pytest.mark.usefixtures("quick")
def test_the_same_report_is_the_same_to_the_last_byte(tmp_path):
    block = sh.TitleBlock(date="2026-11-28")
    design = design_of(CASE)
    sh.write_report(tmp_path / "a", design=design, block=block)
    sh.write_report(tmp_path / "b", design=design, block=block)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


@pytest.mark.usefixtures("quick")
def test_a_second_case_writes_nothing_of_the_first(tmp_path):
    first, second = design_of(CASE), design_of(CASE, **{"name": "other", "rope.length": 1500.0})
    runs = sh.simulate(first.case, first, duration="40 s")
    sh.write_report(tmp_path / "a", design=first, runs=runs, block=BLOCK)
    before = contents(tmp_path / "a")
    with pytest.raises(InputError, match=r"holds the report of another case \(thesis-1975, "):
        sh.write_report(tmp_path / "a", design=second)
    assert contents(tmp_path / "a") == before
    sh.write_report(
        tmp_path / "a", design=second, force=True, block=sh.TitleBlock(date="2026-11-28")
    )
    sh.write_report(tmp_path / "b", design=second, block=sh.TitleBlock(date="2026-11-28"))
    assert [name for name in before if "energy" in name]
    assert contents(tmp_path / "a") | {".stillhook": b""} == contents(tmp_path / "b") | {
        ".stillhook": b""
    }
    for content in contents(tmp_path / "a").values():
        assert first.case.digest.encode() not in content
        assert b"Lifting" not in content


@pytest.mark.usefixtures("quick")
def test_without_typst_the_page_is_made_and_an_older_pdf_goes(tmp_path, monkeypatch):
    from stillhook.report import write

    design = design_of(CASE)
    names = {path.name for path in sh.write_report(tmp_path, design=design)}
    assert "report.pdf" in names
    monkeypatch.setattr(write, "can_typeset", lambda: False)
    names = {path.name for path in sh.write_report(tmp_path, design=design)}
    assert {"report.html", "report.json", "case.yaml", "design.yaml"} < names
    assert "report.pdf" not in names
    assert not (tmp_path / "report.pdf").exists()


@pytest.mark.usefixtures("quick")
def test_a_full_disk_leaves_whole_files_only(tmp_path, monkeypatch):
    folder = tmp_path / "out"
    sh.write_report(folder, design=design_of(CASE))
    before = contents(folder)
    write = Path.write_bytes

    def full(path, data):
        if "report.html" in path.name:
            write(path, data[: len(data) // 2])
            raise OSError(28, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"report\.html: cannot be written: No space left"):
        sh.write_report(folder, design=design_of(CASE))
    assert contents(folder)["report.html"] == before["report.html"]


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("gains", "said"),
    [
        ({"a": -5, "a1": -10, "a2": -10}, "There is no stable loop"),
        ({"a": 0, "a1": 0, "a2": 0}, "The design is NOT ok"),
    ],
)
def test_a_design_that_is_none_has_a_report_that_says_so(tmp_path, gains, said):
    sh.write_report(tmp_path, design=sh.evaluate_gains(sh.load_case(CASE), gains))
    page = Page((tmp_path / "report.html").read_text())
    assert said in " ".join(page.words)
    assert "NOT ok" in page.words


@pytest.mark.ci
@pytest.mark.usefixtures("quick")
def test_a_controller_of_many_states_stands_in_the_data(tmp_path):
    design = sh.optimise_gains(sh.load_case(CASE), "high-order", starts=1)
    sh.write_report(tmp_path, design=design, bound=False)
    told = json.loads((tmp_path / "report.json").read_text())["results"]["controller"]
    assert told["states"] > 12
    assert len(told["continuous"]) == told["states"] + 1
    assert "its matrices stand in report.json" in " ".join(
        Page((tmp_path / "report.html").read_text()).words
    )
    assert (tmp_path / "report.pdf").exists()


def test_long_names_may_break_in_the_pdf_and_numbers_may_not():
    from stillhook.report.pages import _breakable

    part = {"kind": "words", "parts": [{"text": f"rope.length 1.25 {'0123456789abcdef' * 2}"}]}
    (found,) = _breakable(part)["parts"]
    assert found["text"].split("\u200b") == [
        "rope.", "length 1.25 0123456789abcdef", "0123456789abcdef"
    ]  # fmt: skip
    listing = {"kind": "listing", "text": "rope.length"}
    assert _breakable(listing) == listing


def test_studies_of_another_case_are_refused(tmp_path):
    design, other = design_of(CASE), design_of(CASE, **{"rope.length": 1500.0})
    study = sh.sweep(other, samples=4)
    with pytest.raises(InputError, match=r"the sweep is of another case \(thesis-1975, "):
        sh.write_report(tmp_path / "out", design=design, sweep=study)
    runs = sh.simulate(other.case, "none", duration="20 s")
    with pytest.raises(InputError, match="the simulation with the drum held is of another case"):
        sh.write_report(tmp_path / "out", design=design, held=runs)
    assert not (tmp_path / "out").exists()


def test_a_design_without_a_controller_is_refused(tmp_path):
    from dataclasses import replace

    none = replace(design_of(CASE), parameters={}, status="nothing was found")
    with pytest.raises(InputError, match=r"^report: the design has no controller: nothing was"):
        sh.write_report(tmp_path, design=none)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (
            {"payload_rsm": 1.0},
            "report: requirement: there is no 'payload_rsm'; there are payload_rms",
        ),
        ({"payload_rms": "5 kg"}, "operability: payload_rms: "),
        ({"payload_rms": -1.0}, "payload_rms must be above 0"),
    ],
)
def test_a_requirement_that_is_none_is_told(tmp_path, wanted, message):
    with pytest.raises(InputError, match=message):
        sh.write_report(tmp_path / "out", design=design_of(CASE), requirement=wanted)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "text", ["A", "A; 2026-11-28", "A; yesterday; issued", "; 2026-11-28; x", "A;B;C;D;E;F;G"]
)
def test_a_revision_that_is_none_is_told(text):
    with pytest.raises(
        InputError, match=r"report: (a revision must be|the date of a revision must)"
    ):
        sh.Revision.read(text)
