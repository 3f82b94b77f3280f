"""The page in a browser: every control, by mouse and by keys, and what may go wrong."""

from __future__ import annotations

import os
import re
import shutil
import signal
import statistics
from importlib.util import find_spec

import pytest

pytestmark = pytest.mark.page

CHROMIUM = "/usr/bin/chromium"
FLAGS = """
    --headless --no-sandbox --disable-gpu --disable-quic --no-first-run
    --disable-background-networking --disable-component-update --disable-sync
""".split()  # noqa: SIM905
WAIT = 90_000  # for a search on a busy machine [ms]
#: Resolves with the time from the next key to the next answer on the screen [ms].
TIMED = """() => {
  const box = document.querySelector('.result');
  const old = document.querySelector('.state').dataset.answer;
  let began = 0;
  const begin = () => { began = performance.now(); };
  document.addEventListener('keydown', begin, { once: true, capture: true });
  window.found = new Promise((done) => {
    const seen = new MutationObserver(() => {
      if (document.querySelector('.state')?.dataset.answer === old) return;
      seen.disconnect();
      requestAnimationFrame(() => setTimeout(() => done(performance.now() - began)));
    });
    seen.observe(box, { childList: true, subtree: true, attributes: true });
    setTimeout(() => done(-1), 8000);
  });
}"""


@pytest.fixture(scope="module")
def browser():
    if find_spec("playwright") is None:
        pytest.skip("needs playwright: run `make test-page`")
    if not shutil.which(CHROMIUM):
        pytest.skip(f"needs {CHROMIUM}: run `make test-page`")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as player:
        found = player.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


@pytest.fixture
def tab(browser, served):
    """A tab with the thesis's winch, which has gains and is quick; its errors fail the test."""
    opened, wrong = [], []

    def open_tab(case: str | None = "thesis-1975", **settings):
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **settings})
        context.set_default_timeout(WAIT)
        page = context.new_page()
        page.asked = []
        page.on("request", lambda request: page.asked.append(request.url))
        page.on("websocket", lambda socket: page.asked.append(socket.url))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(served.url)
        page.wait_for_selector("[data-answer]")
        opened.append(context)
        if case:
            choose(page, "Case", case)
            page.wait_for_function("document.querySelector('.about').textContent.includes('1975')")
            page.wait_for_function("document.querySelectorAll('.control').length === 8")
            page.wait_for_selector(".tile.first .v:has-text('11.7 mm')")
        return page

    yield open_tab
    for context in opened:
        context.close()
    assert wrong == []


def choose(page, label, text):
    page.get_by_role("combobox", name=label).click()
    page.get_by_role("option", name=re.compile(rf"^{re.escape(text)}( |$)")).click()


def rms(page):
    return page.locator(".tile.first .v").inner_text()


def answered(page, act):
    """Do something and wait for the next look."""
    old = page.locator(".state").get_attribute("data-answer")
    act()
    page.wait_for_function(f"document.querySelector('.state').dataset.answer !== '{old}'")


def value(page, name):
    return page.get_by_role("textbox", name=name).input_value()


def test_a_slider_moves_the_load_by_mouse_keys_and_typing(tab):
    page = tab()
    slider = page.get_by_role("slider", name="Gain a1")
    slider.focus()
    assert value(page, "Gain a1") == "100"
    answered(page, lambda: page.keyboard.press("ArrowLeft"))
    assert float(value(page, "Gain a1")) < 100
    assert rms(page) != "11.7 mm"
    box = slider.bounding_box()
    answered(page, lambda: page.mouse.click(box["x"] + 0.2 * box["width"], box["y"] + 8))
    assert 40 < float(value(page, "Gain a1")) < 60
    typed = page.get_by_role("textbox", name="Gain a1")
    answered(page, lambda: (typed.fill("100"), typed.press("Enter")))
    assert rms(page) == "11.7 mm"
    assert float(slider.input_value()) == pytest.approx(100, abs=2)
    assert slider.get_attribute("aria-valuetext").startswith("100")
    wave = page.get_by_role("textbox", name="Wave height H_s [m]")
    answered(page, lambda: (wave.fill("1,2"), wave.press("Tab")))
    assert float(rms(page).split()[0]) < 9
    far = page.get_by_role("textbox", name="Gain a1")
    answered(page, lambda: (far.fill("400"), far.press("Enter")))
    assert float(slider.input_value()) == pytest.approx(400, abs=5)
    far.fill("lots")
    far.press("Enter")
    page.wait_for_selector(".message:has-text(\"must be a number, got 'lots'\")")


