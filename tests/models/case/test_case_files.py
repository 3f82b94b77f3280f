"""Case files that cannot be read, YAML with its lines, TOML, and writing files."""

from __future__ import annotations

import os
import re
import textwrap
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import InputError, load_case, template_text, write_text_atomically
from models.casefile import read_yaml


class TestFiles:
    def test_missing_file(self, tmp_path):
        with pytest.raises(InputError) as caught:
            load_case(tmp_path / "my.yaml")
        assert str(caught.value) == (
            f"{tmp_path}/my.yaml: no such case file or bundled case; known here: landing, "
            "subsea-crane, thesis-1975, thesis-1975-rope"
        )

    def test_mistyped_name(self):
        with pytest.raises(InputError) as caught:
            load_case("thesis-1957")
        assert str(caught.value) == (
            "thesis-1957: no such case file or bundled case; did you mean 'thesis-1975'?"
        )

    def test_template_is_no_bundled_case(self):
        with pytest.raises(InputError, match="template: no such case file"):
            load_case("template")

    def test_folder(self, tmp_path):
        with pytest.raises(InputError) as caught:
            load_case(tmp_path)
        assert str(caught.value) == f"{tmp_path}: is a folder; a file is wanted"

    def test_unreadable(self, tmp_path, monkeypatch):
        def refuse(*_, **__):  # root, who may run the tests, may read every file
            raise PermissionError(13, "Permission denied")

        (tmp_path / "my.yaml").touch()
        monkeypatch.setattr(Path, "read_bytes", refuse)
        with pytest.raises(InputError, match=r"my\.yaml: cannot be read: Permission denied"):
            load_case(tmp_path / "my.yaml")

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (b"", "is empty; `stillhook new` writes a case to start from"),
            (b"# only a comment\n", "is empty; `stillhook new` writes a case to start from"),
            (
                b"- 1\n- 2\n",
                "must hold sections (sea:, vessel:, rope:, ...) at the top, got a list",
            ),
            (
                b"Dear sir or madam\n",
                "must hold sections (sea:, vessel:, rope:, ...) at the top, "
                "got 'Dear sir or madam'",
            ),
            (b"\x89PNG\r\n\x1a\n\x00", "is no text file, but a picture (PNG)"),
            (b"name: caf\xe9\n", "is not a text file (byte 9)"),
            (b"a: \x00\n", "is not a text file (it holds a zero byte)"),
            (b"---\na: 1\n---\nb: 2\n", "must hold one YAML document, got 2"),
        ],
    )
    def test_not_a_case(self, tmp_path, content, message):
        path = tmp_path / "my.yaml"
        path.write_bytes(content)
        with pytest.raises(InputError, match=re.escape(f"my.yaml: {message}")) as caught:
            load_case(path)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("sea:\n\tspectrum: jonswap\n", "my.yaml:2: is indented with a tab; YAML wants spaces"),
            ("sea: [1, 2\n", "my.yaml:2: is not YAML: expected ',' or ']', but got '<stream end>'"),
            ("a: 1\nb: c: d\n", "my.yaml:2: is not YAML: mapping values are not allowed here"),
            ("a: 'b\n", "my.yaml:2: is not YAML: found unexpected end of stream"),
            ("a: !force 3\n", "my.yaml:1: is not YAML: could not determine a constructor for the"),
            ("a: *b\n", "my.yaml:1: is not YAML: found undefined alias 'b'"),
        ],
    )
    def test_not_yaml(self, tmp_path, text, message):
        path = tmp_path / "my.yaml"
        path.write_text(text)
        with pytest.raises(InputError) as caught:
            load_case(path)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)

    def test_repeated_keys_are_all_named(self, tmp_path):
        path = tmp_path / "my.yaml"
        path.write_text("name: one\nrope:\n  mass: 1\n  length: 2\n  mass: 3\nname: other\n")
        with pytest.raises(InputError) as caught:
            load_case(path)
        assert str(caught.value).splitlines() == [
            f"{path}:5: rope.mass: is given twice, first in line 3",
            f"{path}:6: name: is given twice, first in line 1",
        ]

    def test_aliases_that_never_end(self, tmp_path):
        path = tmp_path / "my.yaml"
        path.write_text("a: &a [*a]\n")
        with pytest.raises(InputError, match=r"my\.yaml: is nested deeper than 20 levels"):
            load_case(path)
        laughs = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
        laughs += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10)]
        path.write_text("\n".join(laughs))
        with pytest.raises(InputError, match="has more than 100000 entries"):
            load_case(path)

    def test_an_anchor_that_is_set_anew_is_no_matter(self):
        data, _ = read_yaml("a: &x 1\nb: &x 2\nc: *x\n", "test")
        assert data == {"a": 1, "b": 2, "c": 2}

    @pytest.mark.parametrize(
        ("name", "text", "message"),
        [
            ("a.yaml", "a: " + "[" * 3000 + "]" * 3000, "is nested deeper than 20 levels"),
            ("a.json", '{"a":' * 3000 + "1" + "}" * 3000, "is nested deeper than 20 levels"),
            ("a.toml", "a = " + "[" * 3000 + "]" * 3000, "is nested too deep; no case is"),
            ("a.yaml", "a: " + "1" * 5000, "is not YAML: Exceeds the limit (4300 digits)"),
            ("a.toml", "a = " + "1" * 5000, "is not TOML: Exceeds the limit (4300 digits)"),
            ("a.yaml", "a: " + "x" * 5_000_000, "must be at most 4 MB, got 5 MB"),
            ("a.toml", "a = '" + "x" * 5_000_000, "must be at most 4 MB, got 5 MB"),
            ("a.yaml", "a: [" + "1, " * 100_001 + "1]", "has more than 100000 entries"),
            ("a" * 300, "", "no such case file or bundled case"),
        ],
        ids=lambda value: value[:20],
    )
    def test_what_is_too_long_or_too_deep_for_a_case(self, name, text, message, tmp_path):
        path = tmp_path / name
        if text:
            path.write_text(text)
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            load_case(path)
        assert "\n" not in str(caught.value)

    def test_composing_ends_at_the_limit_of_nodes(self):
        # Without it the whole text would be made into nodes first: what follows is no YAML.
        text = "a: [" + "1, " * 100_001 + "]\n}"
        with pytest.raises(InputError, match="has more than 100000 entries"):
            read_yaml(text, "test")

    def test_yaml_is_version_1_2(self):
        data, _ = read_yaml("a: 1e6\nb: no\nc: 12:30\nd: 010\ne: 1.6E8\n", "test")
        assert data == {"a": 1e6, "b": "no", "c": "12:30", "d": 10, "e": 1.6e8}

    @given(st.text(max_size=60))
    def test_any_text_gives_a_case_or_a_sentence(self, text):
        message = ""
        try:
            read_yaml(text, "my.yaml")
        except InputError as error:
            message = str(error)
        assert message == "" or message.startswith("my.yaml")

    def test_bundled_names_win_over_files(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "thesis-1975").write_text("not: a case\n")
        assert load_case("thesis-1975").name == "thesis-1975"
        with pytest.raises(InputError, match=r"\n\./thesis-1975:1: not: unknown key"):
            load_case("./thesis-1975")


