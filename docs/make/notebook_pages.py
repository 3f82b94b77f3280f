"""The notebooks as pages of the documentation, executed: `make docs` runs this before Sphinx.

    notebooks/NN-name.ipynb --> run in a kernel --> docs/notebooks/NN-name.md, images/NN-name-K.png

    python docs/make/notebook_pages.py

The notebooks themselves are stored without outputs.  A page and its pictures are not stored at all
(git ignores them): each is written anew when the notebook, a helper beside it, the toolkit or a
stored study has changed, which its digest in `docs/_build/notebooks` says, and is otherwise left as
it is.

myst-nb would do the half of this.  It keeps results by the cells' text alone, so that a change of
the toolkit would leave old figures on the site, and brings a data base for it.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"
PAGES = ROOT / "docs" / "notebooks"
KEPT = ROOT / "docs" / "_build" / "notebooks"
PACKAGES = ("models", "synth", "mpc", "stillhook")
SECONDS = 600  # where a cell is given up
HIDDEN = "hide-input"  # tag of a cell of which the output alone is shown
COLOURS = re.compile(r"\x1b\[[0-9;]*m")
MAGIC = re.compile(r"^%.*\n?", re.MULTILINE)
TITLE = re.compile(r"title=\"([^\"]+)\"|title\(\"([^\"]+)\"")
LINK = re.compile(r"\]\((\d\d-[\w-]+)\.ipynb")


def sources() -> list[Path]:
    """Return the notebooks, in reading order."""
    return sorted(NOTEBOOKS.glob("[0-9][0-9]-*.ipynb"))


def code_digest() -> str:
    """Return a digest of all that a notebook may rest on besides itself."""
    folders = [ROOT / name for name in PACKAGES]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    files += [*(NOTEBOOKS.glob("*.py")), *(ROOT / "docs" / "make").glob("*.py")]
    files += [*(ROOT / "docs" / "data").glob("*"), ROOT / "constraints.txt"]
    found = hashlib.sha256()
    for path in sorted(files):
        if "__pycache__" in path.parts or re.match(r"\d\d-", path.name):
            continue
        found.update(str(path.relative_to(ROOT)).encode())
        found.update(path.read_bytes())
    return found.hexdigest()


def digest(path: Path, code: str) -> str:
    """Return the digest of a notebook on some code."""
    return hashlib.sha256(path.read_bytes() + code.encode()).hexdigest()


def execute(path: Path) -> Any:
    """Return a notebook with its outputs.

    Raises nbclient's CellExecutionError with the cell's traceback.
    """
    import nbclient
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(path.parent)}}
    os.environ["STILLHOOK_PROGRESS"] = "0"  # a page has no use for bars
    nbclient.NotebookClient(
        notebook, timeout=SECONDS, kernel_name="python3", resources=where
    ).execute()
    return notebook


def page(name: str, notebook: Any, save: Callable[[str, bytes], None]) -> str:
    """Return the page of an executed notebook; `save` is handed each picture by its file name."""
    parts: list[str] = []
    pictures = 0
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(LINK.sub(r"](\1.md", cell.source).replace("](../docs/", "](../"))
            continue
        code = MAGIC.sub("", cell.source).strip()
        if code and HIDDEN not in cell.metadata.get("tags", ()):
            parts.append(fenced(code, "python"))
        titles = iter([a or b for a, b in TITLE.findall(code)])
        for output in joined(cell.outputs):
            data = output.get("data", {})
            if output.output_type == "stream":
                parts.append(fenced(output.text, "text"))
            elif "image/png" in data:
                pictures += 1
                file = f"{name}-{pictures}.png"
                save(file, base64.b64decode(data["image/png"]))
                parts.append(f"![{alternative(next(titles, ''), name)}](images/{file})")
            elif "text/markdown" in data:
                parts.append(str(data["text/markdown"]))
            elif "text/html" in data:
                parts.append(f"```{{raw}} html\n{data['text/html']}\n```")
            elif "text/plain" in data:
                parts.append(fenced(data["text/plain"], "text"))
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def joined(outputs: list[Any]) -> Iterator[Any]:
    """Yield outputs, what was printed in one go as one; a kernel hands it over in pieces."""
    pending = None
    for output in outputs:
        if output.output_type == "stream" and pending and pending.name == output.name:
            pending.text += output.text
            continue
        if pending:
            yield pending
        pending = output if output.output_type == "stream" else None
        if pending is None:
            yield output
    if pending:
        yield pending


def alternative(title: str, name: str) -> str:
    """Return the text that stands for a picture."""
    return re.sub(r"[$\[\]\\]|\{.*?\}", "", title) or f"Figure of the notebook {name}"


def fenced(text: str, language: str) -> str:
    """Return a block of code or of what was printed."""
    text = COLOURS.sub("", text).strip("\n")
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return f"{fence}{language}\n{text}\n{fence}"


def write(path: Path, notebook: Any) -> None:
    """Write page and pictures of an executed notebook, what was there before removed."""
    images = PAGES / "images"
    images.mkdir(parents=True, exist_ok=True)
    for old in images.glob(f"{path.stem}-*.png"):
        old.unlink()
    text = page(path.stem, notebook, lambda file, data: _put(images / file, data))
    (PAGES / f"{path.stem}.md").write_text(text, encoding="utf-8")


def _put(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def stale(paths: list[Path]) -> Mapping[Path, str]:
    """Return the notebooks whose page is not of this notebook and this code, with digests."""
    code = code_digest()
    wanted = {path: digest(path, code) for path in paths}
    return {path: now for path, now in wanted.items() if not is_current(path, now)}


def is_current(path: Path, now: str) -> bool:
    """Return whether a page stands, and was made of what the digest says."""
    note = KEPT / f"{path.stem}.sha256"
    there = (PAGES / f"{path.stem}.md").exists() and note.exists()
    return there and note.read_text(encoding="utf-8").strip() == now


def timed(path: Path) -> tuple[Any, float]:
    """Return a notebook with its outputs, and how long they took [s]."""
    begun = time.perf_counter()
    return execute(path), time.perf_counter() - begun


def main(arguments: list[str] | None = None) -> int:
    """Execute what has changed, and write its pages."""
    parser = argparse.ArgumentParser(description="Write the notebooks' pages, executed.")
    parser.add_argument("--all", action="store_true", help="whether anything changed or not")
    parser.add_argument("--quick", action="store_true", help="the first notebook alone")
    parser.add_argument("--jobs", type=int, default=2, help="notebooks at a time")
    asked = parser.parse_args(arguments)
    paths = sources()
    known = {path.stem for path in paths}
    for page_file in PAGES.glob("[0-9][0-9]-*.md"):
        if page_file.stem not in known:  # of a notebook that is gone
            page_file.unlink()
    paths = paths[:1] if asked.quick else paths
    code = code_digest()
    changed = {path: digest(path, code) for path in paths} if asked.all else stale(paths)
    KEPT.mkdir(parents=True, exist_ok=True)
    # A kernel is a process of its own: two threads, each waiting for one, use two cores.
    with ThreadPoolExecutor(max_workers=asked.jobs) as pool:
        for path, (notebook, seconds) in zip(changed, pool.map(timed, changed), strict=True):
            write(path, notebook)
            (KEPT / f"{path.stem}.sha256").write_text(changed[path] + "\n", encoding="utf-8")
            print(f"{path.stem}: {seconds:.0f} s", flush=True)
    print(f"{len(paths)} notebooks, {len(changed)} executed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
