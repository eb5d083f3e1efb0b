"""The page in a real browser, while a drive is replayed to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from conftest import Drive
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.sources.live import Live, open_live
from evplace.sources.live.replay import Replaying
from evplace.sources.writers import write_recording

pytest.importorskip("starlette", reason="the page needs the extra 'web': pip install 'evplace[web]'")
pytest.importorskip("uvicorn", reason="the page needs the extra 'web': pip install 'evplace[web]'")
pytest.importorskip("websockets", reason="the page needs the extra 'web': pip install 'evplace[web]'")

from browser import DESKTOP, PHONE, Tab, opened
from served import Served, serving

SHOWN = """(() => {
  const canvas = document.getElementById("now");
  const copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  Object.assign(copy.canvas, { width: canvas.width, height: canvas.height });
  copy.drawImage(canvas, 0, 0);
  const data = copy.getImageData(0, 0, canvas.width, canvas.height).data;
  let sum = 0;
  for (let at = 0; at < data.length; at += 4) sum = (sum * 31 + data[at]) % 1000003;
  return sum;
})()"""
"""A number that changes with the event image."""
STATE = "document.body.dataset.state"
ENDED = "document.getElementById('link-words')?.textContent === 'ended'"


@pytest.fixture
def served(image_map: PlaceMap, night_drive: Drive, tmp_path: Path) -> Iterator[Served]:
    image_map.save(tmp_path / "street.evp")
    write_recording(tmp_path / "night.raw", [night_drive.events], (80, 60))
    source = open_live(str(tmp_path / "night.raw"), loops=0, speed=0.5)
    with serving(image_map, tmp_path / "street.evp", source) as service:
        yield service


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A street of the city: a map by day, and the recording and the traverse of the same drive by night."""
    from evplace_lab.city import CitySettings, generate

    out = tmp_path_factory.mktemp("town")
    small = CitySettings(
        conditions=("day", "night"), paths=(1,), sensors=("ideal",), fps=30, width=64, height=48,
        route_length_m=60.0, keep_events=True,
    )  # fmt: skip
    generate(out / "city", small, workers=1)
    day = Traverse.load(out / "city" / "day-1" / "ideal")
    assert day.track is not None
    train(day, PlaceGrid.from_track(day.track)).save(out / "street.evp")
    return out


@pytest.fixture
def tab(tmp_path: Path) -> Iterator[Tab]:
    with opened(tmp_path / "profile") as one:
        yield one


def open_page(tab: Tab, served: Served) -> None:
    tab.open(f"http://127.0.0.1:{served.port}/")
    tab.wait(f"document.body && {STATE} === 'localised'")


def elsewhere(tab: Tab, served: Served) -> list[str]:
    """What was asked of others than the service."""
    asked = [url for url in tab.requests if not url.startswith(("data:", "about:"))]
    return [url for url in asked if urlsplit(url).netloc != f"127.0.0.1:{served.port}"]


def test_a_drive_is_seen_as_it_goes(tab: Tab, served: Served) -> None:
    tab.look(DESKTOP)
    open_page(tab, served)
    first, place = tab.value(SHOWN), tab.value("document.getElementById('words').textContent")
    assert place.startswith("At place ")
    tab.wait(f"{SHOWN} !== {first}")
    tab.wait(f"document.getElementById('words').textContent !== {place!r}")
    tab.wait("document.getElementById('reference').naturalWidth === 160")
    tab.wait("document.getElementById('reference-name').textContent.startsWith('· place ')")
    assert tab.value("document.getElementById('latency').textContent").endswith(" ms")
    assert tab.value("document.getElementById('utm').textContent").endswith(" m")
    label = "document.getElementById('route').getAttribute('aria-label')"
    tab.wait(f"{label}.startsWith('The route from above: At place ')")
    assert tab.value("document.getElementById('spoken').textContent").startswith("At place ")
    assert tab.complaints == []
    assert elsewhere(tab, served) == []


HERE = "document.getElementById('utm')?.textContent"
HERE_SHOWN = f"{HERE} !== '–' && {HERE}"


def seen_at(tab: Tab) -> tuple[float, float]:
    """Easting and northing as the page shows them."""
    text: str = tab.wait(HERE_SHOWN)
    easting, northing = text.removesuffix(" m").split(", ")
    return float(easting), float(northing)