TOML = textwrap.dedent(
    '''\
    stillhook = 1
    name = "a [section] = in a text"
    description = """
    several lines
    rope = 3
    """
    "quoted.key" = 'literal \\'

    [sea]
    spectrum = "jonswap"
    significant_height = "2 m"
    peak_period = 9

    [vessel.heave_rao]
    omega = [
      0.3, 0.6,
      "0.1 Hz",
    ]
    amplitude = [1, 1, 0.8]

    [rope]
    diameter = "50 mm"
    axial_stiffness = 2.428e8
    payload.mass = 1
    table = { a = 1, b = { c = [2, 3] }, d = "}" }

    [[winch.drum.layers]]
    pitch_diameter = 1
    rope_on_drum = 100
    [[winch.drum.layers]]
    pitch_diameter = 1.1
    rope_on_drum = 200
    [winch.drum.layers.extra]
    x = """a ""quoted"" text"""
    y = 2024-01-01T12:00:00Z
    '''
)


class TestToml:
    def test_errors_have_their_path(self, tmp_path):
        path = tmp_path / "my.toml"
        path.write_text(TOML)
        with pytest.raises(InputError) as caught:
            load_case(path)
        lines = str(caught.value).splitlines()
        starts = (
            "quoted.key: unknown key",
            "rope.payload: unknown key",
            "winch.drum.layers[1].extra: unknown key",
            "rope.length: is missing; it must be a length",
        )
        for start in starts:
            assert any(line.startswith(f"{path}: {start}") for line in lines), start

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("a = 1\nb =\n", "my.toml:2: is not TOML: Invalid value"),
            ("a = 1\na = 2\n", "my.toml:2: is not TOML: Cannot overwrite a value"),
            ("", "my.toml: is empty; `stillhook new` writes a case to start from"),
        ],
    )
    def test_not_toml(self, tmp_path, text, message):
        path = tmp_path / "my.toml"
        path.write_text(text)
        with pytest.raises(InputError) as caught:
            load_case(path)
        assert str(caught.value) == f"{tmp_path}/{message}"


class TestWriting:
    def test_replaces_the_old_file_and_leaves_nothing_else(self, tmp_path):
        path = tmp_path / "my.yaml"
        path.write_text("old")
        assert write_text_atomically(path, template_text()) == path
        assert path.read_text() == template_text()
        assert [item.name for item in tmp_path.iterdir()] == ["my.yaml"]

    def test_missing_folder(self, tmp_path):
        with pytest.raises(InputError, match=r"my\.yaml: cannot be written: No such file or dir"):
            write_text_atomically(tmp_path / "none" / "my.yaml", "text")

    def test_a_failure_leaves_the_old_file(self, tmp_path, monkeypatch):
        path = tmp_path / "my.yaml"
        path.write_text("old")

        def fail(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "replace", fail)
        with pytest.raises(
            InputError, match=r"my\.yaml: cannot be written: No space left on device"
        ):
            write_text_atomically(path, "new")
        assert path.read_text() == "old"
        assert [item.name for item in tmp_path.iterdir()] == ["my.yaml"]
