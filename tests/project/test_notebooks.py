"""Every notebook runs from start to end without a warning, and is what its text twin says.

The twin, a `.py` of the same name in jupytext's percent format, is the one to edit and to review:

    jupytext --to ipynb notebooks/01-thesis-1975.py
"""

from __future__ import annotations

from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
SECONDS = 300  # where a run is given up; a quiet machine takes a tenth of it
# Figures that each notebook has to show.
FIGURES = {
    "01-thesis-1975": 9,
    "02-saturation": 5,
    "03-mpc-versus-linear": 5,
    "04-robustness-and-operability": 3,
}


def read(path):
    import nbformat

    return nbformat.read(path, as_version=4)


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} == set(FIGURES)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_without_outputs(path):
    for cell in read(path).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_agrees_with_its_text(path):
    jupytext = pytest.importorskip("jupytext")
    text = jupytext.read(path.with_suffix(".py"))
    stored = [(cell.cell_type, cell.source) for cell in read(path).cells]
    assert stored == [(cell.cell_type, cell.source) for cell in text.cells]


@pytest.mark.ci
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs_without_a_warning(path):
    pytest.importorskip("ipykernel")
    nbclient = pytest.importorskip("nbclient")
    from nbformat.v4 import new_code_cell

    notebook = read(path)
    strict = new_code_cell("import warnings\nwarnings.simplefilter('error')")
    lenient = new_code_cell("warnings.simplefilter('ignore')")  # the kernel's own, on its way out
    notebook.cells = [strict, *notebook.cells, lenient]
    client = nbclient.NotebookClient(
        notebook,
        timeout=SECONDS,
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()  # raises CellExecutionError with the cell's traceback
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    said = [output.text for output in outputs if output.get("name") == "stderr"]
    assert said == []
    figures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(figures) == FIGURES[path.stem]