def test_every_control_has_a_name_and_is_reached_by_tab(tab):
    page = tab()
    for role in ("slider", "textbox", "button", "combobox", "checkbox"):
        for control in page.get_by_role(role).all():
            named = control.evaluate(
                "e => e.getAttribute('aria-label') || e.innerText || e.labels?.[0]?.innerText || ''"
            )
            assert named.strip(), control.evaluate("e => e.outerHTML")[:200]
    reached = set()
    page.evaluate("document.activeElement.blur()")
    for _ in range(60):
        page.keyboard.press("Tab")
        what, outline = page.evaluate(
            "() => { const e = document.activeElement; "
            "const near = e.closest('.q-field__control') ?? e;"
            "return [e.type + ' ' + (e.getAttribute('aria-label') ?? e.innerText), "
            "getComputedStyle(near).outlineStyle + getComputedStyle(near).boxShadow]; }"
        )
        reached.add(what)
        if what.startswith(("range", "button", "text Gain")):
            assert outline != "nonenone", what
    words = " | ".join(reached)
    for wanted in (
        "range Gain a1",
        "text Gain a1",
        "Optimise",
        "Check and save",
        "Simulate",
        "Case",
    ):
        assert wanted in words


def test_optimise_takes_the_best_gains_verified_and_lists_them(tab):
    page = tab()
    assert "Not verified" in page.locator(".state").inner_text()
    assert page.locator(".broken").count() >= 1
    page.get_by_role("button", name="Optimise").click()
    page.wait_for_selector(".q-linear-progress")
    page.wait_for_selector(".chip:has-text('Verified'):not(:has-text('Not'))")
    page.wait_for_selector(".chip:has-text('Limits kept')")
    assert "1 % looser" in page.locator(".bars").inner_text()
    best = rms(page)
    found = page.locator(".found:not(.head)")
    assert found.count() == 1
    slider = page.get_by_role("slider", name="Gain a1")
    slider.focus()
    answered(page, lambda: page.keyboard.press("ArrowLeft"))
    page.wait_for_selector(".chip:has-text('Not verified')")
    answered(page, found.first.click)
    page.wait_for_function(f"document.querySelector('.tile.first .v').innerText === '{best}'")


def test_a_search_is_cancelled_and_a_killed_worker_is_told(tab, served):
    page = tab()
    choose(page, "Structure", "low-order-4")  # it has no gains yet, and a long search begins
    page.wait_for_selector(".hint:has-text('Searching low-order-4')")
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_selector(".q-linear-progress", state="hidden")
    assert page.locator(".message").inner_text() == ""
    before = set(served.workers)
    page.get_by_role("button", name="Optimise").click()
    page.wait_for_selector(".hint:has-text('Searching low-order-4:')")
    for pid in set(served.workers) - before:
        os.kill(pid, signal.SIGKILL)
    page.wait_for_selector(".message:has-text('was ended by SIGKILL; try again')")
    assert page.get_by_role("button", name="Optimise").is_enabled()
    choose(page, "Structure", "payload-feedback")
    page.wait_for_selector(".tile.first .v:has-text('11.7 mm')")


def test_two_tabs_have_a_state_each(tab):
    one, other = tab(), tab()
    typed = one.get_by_role("textbox", name="Gain a1")
    answered(one, lambda: (typed.fill("50"), typed.press("Enter")))
    assert rms(one) != "11.7 mm"
    assert rms(other) == "11.7 mm"
    assert value(other, "Gain a1") == "100"


def test_a_bad_case_is_a_sentence_and_the_page_goes_on(tab):
    page = tab()
    choose(page, "Case", "bad.yaml")
    page.wait_for_selector(".message:has-text('bad.yaml:21: sea.peak_period: is missing')")
    assert rms(page) == "11.7 mm"
    slider = page.get_by_role("slider", name="Gain a1")
    slider.focus()
    answered(page, lambda: page.keyboard.press("ArrowLeft"))
    wave = page.get_by_role("textbox", name="Depth")
    wave.fill("-5")
    wave.press("Enter")
    page.wait_for_selector(".message:has-text('rope.length')")
    answered(page, lambda: (wave.fill("1500"), wave.press("Enter")))
    assert page.locator(".message").inner_text() == ""


def test_design_and_case_are_saved_in_the_folder_and_not_twice(tab, served):
    page = tab()
    page.get_by_role("textbox", name="Name").fill("kept")
    page.get_by_role("button", name="Check and save").click()
    page.wait_for_selector(".hint:has-text('Saved kept-case.yaml and kept-design.yaml')")
    assert {"kept-case.yaml", "kept-design.yaml"} <= {p.name for p in served.folder.iterdir()}
    page.get_by_role("button", name="Check and save").click()
    page.wait_for_selector(".message:has-text('is there already')")
    page.get_by_role("textbox", name="Name").fill("../out")
    page.get_by_role("button", name="Check and save").click()
    page.wait_for_selector(".message:has-text('must be a plain name')")
    assert not list(served.folder.parent.glob("out*"))


