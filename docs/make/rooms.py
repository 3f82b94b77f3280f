"""The map of the code: every room with what it is for, in CONTRIBUTING.md, and as a drawing.

    python docs/make/rooms.py            # CONTRIBUTING.md and docs/images/rooms.svg
    python docs/make/rooms.py --quick    # the same into out/quick

The order of the rooms is that of the import contracts in pyproject.toml, what a room is for is the
first line of its face.  A test holds the map against both.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from stored import ROOT, docs_folder, study_parser

GUIDE = ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- rooms: begin -->", "<!-- rooms: end -->"
PACKAGES = ("models", "synth", "mpc", "stillhook")


@dataclass(frozen=True, kw_only=True)
class Room:
    """A folder of the product: its path, its purpose, how many files and lines it has."""

    path: str
    purpose: str
    files: int
    lines: int


def purpose_of(face: Path) -> str:
    """Return the first sentence of a package's docstring."""
    doc = ast.get_docstring(ast.parse(face.read_text(encoding="utf-8"))) or ""
    return " ".join(doc.partition("\n\n")[0].split()).removesuffix(".")


def order_of(package: str) -> list[str]:
    """Return the rooms of a package, bottom to top, by its contract."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for contract in project["tool"]["importlinter"]["contracts"]:
        if contract["type"] == "layers" and contract.get("containers") == [package]:
            return [name for name in reversed(contract["layers"]) if name != "cli"]
    raise ValueError(f"pyproject.toml has no layers of {package}")


def room_at(folder: Path) -> Room:
    """Return one room; its sub-rooms are rooms of their own."""
    files = [path for path in folder.glob("*.py") if path.name != "__init__.py"]
    texts = [path.read_text(encoding="utf-8") for path in (*files, folder / "__init__.py")]
    return Room(
        path=folder.relative_to(ROOT).as_posix(),
        purpose=purpose_of(folder / "__init__.py"),
        files=len(files),
        lines=sum(len(text.splitlines()) for text in texts),
    )


def rooms(package: str) -> Iterator[Room]:
    """Give the rooms of a package, bottom to top, each before its sub-rooms."""
    for name in order_of(package):
        folder = ROOT / package / name
        yield room_at(folder)
        for face in sorted(folder.glob("*/__init__.py")):
            yield room_at(face.parent)


def table() -> str:
    """Return the map as Markdown: a table for each package, bottom to top."""
    parts = []
    for package in PACKAGES:
        parts += [
            f"| `{package}` | {purpose_of(ROOT / package / '__init__.py')} |",
            "| --- | --- |",
        ]
        parts += [f"| `{room.path}` | {room.purpose} |" for room in rooms(package)]
        parts.append("")
    return "\n".join(parts).rstrip()


def written_into(text: str) -> str:
    """Return the guide with today's map between its two marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


def drawing(kind: str = "svg") -> bytes:
    """Return the rooms as a picture: what stands higher, or further right, imports from below."""
    from matplotlib.patches import FancyBboxPatch

    from stillhook.text import AFTER, BEFORE, DRUM, REFERENCE, new_figure, picture, styled

    colours = dict(zip(PACKAGES, (DRUM, AFTER, BEFORE, REFERENCE), strict=True))
    at = {"models": (0.0, 0.0), "synth": (0.0, 6.7), "mpc": (7.0, 6.7), "stillhook": (0.0, 15.1)}
    wide = {"models": 5, "synth": 4, "mpc": 2, "stillhook": 5}
    with styled():
        sheet = new_figure(9.6, 8.0)
        axes = sheet.subplots()
        axes.set(xlim=(-0.4, 11.4), ylim=(-0.5, 19.7))
        axes.axis("off")
        for package in PACKAGES:
            x0, y0 = at[package]
            colour, columns = colours[package], wide[package]
            found = list(rooms(package))
            shown = [room for room in found if room.path.count("/") == 1]
            width = (11.0 if columns == 5 else 6.4 if columns == 4 else 4.0) / columns
            high = -(-len(shown) // columns)
            axes.add_patch(
                FancyBboxPatch(
                    (x0 - 0.15, y0 - 0.2),
                    width * columns + 0.3 - 0.1,
                    high * 1.7 + 0.9,
                    boxstyle="round,pad=0.05,rounding_size=0.2",
                    facecolor=colour,
                    alpha=0.10,
                    linewidth=0.0,
                )
            )
            axes.text(x0, y0 + high * 1.7 + 0.2, package, fontsize=12, weight="bold", color=colour)
            for k, room in enumerate(shown):
                row, column = divmod(k, columns)
                x, y = x0 + column * width, y0 + row * 1.7
                axes.add_patch(
                    FancyBboxPatch(
                        (x + 0.05, y + 0.1),
                        width - 0.2,
                        1.3,
                        boxstyle="round,pad=0.02,rounding_size=0.12",
                        facecolor="white",
                        edgecolor=colour,
                        linewidth=1.0,
                    )
                )
                name = room.path.rpartition("/")[2]
                axes.text(x + width / 2 - 0.05, y + 0.9, name, ha="center", va="center", fontsize=9)
                inside = [r for r in found if f"{r.path}/".startswith(f"{room.path}/")]
                files, lines = sum(r.files for r in inside), sum(r.lines for r in inside)
                told = f"{files} files, {lines / 1000:.1f} k lines"
                axes.text(
                    x + width / 2 - 0.05, y + 0.42, told, ha="center", va="center", fontsize=6.5,
                    color="#555555",
                )  # fmt: skip
        return picture(sheet, kind)


def main() -> None:
    """Write the map and the drawing."""
    quick = study_parser(__doc__).parse_args().quick
    docs = docs_folder(quick)
    guide = docs / GUIDE.name if quick else GUIDE
    guide.write_text(written_into(GUIDE.read_text(encoding="utf-8")), encoding="utf-8")
    (docs / "images" / "rooms.svg").write_bytes(drawing())
    print(f"written: {guide}, {docs / 'images' / 'rooms.svg'}")


if __name__ == "__main__":
    main()
