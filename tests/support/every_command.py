"""Every command with a small question, and a program that asks them all in one process.

`RECORD` runs `LINES` and keeps what they would print, unrendered; `REPLAY` prints it in the
encoding that its standard output has, on terminals of several widths.
"""

from __future__ import annotations

#: A case whose name few encodings can hold is in odd.yaml.
LINES = (
    "optimise thesis-1975 --structure payload-feedback --starts 1 --no-bound",
    "structures thesis-1975 --structures payload-feedback --starts 1 --no-bound",
    "evaluate odd.yaml --no-bound --out out/odd",
    "robust thesis-1975 --vary payload.mass=30t..40t --starts 1 --draws 20",
    "margins thesis-1975 --draws 10",
    "sensitivity thesis-1975 --second 0",
    "operability thesis-1975 --tp 8 --payload-rms '1 m'",
    "pareto thesis-1975 --points 2",
    "size thesis-1975 --target '150 mm' --hs '1 m' --gear 22..30 --points 3 --starts 1",
    "worth thesis-1975 --starts 1",
    "simulate thesis-1975 --duration '20 s'",
    "compare thesis-1975 --controllers none,thesis --seeds 1 --duration '20 s' --jobs 2",
    "compare thesis-1975 --list",
    "sweep thesis-1975 --samples 16",
    "sweep thesis-1975 --mode time --samples 2 --duration '20 s' --jobs 2 --out out/time",
    "sweep thesis-1975 --mode time --samples 2 --duration '20 s' --cluster local:1 --out out/dask",
    "report thesis-1975 --without comparison,operability,robustness,sweep,failures,simulation "
    "--no-bound",
    "export thesis-1975 --to c,st",
    "scenarios",
    "bound thesis-1975",
    "sea thesis-1975",
    "motion thesis-1975 --tp 8",
    "vessel import osv-83m",
    "vessel hull --shape box --length 80 --beam 20 --draught 4 --kg 4 --panels 60 --count 4 "
    "--heading-step 90 --no-lid --no-cache --threads 1",
    "vessel list",
    "check odd.yaml",
    "cases",
    "new my.yaml",
    "schema",
    "completion bash",
)

RECORD = """
import shlex, sys
from dataclasses import replace
import cloudpickle
from stillhook.text import encoding, terminal
from stillhook.text.table import Drawing, Report

said = []

class Recorder:
    encoding, is_terminal, width = "utf-8", False, 80
    def print(self, *objects, **how):
        said.append(("print", objects, how))

def shown(item, out):
    if isinstance(item, Report):
        parts = [replace(s, items=[i for i in s.items if not isinstance(i, Drawing)])
                 for s in item.sections]
        item = replace(item, sections=parts)
    said.append(("show", item, None))

console = terminal.console
terminal.console = lambda *, stderr=False: console(stderr=True) if stderr else Recorder()
terminal.show = shown
terminal.commands = lambda rows, out: said.append(("commands", list(rows), None))
encoding.write_json = lambda text: said.append(("json", text, None))

from stillhook.cli import main

if __name__ == "__main__":
    statuses = [main(shlex.split(line)) for line in sys.argv[2:]]
    with open(sys.argv[1], "wb") as file:
        cloudpickle.dump((statuses, said), file)
"""

REPLAY = """
import os, sys
import cloudpickle
from stillhook.cli import main
from stillhook.commands.world import cases
from stillhook.text import commands, console, json_text, show, write_json

def replay(arguments):
    with open(sys.argv[1], "rb") as file:
        _, said = cloudpickle.load(file)
    for width in (20, 80, 140):
        os.environ["COLUMNS"] = str(width)
        for kind, what, how in said:
            out = console()
            if kind == "print":
                out.print(*what, **how)
            elif kind == "show":
                show(what, out)
                write_json(json_text(what))
            elif kind == "commands":
                commands(what, out)
            else:
                write_json(what)
    return 0

cases.run = replay
sys.exit(main(["cases"]))
"""
