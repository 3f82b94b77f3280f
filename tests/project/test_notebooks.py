"""Every notebook runs from start to end without a warning, and is what its text twin says.

The twin, a `.py` of the same name in jupytext's percent format, is the one to edit and to review:

    jupytext --to ipynb notebooks/01-thesis-1975.py
"""

from __future__ import annotations

import ast
import base64
import importlib
import os
import re
from pathlib import Path

import notebook_pages as pages
import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
TWINS = [path.with_suffix(".py") for path in NOTEBOOKS]
SECONDS = 300  # where a run is given up; a quiet machine takes a tenth of it
# Figures that each notebook has to show.
FIGURES = {
    "00-ten-lines": 1,
    "01-thesis-1975": 10,
    "02-saturation": 5,
    "03-mpc-versus-linear": 4,
    "04-robustness-and-operability": 4,
    "05-vessel-of-your-own": 3,
    "06-plant-of-your-own": 3,
    "07-export": 2,
}
# What a notebook may import: the faces of the four packages, public libraries of the field, ...
FACES = {"stillhook", "synth", "mpc", "models"}
LIBRARIES = {"IPython", "fmpy", "matplotlib", "numpy", "pandas", "scipy"}
STANDARD = {"dataclasses", "json", "math", "pathlib", "shutil", "subprocess", "sys", "tempfile"}
# ... teaching code that lies beside it, and the stored studies that it shows.
HELPERS = {path.stem for path in FOLDER.glob("*.py") if path not in TWINS}
STUDIES = {"headline", "headline_page", "saturation"}
# A number of prose that has to have been computed: with a unit, a per cent sign or decimals.
NUMBER = re.compile(r"(?<![\w.^/])(\d+(?:\.\d+)?)(?=(?P<after>.{0,9}))", re.DOTALL)
UNIT = re.compile(
    r"\s?(kN m|N s/m|mm|cm|ms|s|m|rad/s|kN|rpm|t|1/s|V|min|s⁻²|kW|m²)(?![\w'])|\s?[%°]"
)
VALUE = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def read(path):
    import nbformat

    return nbformat.read(path, as_version=4)


def by_name(path):
    return path.stem


