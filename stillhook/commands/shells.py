"""Completion in a shell: what can follow what, read from the parser, as a script for each shell.

    parser --> `completions` --> one `Completion` a command --> `bash_script`, `zsh_script`, ...

The scripts are plain text that names commands, options, choices and bundled cases, so that the
shell starts no Python; after an update they are written anew.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

#: Words that an argument may be besides its choices, by its command and name, as in "sea file", or
#: by its name alone.
Known = Mapping[str, Sequence[str]]


@dataclass(frozen=True, kw_only=True)
class Value:
    """What an argument may be."""

    name: str  #: As the help has it.
    words: tuple[str, ...]
    files: bool
    folders: bool

    @property
    def anything(self) -> bool:
        """Whether nothing is known of it."""
        return not (self.words or self.files or self.folders)


@dataclass(frozen=True, kw_only=True)
class Flag:
    """An option."""

    names: tuple[str, ...]
    help: str
    value: Value | None  #: None of one that takes nothing.
    repeated: bool


@dataclass(frozen=True, kw_only=True)
class Completion:
    """A command, and what can follow it."""

    path: tuple[str, ...]  #: Its words; none of the command line itself.
    flags: tuple[Flag, ...]
    values: tuple[Value, ...]  #: What is given without an option, in its order.
    parts: tuple[tuple[str, str], ...]  #: Commands within it: word and help.

    @property
    def name(self) -> str:
        """Its words as one."""
        return " ".join(self.path)


def completions(parser: argparse.ArgumentParser, known: Known) -> list[Completion]:
    """Return what can follow a command line and each command of it."""
    return [*_walk(parser, (), known)]


def _walk(
    parser: argparse.ArgumentParser, path: tuple[str, ...], known: Known
) -> Iterator[Completion]:
    flags: list[Flag] = []
    values: list[Value] = []
    parts: list[tuple[str, str]] = []
    below: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            below = dict(action.choices)
            parts = [(part.dest, part.help or "") for part in action._choices_actions]
        elif not action.option_strings:
            values.append(_value(action, path, known))
        elif action.help != argparse.SUPPRESS:
            flags.append(
                Flag(
                    names=tuple(action.option_strings),
                    help=" ".join((action.help or "").replace("%%", "%").split()),
                    value=None if action.nargs == 0 else _value(action, path, known),
                    repeated=isinstance(action, argparse._AppendAction),
                )
            )
    yield Completion(path=path, flags=tuple(flags), values=tuple(values), parts=tuple(parts))
    for word, other in below.items():
        yield from _walk(other, (*path, word), known)


def _value(action: argparse.Action, path: tuple[str, ...], known: Known) -> Value:
    """Return what an argument may be: its choices, what is known by its name, files."""
    name = str(action.metavar or action.dest.upper())
    own = known.get(" ".join([*path, action.dest]), known.get(action.dest, ()))
    # A case is a file too where it is no bundled one.
    return Value(
        name=name,
        words=tuple(map(str, action.choices or own)),
        files=name in ("FILE", "PATH") or (name == "CASE" and not action.option_strings),
        folders=name == "DIR",
    )


def bash_script(found: Sequence[Completion]) -> str:
    """Return the completion for bash, 3.2 and later."""
    says, takes = [], []
    for each in found:
        taking = {name: flag.value for flag in each.flags if flag.value for name in flag.names}
        words = [name for flag in each.flags for name in flag.names]
        words += [word for word, _ in each.parts]
        says.append(
            f"        {shlex.quote(each.name)})\n"
            f"            words={shlex.quote(' '.join(words))}\n"
            f"            valued={shlex.quote(' '.join(taking))} ;;"
        )
        at = {str(place): value for place, value in enumerate(each.values)} | taking
        takes += [
            f"        {shlex.quote(f'{each.name} {key}')}) {_in_bash(value)} ;;"
            for key, value in at.items()
            if not value.anything
        ]
    parents = " ".join(each.name for each in found if each.path and each.parts)
    script = _BASH.replace("PARENTS", parents)
    return script.replace("SAYS", "\n".join(says)).replace("TAKES", "\n".join(takes))


def _in_bash(value: Value) -> str:
    # Read twice, by `compgen` and by the line that it ends in.
    words = " ".join(word.replace(" ", "\\\\\\ ") for word in value.words)
    parts = [f"known={shlex.quote(words)}"] if words else []
    parts += ["files=-f"] if value.files else ["files=-d"] if value.folders else []
    return "; ".join(parts)


_BASH = """\
_stillhook() {
    local current="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD - 1]}"
    local command= words= valued= known= files= key= word= given=0 i
    # To bash --name=value is three words.
    if [[ $current == "=" ]]; then
        current=
    elif [[ $before == "=" ]]; then
        before="${COMP_WORDS[COMP_CWORD - 2]}"
    fi
    _stillhook_says
    for ((i = 1; i < COMP_CWORD; i++)); do
        word="${COMP_WORDS[i]}"
        if [[ $word == -* ]]; then
            if [[ " $valued " == *" $word "* ]]; then
                i=$((i + 1))
                if [[ ${COMP_WORDS[i]} == "=" ]]; then i=$((i + 1)); fi
            fi
        elif [[ -z $command || " PARENTS " == *" $command "* ]]; then
            command="${command:+$command }$word"
            _stillhook_says
        else
            given=$((given + 1))
        fi
    done
    if [[ $before == -* && " $valued " == *" $before "* ]]; then
        key="$before"
        _stillhook_takes
    elif [[ $current != -* ]]; then
        key="$given"
        _stillhook_takes
        if [[ -z $known$files ]]; then known="$words"; fi
    else
        known="$words"
    fi
    COMPREPLY=()
    while IFS= read -r word; do
        COMPREPLY+=("$word")
    done < <(compgen -W "$known" -- "${current//\\\\/\\\\\\\\}")
    if [[ -n $files ]]; then
        compopt -o filenames 2>/dev/null
        while IFS= read -r word; do
            COMPREPLY+=("$word")
        done < <(compgen $files -- "$current")
    fi
}

