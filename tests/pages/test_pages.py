"""What the pages say to type is typed, on made drives; what takes a city, a camera or an hour is read."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import sys
import tomllib
import types
from collections.abc import Callable
from pathlib import Path

import pytest

from evplace.cli import _modules, main
from evplace.cli._parse import parse
from made_pages import ROOT, Block, blocks, pages, write_city, write_drives

ONLY_READ = {
    "evplace city": "drives for minutes",
    "evplace bench robustness": "drives for minutes",
    "evplace report out": "shows what that has made",
    "evplace demo": "drives for minutes",
    "evplace sample": "drives for a minute",
    "evplace reproduce": "trains for an hour",
    "evplace images /shared/": "needs a cluster",
    "evplace serve": "goes on until it is stopped",
    "evplace localize campus.evp udp:": "goes on until it is stopped",
    "evplace localize campus.evp zenoh:": "goes on until it is stopped",
}
"""Beginning of a command -> why its words are read, and nothing is done."""
GOES_ON = "for as long as the camera runs"
"""The title of what is written in Python and does not end: it is compiled alone."""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recordings by day and by night, their traverses, the map and its result."""
    folder = tmp_path_factory.mktemp("pages")
    write_drives(folder)
    before = Path.cwd()
    os.chdir(folder)
    try:
        for name in ("day", "night"):
            assert main(f"images {name}.aedat4 --track {name}.nmea -o {name}".split()) == 0
        assert main("train day -o campus.evp".split()) == 0
        assert main("evaluate campus.evp night -o night.result".split()) == 0
        write_city(folder / "city", folder / "day", folder / "night")
    finally:
        os.chdir(before)
    return folder


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", [page for page in pages() if blocks(page)], ids=name_of)
def test_what_a_page_says_to_type(
    page: Path, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    shutil.copytree(made, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    module = types.ModuleType("typed_on_a_page")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    said = ""
    capsys.readouterr()
    for block in blocks(page):
        if block.language == "sh":
            said = "".join(typed(words, block, capsys) for words in block.lines())
        elif block.language == "python":
            for output in re.findall(r"\.save\(\"(.*)\"\)", block.text):
                remove(Path(output))
            code = compile(block.text, name_of(page), "exec", dont_inherit=True)
            if block.title != GOES_ON:
                exec(code, vars(module))
            said = capsys.readouterr().out
        elif block.language == "text":
            check_said(block, said)
        else:
            assert block.language == "toml", f"{name_of(page)}: nobody reads '{block.language}'"
            if block.title:
                Path(block.title).write_text(block.text)


def typed(words: list[str], block: Block, capsys: Capture) -> str:
    """What a command says."""
    program = words[0] if not words[0].startswith(("scripts/", "examples/")) else "scripts"
    assert program in PROGRAMS, f"nobody knows how to try `{' '.join(words)}`"
    expected = int(block.title.removeprefix("exit code ")) if block.title.startswith("exit code") else 0
    if expected == 0 and "-o" in words and not only_read(words):
        remove(Path(words[words.index("-o") + 1]))
    code = PROGRAMS[program](words)
    said = "".join(capsys.readouterr())
    assert code == expected, f"`{' '.join(words)}` ended with {code}: {said}"
    return said


def evplace(words: list[str]) -> int:
    """The command itself, or its words alone."""
    if only_read(words):
        parse(importlib.import_module(_modules()[words[1]]), words[1], words[2:])
        return 0
    return main(words[1:])


def only_read(words: list[str]) -> bool:
    return any(" ".join(words).startswith(begin) for begin in ONLY_READ)


def remove(path: Path) -> None:
    """An output of this name that another page has made."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def pip(words: list[str]) -> int:
    """Every extra that is asked for exists."""
    assert words[1] == "install"
    for wanted in words[2:]:
        for extra in re.findall(r"\[(.*)\]", wanted):
            assert set(extra.split(",")) <= set(PROJECT["optional-dependencies"]), wanted
    return 0


def python(words: list[str]) -> int:
    """The script exists and knows the flags."""
    script = (ROOT / words[1]).read_text()
    for flag in (word for word in words[2:] if word.startswith("--")):
        assert re.search(rf"(--|\b){flag[2:].replace('-', '[-_]')}\b", script), f"{words[1]} knows no {flag}"
    return 0


def script(words: list[str]) -> int:
    """It can be started."""
    assert os.access(ROOT / words[0], os.X_OK), words[0]
    return 0


PROGRAMS: dict[str, Callable[[list[str]], int]] = {
    "evplace": evplace,
    "pip": pip,
    "python": python,
    "ray": lambda _: 0,  # another program's words
    "scripts": script,
}
"""Program -> how a line of it is tried."""


def check_said(block: Block, said: str) -> None:
    """Each line of the block was printed, in any place; `...` stands for what differs."""
    printed = " ".join(said.split())
    for line in block.text.splitlines():
        parts = [re.escape(" ".join(part.split())) for part in line.split("...")]
        assert re.search(r".*?".join(parts), printed), f"'{line}' was not said, but:\n{said}"
