"""Completion in bash, by a real bash; zsh and fish where they are."""

from __future__ import annotations

import shutil
import subprocess

import pytest

import stillhook as sh
from stillhook.cli import COMMANDS

needs_bash = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")


@pytest.fixture
def script(run, tmp_path):
    def write(shell):
        ending = run("completion", shell)
        assert (ending.status, ending.err) == (0, "")
        path = tmp_path / f"stillhook.{shell}"
        path.write_text(ending.out)
        return path

    return write


@pytest.fixture
def completed(script):
    """What bash offers after some words, the last of which is not whole."""
    path = script("bash")

    def complete(*words):
        line = " ".join(f"'{word}'" for word in ("stillhook", *words))
        program = (
            f"set -u; source {path}; COMP_WORDS=({line}); COMP_CWORD={len(words)}; "
            '_stillhook; printf "%s\\n" ${COMPREPLY[@]+"${COMPREPLY[@]}"}'
        )
        done = subprocess.run(
            ["bash", "--norc", "-c", program], capture_output=True, text=True, timeout=60
        )
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout.split("\n")[:-1] if done.stdout != "\n" else []

    return complete


@needs_bash
def test_bash_completes_commands_and_their_parts(completed):
    assert completed("opt") == ["optimise"]
    firsts = {name.split()[0] for name, *_ in COMMANDS}
    assert {*completed("")} == firsts | {"-h", "--help", "--version", "--debug"}
    assert completed("--ver") == ["--version"]
    assert completed("--debug", "sche") == ["schema"]
    assert {*completed("vessel", "")} == {"list", "import", "hull", "-h", "--help"}
    assert completed("vessel", "i") == ["import"]


@needs_bash
def test_bash_completes_options_and_what_they_can_be(completed):
    assert completed("optimise", "subsea-crane", "--str") == ["--structure"]
    assert completed("optimise", "subsea-crane", "--format", "") == ["svg", "png"]
    assert completed("optimise", "--format", "=", "s") == ["svg"]
    assert completed("optimise", "--format", "=") == ["svg", "png"]
    assert completed("simulate", "x", "--scenario", "lan") == ["landing"]
    assert completed("simulate", "x", "--controller", "mpc-p") == ["mpc-preview"]
    assert "payload-feedback" in completed("optimise", "x", "--structure", "")
    assert completed("optimise", "x", "--seed", "") == []
    assert completed("vessel", "import", "--symmetry", "xz") == [
        "xz\\ plane",
        "xz\\ and\\ yz\\ planes",
    ]
    assert completed("vessel", "import", "--symmetry", "xz\\ p") == ["xz\\ plane"]
    assert completed("completion", "") == ["bash", "zsh", "fish"]
    assert completed("scenarios", "la") == ["landing"]
    assert completed("vessel", "list", "--no-f") == ["--no-figures"]


@needs_bash
def test_bash_completes_cases_files_and_folders(completed, tmp_path):
    (tmp_path / "sub way").mkdir()
    (tmp_path / "subsea.yaml").touch()
    cases = [name for name, _ in sh.bundled_cases()]
    assert {*cases} < {*completed("optimise", "")}
    assert {*completed("optimise", "sub")} == {"subsea-crane", "sub way", "subsea.yaml"}
    assert completed("sea", "thesis-1975-r") == ["thesis-1975-rope"]
    assert completed("vessel", "import", "osv") == ["osv-83m"]
    assert {*completed("new", "sub")} == {"sub way", "subsea.yaml"}
    assert completed("optimise", "x", "--out", "sub") == ["sub way"]
    assert {*completed("evaluate", "x", "--design", "sub")} == {"sub way", "subsea.yaml"}
    # A case is given once; what an option takes is none.
    assert "--out" in completed("optimise", "subsea-crane", "")
    assert "subsea-crane" not in completed("optimise", "subsea-crane", "")
    assert "subsea-crane" in completed("optimise", "--seed", "3", "")
    assert "subsea-crane" in completed("optimise", "--seed", "=", "3", "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_is_one_of_its_shell(script, shell):
    path = script(shell)
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} here")
    done = subprocess.run([shell, "-n", str(path)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_fish_completes(script, tmp_path):
    if shutil.which("fish") is None:
        pytest.skip("no fish here")
    path = script("fish")

    def completed(line):
        program = f"source {path}; complete -C '{line}'"
        done = subprocess.run(
            ["fish", "--no-config", "-c", program], capture_output=True, text=True, timeout=60
        )
        assert done.stderr == ""
        return [row.partition("\t")[0] for row in done.stdout.splitlines()]

    assert completed("stillhook opt") == ["optimise"]
    assert {*completed("stillhook vessel ")} == {"list", "import", "hull"}
    assert completed("stillhook optimise sub") == ["subsea-crane"]
    assert completed("stillhook optimise x --format s") == ["svg"]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_every_command_and_option_is_in_the_script(run, shell):
    text = run("completion", shell).out
    for name, room, help in COMMANDS:
        assert name.split()[-1] in text
        if room and "'" not in help and ":" not in help:
            assert help in text
    assert text.count("no-figures") == sum(1 for _, room, _ in COMMANDS if room)
    for word in ("subsea-crane", "osv-83m", "landing", "mpc-preview", "low-order-"):
        assert word in text


def test_a_shell_is_one_of_three(run):
    assert run("completion").status == 2
    assert run("completion", "tcsh").status == 2