def test_the_report_is_downloaded_and_nothing_stays_behind(tab, served):
    page = tab()
    with page.expect_download() as download:
        page.get_by_role("button", name="Report").click()
    found = download.value
    assert found.suggested_filename == "thesis-1975-report.html"
    assert "thesis-1975" in found.path().read_text(encoding="utf-8")
    assert not list(served.folder.glob(".stillhook-page-*"))


def test_a_minute_at_sea_moves_and_stops(tab):
    page = tab()
    page.get_by_role("button", name="Simulate").click()
    page.wait_for_selector(".station >> nth=1")
    page.wait_for_selector("[data-time]")
    assert page.locator(".scene").count() == 2
    clock = "document.querySelector('[data-time]').dataset.time"
    begun = page.evaluate(clock)
    page.wait_for_function(f"{clock} !== '{begun}'")
    page.get_by_role("button", name="Play or pause").click()
    page.wait_for_timeout(100)
    held = page.evaluate(clock)
    page.wait_for_timeout(300)
    assert page.evaluate(clock) == held


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_nothing_is_beside_the_screen_or_over_another(tab, width, scheme):
    page = tab(viewport={"width": width, "height": 850}, color_scheme=scheme)
    page.wait_for_selector("text=/nothing binds|binds|no capability|spectrum/")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    boxes = page.evaluate(
        "[...document.querySelectorAll('.card, .control, .chart')].map((e) => {"
        "const b = e.getBoundingClientRect(); "
        "return [b.left, b.right, e.scrollWidth - e.clientWidth]; })"
    )
    assert all(left >= 0 and right <= width and over <= 1 for left, right, over in boxes)
    cards = page.evaluate(
        "[...document.querySelectorAll('.charts > .card')].map((e) => {"
        "const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; })"
    )
    for k, one in enumerate(cards):
        for other in cards[k + 1 :]:
            apart = (
                one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
            )
            assert apart
    ground, ink = page.evaluate(
        "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]"
        ".map((c) => c.match(/\\d+/g).slice(0, 3).reduce((a, b) => a + Number(b), 0) / 765)"
    )
    assert (ground > ink + 0.5) if scheme == "light" else (ink > ground + 0.5)


def test_a_limit_leads_to_what_it_is(tab):
    page = tab()
    page.get_by_role("link", name="Sensitivity peak M_s").click()
    target = page.locator("#limit-max_sensitivity")
    assert target.is_visible()
    assert "limits.max_sensitivity" in target.inner_text()


def test_nobody_else_is_asked_for_anything(tab, served):
    page = tab()
    page.get_by_role("slider", name="Gain a1").focus()
    answered(page, lambda: page.keyboard.press("ArrowLeft"))
    assert len(page.asked) > 5
    token = served.url.rstrip("/").rpartition("/")[2]
    hosts = {url.split("/")[2] for url in page.asked if "//" in url}
    assert hosts == {f"127.0.0.1:{served.port}"}
    assert all(url.split("/")[3] == token for url in page.asked if "//" in url)
    refused = page.evaluate("fetch('https://example.org/').then(() => 'asked', () => 'refused')")
    assert refused == "refused"


def test_how_fast_the_page_answers(tab, capsys):
    """Printed, and not asserted but for being alive: a busy machine is no fault of the page."""
    page = tab(case=None)
    page.wait_for_selector(".chip:has-text('Verified'):not(:has-text('Not'))")
    page.wait_for_timeout(8000)  # the capability is computed meanwhile
    lines = [f"load average {os.getloadavg()[0]:.1f}"]
    for name in ("Load velocity", "Roll-off corner", "Limit of M_s", "Wave height", "Peak period",
                 "Heading", "Depth", "Telemetry"):  # fmt: skip
        page.get_by_role("slider", name=name).focus()
        taken = []
        for _ in range(9):
            page.evaluate(TIMED)
            page.keyboard.press("ArrowRight")
            taken.append(page.evaluate("window.found"))
            page.wait_for_timeout(300)
        assert min(taken) > 0.0
        lines.append(f"{name:16s} median {statistics.median(taken):4.0f} ms, {min(taken):.0f} to "
                     f"{max(taken):.0f}")  # fmt: skip
    with capsys.disabled():
        print("", *lines, sep="\n")
