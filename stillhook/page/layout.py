"""What stands where on the page, in NiceGUI's elements: controls on one side, what they do beside.

`Layout` builds the page once for a tab and has a method for each thing that changes; what the user
does goes to an `Actions`, which `stillhook.page.tab.Tab` is.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from nicegui import ui

from .charts import legend
from .curves import Picture
from .desk import Drawn
from .limit_words import explained
from .state import Control

_DIGITS = 5  # of a number as it stands in its box
_VALUE = "(event) => emit(event.target.value)"


class Actions(Protocol):
    """What a user can do on the page."""

    def changed(self, key: str, text: str) -> None:
        """Take another value of a control, in the unit that it shows."""

    async def open(self, name: str) -> None:
        """Open a case by its name."""

    async def choose_structure(self, name: str) -> None:
        """Take another structure."""

    async def optimise(self, *, every: bool) -> None:
        """Find the best gains of this structure, or of every one that is usual."""

    def cancel(self) -> None:
        """Cancel what the worker does."""

    async def choose(self, index: int) -> None:
        """Take one of the designs that were found."""

    async def save(self, name: str, *, replace: bool) -> None:
        """Check and save design and case."""

    async def report(self) -> None:
        """Make the report and download it."""

    async def play(self) -> None:
        """Simulate a minute and show it."""

    def case_names(self) -> Mapping[str, str]:
        """Return the cases that can be opened, each with what is shown."""


class Layout:
    """The elements of one tab."""

    def __init__(self, actions: Actions) -> None:
        self._actions = actions
        self._widgets: dict[str, tuple[ui.element, ui.element]] = {}
        self._rounds = 0
        self._shown = "", ""  # the case and the structure that the page is about
        self._answers = 0
        with ui.element("main").classes("page"):
            self._top()
            with ui.element("div").classes("columns"):
                with ui.element("div").classes("side"):
                    self._controller()
                    self._surroundings()
                    self._keeping()
                with ui.element("div").classes("main"):
                    self._headline()
                    self._charts()
                    self._further()

    # What changes.

    def show_case(
        self, name: str, title: str, about: str, structure: str, structures: Sequence[str]
    ) -> None:
        """Show which case and structure the page is about."""
        self._shown = name, structure
        self._case.set_options(dict(self._actions.case_names()), value=name)
        self._structure.set_options(list(structures), value=structure)
        self._about.set_text(about)
        self._name.set_value(title)

    def show_controls(self, controls: Sequence[Control]) -> None:
        """Build the sliders anew."""
        self._widgets = {}
        for box, gain in ((self._gains, True), (self._numbers, False)):
            box.clear()
            with box:
                for control in controls:
                    if control.gain is gain:
                        self._slider(control)

    def set_controls(self, controls: Sequence[Control]) -> None:
        """Move the sliders that are there, and their ends, and what stands in their boxes."""
        for control in controls:
            for widget in self._widgets.get(control.key, ()):
                self._rounds += 1
                widget.props(f"{_placed(control)} data-round={self._rounds}")

    def show(self, drawn: Drawn, verified: str) -> None:
        """Show a look; `verified` says how it was checked, nothing where it was not."""
        picture = drawn.picture
        self._answers += 1
        self._tiles.set_content(_tiles(picture))
        self._state.set_content(_state(picture, verified, self._answers))
        self._response.set_content(drawn.response)
        self._spectrum.set_content(drawn.spectrum)
        self._nyquist.set_content(drawn.nyquist)
        self._limits.set_content(drawn.limits)

    def show_capability(self, chart: str) -> None:
        """Show the chart of the capability."""
        self._capability.set_content(chart)

    def show_designs(self, rows: Sequence[tuple[str, str, str, str, str]], now: int | None) -> None:
        """List the designs found: structure, rms, share, M_s, status; `now` stands on the page."""
        self._designs.clear()
        with self._designs:
            if not rows:
                ui.html(
                    '<span class="hint">Each search leaves its design here, and those of other '
                    "structures that it tried; click one to take it.</span>",
                    sanitize=False,
                )
                return
            heads = ("structure", "load rms", "of hook's", "M_s", "status")
            ui.html(_cells(heads), sanitize=False).classes("found head")
            for index, row in enumerate(rows):
                button = ui.element("button").classes("found" + (" now" if index == now else ""))
                button.props(f'type=button aria-label="Take {row[0]}, {row[1]}"')
                button.on("click", lambda _, index=index: self._actions.choose(index))
                with button:
                    ui.html(_cells(row), sanitize=False, tag="span").style("display:contents")

    def show_strip(self, content: str) -> None:
        """Show what moves."""
        self._strip.set_content(content)
        self._play_pause.set_visibility("strip-data" in content)

    def working(self, text: str, share: float | None) -> None:
        """Show that the worker is busy, with its stage and the share that is done."""
        busy = bool(text)
        self._progress.set_visibility(busy)
        self._stage.set_text(text)
        self._bar.set_value(0.0 if share is None else round(share, 3))
        for button in self._workers:
            button.set_enabled(not busy)

    def say(self, text: str) -> None:
        """Say what went wrong, in a sentence; nothing takes it back."""
        self._message.set_text(text)

    def note(self, text: str) -> None:
        """Say what was done."""
        self._saved.set_text(text)

    # How it is built.

    def _top(self) -> None:
        with ui.element("header").classes("top"):
            ui.html('<h1 class="brand">Stillhook</h1>', sanitize=False)
            self._about = ui.label("").classes("about")
            self._case = ui.select({}, label="Case").props('dense outlined aria-label="Case"')
            self._case.on_value_change(self._case_chosen)
            self._case.on("popup-show", self._list_cases)

    def _list_cases(self) -> None:
        self._case.set_options(dict(self._actions.case_names()), value=self._shown[0])

    async def _case_chosen(self, event: Any) -> None:
        if event.value and event.value != self._shown[0]:
            await self._actions.open(str(event.value))

    async def _structure_chosen(self, event: Any) -> None:
        if event.value and event.value != self._shown[1]:
            await self._actions.choose_structure(str(event.value))

    def _controller(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Controller"'):
            ui.html("<h2>Controller</h2>", sanitize=False)
            self._structure = ui.select([], label="Structure").props(
                'dense outlined aria-label="Structure"'
            )
            self._structure.on_value_change(self._structure_chosen)
            self._gains = ui.element("div")
            with ui.element("div").classes("buttons"):
                best = ui.button(
                    "Optimise", on_click=lambda: self._actions.optimise(every=False)
                ).props("dense unelevated padding='4px 14px'")
                best.tooltip("Find the gains that hold the load stillest within the limits")
                every = ui.button(
                    "Compare structures", on_click=lambda: self._actions.optimise(every=True)
                ).props("dense outline padding='4px 14px'")
                every.tooltip("Optimise each usual structure; the simplest good one is taken")
            self._progress = ui.element("div").props("role=status")
            with self._progress:
                self._stage = ui.label("").classes("hint")
                self._bar = ui.linear_progress(0.0, show_value=False).props(
                    'instant-feedback aria-label="Progress"'
                )
                ui.button("Cancel", on_click=self._actions.cancel).props(
                    "dense flat padding='2px 10px'"
                )
            self._progress.set_visibility(False)
            self._workers = [best, every]

    def _surroundings(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Sea, rope and limits"'):
            ui.html("<h2>Sea, rope and limits</h2>", sanitize=False)
            self._numbers = ui.element("div")

    def _keeping(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Keep"'):
            ui.html("<h2>Keep</h2>", sanitize=False)
            self._name = ui.input("Name").props('dense outlined aria-label="Name of the files"')
            replace = ui.checkbox("replace files of that name").props("dense")
            with ui.element("div").classes("buttons"):
                save = ui.button(
                    "Check and save",
                    on_click=lambda: self._actions.save(
                        str(self._name.value or ""), replace=bool(replace.value)
                    ),
                ).props("dense unelevated padding='4px 14px'")
                report = ui.button("Report", on_click=self._actions.report).props(
                    "dense outline padding='4px 14px'"
                )
                report.tooltip("Check the design and download its report as HTML")
            self._saved = ui.label("").classes("hint").props("role=status")
            self._workers += [save, report]

    def _headline(self) -> None:
        with ui.element("section").classes("card result").props('aria-label="Result"'):
            self._tiles = ui.html("", sanitize=False)
            self._state = ui.html("", sanitize=False).props("aria-live=polite")
            self._message = ui.label("").classes("message").props("role=alert")

    def _charts(self) -> None:
        load, hook = ("after", "load, these gains"), ("hook", "hook")
        held = ("before", "load, drum held")
        with ui.element("div").classes("charts"):
            self._response = _card("Load over hook", legend(load, held))
            self._spectrum = _card("Spectra", legend(hook, load, held))
            self._nyquist = _card(
                "Nyquist curve",
                legend(("after", "L"), ("hook", "|L| = 1"), ("broken", "limit of M_s")),
            )
            self._capability = _card(
                "Capability",
                legend(
                    ("drum", "these gains"), ("before dashed", "drum held"), ("dot", "this sea")
                ),
            )
        worth = "use, bound, and how much stiller the load would be if it were 1 % looser"
        self._limits = _card("Limits", f'<span class="legend">{worth}, at the last optimum</span>')

    def _further(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Designs found"'):
            ui.html("<h2>Designs found</h2>", sanitize=False)
            self._designs = ui.element("div")
        with ui.element("section").classes("card").props('aria-label="A minute at sea"'):
            ui.html(
                '<div class="heading"><h2>A minute at sea</h2><span class="legend">simulated with '
                "all limits of the drive; predictive control beside it</span></div>",
                sanitize=False,
            )
            with ui.element("div").classes("buttons"):
                play = ui.button("Simulate", on_click=self._actions.play).props(
                    "dense unelevated padding='4px 14px'"
                )
                self._play_pause = ui.button("Play or pause").classes("strip-play")
                self._play_pause.props("dense outline padding='4px 14px' aria-pressed=true")
                self._play_pause.set_visibility(False)
            self._strip = ui.html("", sanitize=False)
            self._workers.append(play)
        with ui.element("details").classes("card"):
            ui.html("What the limits are", sanitize=False, tag="summary")
            ui.html(explained(), sanitize=False)

    def _slider(self, control: Control) -> None:
        """Build a control: its words, a slider, and a box to type in.

        Both are the browser's own, which `page.js` keeps alike; where they stand is said in
        ``data-value``, as a `value` would be set back to with every change of the page.
        """
        unit = f'<span class="unit">{html.escape(control.unit)}</span>' if control.unit else ""
        named = f'aria-label="{html.escape(control.name)}" {_placed(control)}'
        with ui.element("div").classes("control"):
            ui.html(f"{html.escape(control.label)}{unit}", sanitize=False).classes("words").tooltip(
                control.help
            )
            number = ui.element("input").props(f"type=text inputmode=decimal {named}")
            slider = ui.element("input").props(f"type=range data-unit='{control.unit}' {named}")
        self._widgets[control.key] = slider, number
        slider.on("input", self._moved(control.key), throttle=0.05, js_handler=_VALUE)
        number.on("change", self._moved(control.key), js_handler=_VALUE)

    def _moved(self, key: str) -> Callable[[Any], None]:
        return lambda event: self._actions.changed(key, str(event.args))


def _placed(control: Control) -> str:
    """Return where a control stands, as fields of its elements."""
    return (
        f"min={control.low:.9g} max={control.high:.9g} step={control.step:.9g} "
        f"data-value={control.value:.{_DIGITS}g}"
    )


def _card(title: str, more: str) -> ui.html:
    """Build a card with a title and a place for its content."""
    with ui.element("section").classes("card").props(f'aria-label="{title}"'):
        ui.html(f'<div class="heading"><h2>{title}</h2>{more}</div>', sanitize=False)
        return ui.html("", sanitize=False)


def _tiles(picture: Picture) -> str:
    """Return the headline figures."""
    tiles = (
        ("Load, rms", picture.rms, f"drum held {picture.held}"),
        ("Of the hook's motion", picture.share, f"{picture.change}, hook {picture.hook} rms"),
        ("Load, largest", picture.largest, picture.largest_of.removeprefix("largest ")),
        ("Sensitivity peak M_s", picture.sensitivity, f"limit {picture.max_sensitivity:g}"),
        ("Delay margin", picture.delay, "further delay that it bears"),
    )
    cells = (
        f'<div class="tile{" first" if k == 0 else ""}"><div class="k">{html.escape(what)}</div>'
        f'<div class="v">{html.escape(value)}</div><div class="n">{html.escape(note)}</div></div>'
        for k, (what, value, note) in enumerate(tiles)
    )
    return f'<div class="tiles">{"".join(cells)}</div>'


def _state(picture: Picture, verified: str, answers: int) -> str:
    """Return whether the limits are kept and whether that was checked."""
    kind, word = ("good", "Limits kept") if picture.kept else ("bad", "Limits broken")
    if not picture.stable:
        word = "Unstable"
    if verified:
        sure = '<span class="chip good">Verified</span>'
    else:
        verified = "a quick look; Optimise, or Check and save, verifies it"
        sure = '<span class="chip warn">Not verified</span>'
    return (
        f'<div class="state" data-answer="{answers}"><span class="chip {kind}">{word}</span>{sure}'
        f"<span>{html.escape(picture.verdict)}</span>"
        f'<span class="hint">{html.escape(verified)}</span></div>'
    )


def _cells(cells: Sequence[str]) -> str:
    looks = ("", "r", "r", "r", "s")
    parts = zip(looks, cells, strict=True)
    return "".join(f'<span class="{look}">{html.escape(cell)}</span>' for look, cell in parts)