# What can follow a command, and which of its options take a value.
_stillhook_says() {
    case "$command" in
SAYS
        *)
            words= valued= ;;
    esac
}

# What a value of a command can be: that of an option, or the one at a place.
_stillhook_takes() {
    case "$command $key" in
TAKES
    esac
}

complete -F _stillhook stillhook
"""


def zsh_script(found: Sequence[Completion]) -> str:
    """Return the completion for zsh: to be sourced, or found on its path as `_stillhook`."""
    functions = []
    for each in found:
        specs = [_zsh_flag(name, flag) for flag in each.flags for name in flag.names]
        specs += [f"{place}{_zsh_value(value)}" for place, value in enumerate(each.values, 1)]
        if each.parts:
            specs += ["1: :->command", "*:: :->rest"]
        lines = " \\\n        ".join(shlex.quote(spec) for spec in specs)
        body = f"    _arguments -C \\\n        {lines}\n"
        if each.parts:
            rows = "\n            ".join(
                shlex.quote(f"{word}:{_zsh_text(help)}") for word, help in each.parts
            )
            calls = "\n            ".join(
                f"{word}) {_zsh_name((*each.path, word))} ;;" for word, _ in each.parts
            )
            body = _ZSH_PARTS.replace("ARGUMENTS", body).replace("ROWS", rows)
            body = body.replace("CALLS", calls)
        functions.append(f"{_zsh_name(each.path)}() {{\n{body}}}\n")
    return "#compdef stillhook\n\n" + "\n".join(functions) + _ZSH_END


def _zsh_name(path: tuple[str, ...]) -> str:
    return "_".join(["_stillhook", *path])


def _zsh_flag(name: str, flag: Flag) -> str:
    star = "*" if flag.repeated else ""
    return f"{star}{name}[{_zsh_text(flag.help)}]{_zsh_value(flag.value) if flag.value else ''}"


def _zsh_value(value: Value) -> str:
    words = " ".join(word.replace(" ", "\\ ") for word in value.words)
    also = "_files" if value.files else "_files -/" if value.folders else ""
    action = f"({words})" if words else also or " "
    if words and also:
        action = f"{{compadd -- {words}; {also}}}"
    return f":{_zsh_text(value.name)}:{action}"


def _zsh_text(text: str) -> str:
    for mark in "\\:[]":
        text = text.replace(mark, f"\\{mark}")
    return text


_ZSH_PARTS = """\
    local context state state_descr line
    typeset -A opt_args
ARGUMENTS    case $state in
    command)
        local -a commands=(
            ROWS
        )
        _describe -t commands command commands ;;
    rest)
        case $line[1] in
            CALLS
        esac ;;
    esac
"""
_ZSH_END = """
if [[ $funcstack[1] == _stillhook ]]; then
    _stillhook "$@"
else
    compdef _stillhook stillhook
fi
"""


def fish_script(found: Sequence[Completion]) -> str:
    """Return the completion for fish, 3.0 and later."""
    lines = []
    for each in found:
        at = f"complete -c stillhook -n '__stillhook_at {each.name}'"
        only = f"complete -c stillhook -n '__stillhook_only {each.name}'"
        if not each.path:
            at = only = "complete -c stillhook -n __stillhook_only"
        for word, help in each.parts:
            lines.append(f"{only} -a {word} -d {_fish_text(help)}")
        for value in each.values:
            if not value.anything:
                lines.append(f"{at} {_fish_value(value)}".replace(" -x", ""))
        for flag in each.flags:
            names = " ".join(
                f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}"
                for name in flag.names
            )
            takes = f" {_fish_value(flag.value)}" if flag.value else ""
            lines.append(f"{at} {names}{takes} -d {_fish_text(flag.help)}")
    return _FISH + "\n".join(lines) + "\n"


def _fish_value(value: Value) -> str:
    words = " ".join(word.replace(" ", "\\ ") for word in value.words)
    if value.folders:
        return "-x -a '(__fish_complete_directories)'"
    return ("-r -F" if value.files else "-x") + (f" -a {_fish_text(words)}" if words else "")


def _fish_text(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


_FISH = """\
# The words of the line so far, without options.
function __stillhook_words
    set -l found (string match -v -- '-*' (commandline -opc))
    set -e found[1]
    string join ' ' -- $found
end

# Whether they begin with a command, or are no more than it.
function __stillhook_at
    set -l line (__stillhook_words)
    string match -q -- "$argv *" "$line "
end
function __stillhook_only
    set -l line (__stillhook_words)
    test "$line" = "$argv"
end

complete -c stillhook -f
"""
