"""The page in a real browser: every part is drawn, every control does its work, nothing is complained of."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from typing import Any

import pytest
from made_results import make_result, make_unanswered, write_run

from conftest import HANG_S
from evplace_lab.report._found import Found, look
from evplace_lab.report._page import page

FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --enable-logging=stderr --virtual-time-budget=4000 --dump-dom"
).split()
EVIL = "<script>document.title = 'harmed'</script>"

PROBE = """
addEventListener("load", async () => {
  const found = {};
  const all = (what) => [...document.querySelectorAll(what)];
  const told = (what) => document.querySelector(what).textContent;
  all("[data-shows]")[1].click();
  found.hidden = all("[data-rule]").map((block) => block.hidden);
  const picture = document.querySelector("#panels svg[role=img]");
  picture.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
  found.by_key = told("#panels output");
  const box = picture.getBoundingClientRect();
  const spot = picture.querySelectorAll("circle")[5].getBoundingClientRect();
  const at = { clientX: spot.x + spot.width / 2, clientY: spot.y + spot.height / 2 };
  picture.dispatchEvent(new PointerEvent("pointermove", at));
  found.by_pointer = told("#panels output");
  const curves = all("#panels .panel:first-child .curve").length;
  document.querySelector("#panels .legend button").click();
  found.hides = curves - all("#panels .panel:first-child .curve").length;
  const select = document.getElementById("which");
  select.selectedIndex = 1;
  select.dispatchEvent(new Event("change"));
  const slider = document.querySelector("#looked-at input");
  slider.value = 7;
  slider.dispatchEvent(new Event("input"));
  found.slider = told("#looked-at .along output");
  await Promise.all(all("img").map((image) => image.decode()));
  found.images = all("img").map((image) => image.naturalWidth);
  found.scrolls = document.documentElement.scrollWidth > innerWidth;
  const probe = { id: "probe", textContent: JSON.stringify(found) };
  document.body.append(Object.assign(document.createElement("pre"), probe));
});
"""

Open = Callable[[str], tuple[str, list[str]]]


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Open:
    """Opens a page's text in a browser; gives the document as drawn, and what the console said."""
    found = [shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome")]
    browser = next((path for path in found if path), None)
    if browser is None:
        pytest.skip("no browser: install chromium to test the page as it is drawn")

    def open_page(text: str) -> tuple[str, list[str]]:
        folder = tmp_path_factory.mktemp("browser")
        (folder / "page.html").write_text(text, "utf-8")
        address = (folder / "page.html").as_uri()
        command = [browser, *FLAGS, f"--user-data-dir={folder / 'profile'}", address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=HANG_S, check=True)
        return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]

    return open_page


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    run = write_run(tmp_path_factory.mktemp("made") / "run")
    found = look(run)
    return page(dataclasses.replace(found, results=found.results | {EVIL: make_result(2)}))


def test_every_part_is_drawn(opened: Open, text: str) -> None:
    document, complaints = opened(text)
    assert complaints == []
    assert "<title>run</title>" in document  # the third result's name did nothing
    assert document.count('class="curve"') == 2 * 4 + 1  # three lines and a point in each panel; one result
    assert document.count("<option>") == 3
    for words in (
        "Along the drive",
        "From above",
        "right item",
        "Sample matches",
        "nearest right",
        "Query 0: item",
    ):
        assert words in document, words
    assert re.search(r'class="scale".*?<text[^>]*>\d+ m</text>', document)
    assert document.count("<figure") == 8


def test_every_control_works(opened: Open, text: str) -> None:
    policy = re.sub(r"<meta http-equiv[^>]*>", "", text)  # which would not let the probe run
    document, complaints = opened(policy.replace("</body>", f"<script>{PROBE}</script></body>"))
    assert complaints == []
    probe = re.search(r'<pre id="probe">(.*?)</pre>', document)
    assert probe
    found: dict[str, Any] = json.loads(probe[1].replace("&lt;", "<").replace("&gt;", ">"))
    assert found["hidden"] == [True, False]
    assert found["by_key"] == "events, Algorithm 1, live: recall 0.000, precision 1.000, tau1 0"
    assert found["by_pointer"] == "events, Algorithm 1, live: recall 0.500, precision 0.800, tau1 0.5"
    assert found["hides"] == 1
    assert found["slider"].startswith("Query 7: item")
    assert len(found["images"]) > 16
    assert set(found["images"]) == {16}
    assert not found["scrolls"]


def test_a_drive_without_answers_is_drawn(opened: Open) -> None:
    document, complaints = opened(page(Found("nothing", None, None, None, {"nothing": make_unanswered()})))
    assert complaints == []
    assert "Query 0: no item, rejected, though known" in document


def test_a_complaint_would_be_heard(opened: Open) -> None:
    _, complaints = opened("<script>throw new Error('as expected')</script>")
    assert "as expected" in complaints[0]
    _, complaints = opened(page_with_inline_style())
    assert complaints


def page_with_inline_style() -> str:
    """A page whose own policy forbids what stands in it."""
    policy = "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'\">"
    return f"{policy}<p style='color: red'>not allowed</p>"