def imports(path):
    """Return what a notebook imports: (module, name), name None for a whole module."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [(node.module, alias.name) for alias in node.names]
    return found


def executed(path):
    """Return a notebook as it runs with warnings as errors."""
    nbclient = pytest.importorskip("nbclient")
    from nbformat.v4 import new_code_cell

    notebook = read(path)
    quiet = "import os, warnings\nos.environ['STILLHOOK_PROGRESS'] = '0'"  # as for the pages
    strict = new_code_cell(f"{quiet}\nwarnings.simplefilter('error')")
    lenient = new_code_cell("warnings.simplefilter('ignore')")  # the kernel's own, on its way out
    notebook.cells = [strict, *notebook.cells, lenient]
    client = nbclient.NotebookClient(
        notebook,
        timeout=SECONDS,
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()  # raises CellExecutionError with the cell's traceback
    notebook.cells = notebook.cells[1:-1]
    return notebook


def texts(output):
    """Return what an output says in words."""
    data = output.get("data", {})
    return [output.get("text", ""), data.get("text/markdown", "") or data.get("text/plain", "")]


def untold(notebook):
    """Return the numbers of the prose, with their surroundings, that no cell gives or prints."""
    said = []
    for cell in notebook.cells:
        if cell.cell_type == "code":
            said += [cell.source, *(text for output in cell.outputs for text in texts(output))]
    known = [float(text) for text in VALUE.findall("\n".join(said).replace("_", ""))]
    missing = []
    for cell in notebook.cells:
        if cell.cell_type != "markdown":
            continue
        for match in NUMBER.finditer(cell.source):
            number = match[1]
            if "." not in number and not UNIT.match(match["after"]):
                continue
            close = 0.5 * 10.0 ** -len(number.partition(".")[2]) + 1e-12
            if not any(abs(value - float(number)) <= close for value in known):
                missing.append(cell.source[max(0, match.start() - 30) : match.end() + 12])
    return missing


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} == set(FIGURES)


def test_they_are_numbered_in_reading_order():
    assert [path.name[:2] for path in NOTEBOOKS] == [f"{n:02d}" for n in range(len(NOTEBOOKS))]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_stored_without_outputs(path):
    for cell in read(path).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_agrees_with_its_text(path):
    jupytext = pytest.importorskip("jupytext")
    text = jupytext.read(path.with_suffix(".py"))
    assert [told(cell) for cell in read(path).cells] == [told(cell) for cell in text.cells]


def told(cell):
    return cell.cell_type, cell.source, cell.metadata.get("tags", [])


@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_begins_with_a_goal_and_ends_with_where_to_go(path):
    first, *_, last = read(path).cells
    assert first.cell_type == last.cell_type == "markdown"
    assert first.source.startswith("# ")
    assert "## Where to go next" in last.source


@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_links_lead_to_notebooks_and_pages(path):
    for cell in read(path).cells:
        if cell.cell_type == "markdown":
            for target in re.findall(r"\]\(([^)#:]+)\)", cell.source):
                assert (FOLDER / target).exists(), target


@pytest.mark.parametrize("path", TWINS, ids=by_name)
def test_uses_public_names_only(path):
    allowed = FACES | LIBRARIES | STANDARD | HELPERS | STUDIES
    for module, name in imports(path):
        package = module.split(".")[0]
        assert package in allowed, f"{module} is no public name"
        if package in FACES:
            assert module == package, f"{module} is a room: import from {package}"
            assert name is None or name in importlib.import_module(module).__all__


@pytest.mark.parametrize("path", TWINS, ids=by_name)
def test_reaches_for_nothing_private(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute):
            assert not node.attr.startswith("_") or node.attr.startswith("__"), node.attr


@pytest.mark.ci
@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_runs_without_a_warning_and_prints_what_it_says(path):
    pytest.importorskip("ipykernel")
    notebook = executed(path)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    said = [output.text for output in outputs if output.get("name") == "stderr"]
    assert said == []
    figures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(figures) == FIGURES[path.stem]
    early = [output for cell in notebook.cells[:2] for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in early), "a picture comes first"
    assert untold(notebook) == []


def code_cell(source, outputs=(), **metadata):
    from nbformat.v4 import new_code_cell

    return new_code_cell(source, outputs=list(outputs), metadata=metadata)


def notebook_of(*cells):
    from nbformat.v4 import new_notebook

    return new_notebook(cells=list(cells))


def printed(text):
    from nbformat.v4 import new_output

    return new_output("stream", name="stdout", text=text)


def test_prose_may_round_but_not_invent():
    from nbformat.v4 import new_markdown_cell

    cells = [code_cell("case.f(7)", [printed("margin 25.66 ms, 0.0919")])]
    good = new_markdown_cell("It survives 25.7 ms, and 26 ms, down to 0.092, of 7 m; chapter 4.")
    assert untold(notebook_of(good, *cells)) == []
    bad = new_markdown_cell("It survives 24.1 ms, or 8 %.")
    assert len(untold(notebook_of(bad, *cells))) == 2


def test_a_page_holds_code_text_tables_and_pictures():
    from nbformat.v4 import new_markdown_cell, new_output

    png = base64.b64encode(b"picture").decode()
    notebook = notebook_of(
        new_markdown_cell(
            "# Title\n\nSee [the next](01-thesis-1975.ipynb), [page](../docs/mpc.md)."
        ),
        code_cell(
            '%matplotlib inline\nax.set_title("A figure of $H_s$")',
            [
                printed("one\n"),
                printed("\x1b[31mtwo\x1b[0m\n"),
                new_output("display_data", data={"image/png": png, "text/plain": "<Figure>"}),
            ],
        ),
        code_cell(
            "say(f'{x}')",
            [new_output("execute_result", data={"text/markdown": "It is **4**."})],
            tags=["hide-input"],
        ),
        code_cell("table", [new_output("execute_result", data={"text/plain": "`a`"})]),
    )
    saved = {}
    text = pages.page("00-name", notebook, saved.__setitem__)
    assert saved == {"00-name-1.png": b"picture"}
    assert "[the next](01-thesis-1975.md), [page](../mpc.md)" in text
    assert "```text\none\ntwo\n```" in text
    assert "![A figure of H_s](images/00-name-1.png)" in text
    assert "It is **4**." in text
    assert "say(" not in text
    assert "%matplotlib" not in text


def test_a_page_is_written_anew_when_what_it_rests_on_has_changed(tmp_path, monkeypatch):
    monkeypatch.setattr(pages, "NOTEBOOKS", tmp_path / "notebooks")
    monkeypatch.setattr(pages, "PAGES", tmp_path / "pages")
    monkeypatch.setattr(pages, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "models").mkdir()
    (tmp_path / "constraints.txt").write_text("numpy==2\n")
    code = tmp_path / "models" / "sea.py"
    code.write_text("a = 1\n")
    path = tmp_path / "notebooks" / "00-one.ipynb"
    path.write_text("{}")
    runs = []

    def execute(path):
        runs.append(path.stem)
        return notebook_of(code_cell("1"))

    monkeypatch.setattr(pages, "execute", execute)
    assert pages.main([]) == 0
    assert (tmp_path / "pages" / "00-one.md").exists()
    pages.main([])
    assert runs == ["00-one"]
    code.write_text("a = 2\n")
    pages.main([])
    path.write_text("{ }")
    os.utime(path)
    pages.main([])
    assert runs == ["00-one"] * 3
    pages.main(["--all"])
    assert runs == ["00-one"] * 4
    path.unlink()
    pages.main([])
    assert not (tmp_path / "pages" / "00-one.md").exists()


def test_the_index_lists_every_notebook():
    index = (Path(__file__).parents[2] / "docs" / "notebooks" / "index.md").read_text("utf-8")
    toctree = index.partition("```{toctree}")[2].split()
    assert [name for name in toctree if name[:2].isdigit()] == [path.stem for path in NOTEBOOKS]
    for path in NOTEBOOKS:
        assert f"({path.stem}.md)" in index