def test_a_street_by_night_is_driven_along_the_map_of_the_day(tab: Tab, town: Path) -> None:
    """What the page shows is where the car was; it is there again when the page is loaded again."""
    night = Traverse.load(town / "city" / "night-1" / "ideal")
    place_map = PlaceMap.load(town / "street.evp")
    source = open_live(str(town / "city" / "night-1" / "ideal.aedat4"))
    assert isinstance(source, Replaying)
    source.change(paused=True)
    tab.look(DESKTOP)
    with serving(place_map, town / "street.evp", source, matcher=None) as served:
        tab.open(f"http://127.0.0.1:{served.port}/")
        tab.wait("document.getElementById('link-words')?.textContent === 'paused'")
        tab.value("document.getElementById('pause').click()")
        pictures, shown = set(), [seen_at(tab)]
        while not tab.value(ENDED):
            pictures.add(tab.value(SHOWN))
            shown.append(seen_at(tab))
            tab.wait(f"{HERE} !== '{shown[-1][0]:.1f}, {shown[-1][1]:.1f} m' || {ENDED}")
        away = np.hypot(*(night.xy[:, None] - np.array(shown)).transpose(2, 0, 1))
        assert away.min(axis=0).max() < 5
        along = away.argmin(axis=0)
        found = along[along.argmin() :]  # the first images alone may be of other places a few metres away
        assert len(found) > len(along) // 2
        assert found[-1] - found[0] > len(night) // 2
        assert (np.diff(found) >= -3).all()
        assert len(pictures) > 3
        assert "m along the route" in tab.value("document.getElementById('more').textContent")
        tab.call("Page.reload")
        assert seen_at(tab) == shown[-1]
        tab.wait(ENDED)
        assert tab.complaints == []
        assert elsewhere(tab, served) == []


@pytest.mark.parametrize("kind", [DESKTOP, PHONE])
@pytest.mark.parametrize("dark", [False, True])
def test_it_fits_the_screen_in_both_colours(
    tab: Tab, served: Served, kind: tuple[int, int, bool], dark: bool
) -> None:
    tab.look(kind, dark)
    open_page(tab, served)
    assert tab.value("document.documentElement.scrollWidth <= innerWidth")
    light = tab.value("getComputedStyle(document.body).backgroundColor")
    assert (light == "rgb(14, 19, 25)") == dark
    for name in ("route", "history", "now"):
        width, height = tab.value(
            f"(c => [c.clientWidth, c.clientHeight])(document.getElementById('{name}'))"
        )
        assert width > 100
        assert height > 50
    assert tab.complaints == []


def test_a_replay_is_controlled_by_keyboard(tab: Tab, served: Served) -> None:
    tab.look(DESKTOP)
    open_page(tab, served)
    tab.wait("!document.getElementById('replay').hidden")
    for _ in range(30):
        if tab.value("document.activeElement.id") == "pause":
            break
        press(tab, "Tab", 9)
    assert tab.value("document.activeElement.id") == "pause"
    press(tab, " ", 32)
    tab.wait("document.getElementById('pause').textContent === 'Go on'")
    tab.wait("document.getElementById('link-words').textContent === 'paused'")
    assert served.json("/state")["source"]["replay"]["paused"] is True
    press(tab, " ", 32)
    tab.wait("document.getElementById('pause').textContent === 'Pause'")
    tab.value(
        "(s => { s.value = '2'; s.dispatchEvent(new Event('change')); })(document.getElementById('speed'))"
    )
    served.until(lambda: served.json("/state")["source"]["replay"]["speed"] == 2.0)
    assert tab.complaints == []


def press(tab: Tab, key: str, code: int) -> None:
    text = {"text": key} if len(key) == 1 else {}
    for kind in ("keyDown", "keyUp"):
        tab.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **text)


def test_a_page_with_a_token_is_whole(
    tab: Tab, image_map: PlaceMap, night_drive: Drive, tmp_path: Path
) -> None:
    """The token of its address is that of all it asks."""
    image_map.save(tmp_path / "street.evp")
    write_recording(tmp_path / "night.raw", [night_drive.events], (80, 60))
    source = open_live(str(tmp_path / "night.raw"), loops=0, speed=0.5)
    with serving(image_map, tmp_path / "street.evp", source, token="a/s&+ecret") as served:
        tab.open(f"http://127.0.0.1:{served.port}/?token=a%2Fs%26%2Becret")
        tab.wait(f"document.body && {STATE} === 'localised'")
        tab.wait("document.getElementById('reference').naturalWidth === 160")
        assert tab.value("getComputedStyle(document.body).margin") == "0px"
        assert tab.complaints == []


def test_it_connects_again_by_itself(
    tab: Tab, image_map: PlaceMap, night_drive: Drive, tmp_path: Path
) -> None:
    """A service that is started again at the same port is found, and so is the drive."""
    image_map.save(tmp_path / "street.evp")
    write_recording(tmp_path / "night.raw", [night_drive.events], (80, 60))

    def source() -> Live:
        return open_live(str(tmp_path / "night.raw"), loops=0, speed=0.5)

    tab.look(DESKTOP)
    with serving(image_map, tmp_path / "street.evp", source()) as first:
        port = first.port
        open_page(tab, first)
    tab.wait("document.getElementById('link').dataset.link === 'lost'")
    before = tab.value("document.getElementById('played').textContent")
    with serving(image_map, tmp_path / "street.evp", source(), at_port=port):
        tab.wait("document.getElementById('link').dataset.link === 'live'")
        tab.wait(f"document.getElementById('played').textContent !== {before!r}")
        tab.wait(f"{STATE} === 'localised'")
