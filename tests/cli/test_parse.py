"""Flags over a settings file over a preset over the defaults, in every command that takes settings."""

from __future__ import annotations

import dataclasses
import importlib
import io
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
import tyro
from hypothesis import given
from hypothesis import strategies as st

from conftest import make_drive, write_drive
from evplace.cli import _modules, _parse, commands, main
from evplace.cli._settings import Pairs, SettingsFlags, pair
from evplace.core import families
from evplace.core.errors import SettingsError

Capture = pytest.CaptureFixture[str]
TAKE_SETTINGS = (
    "city", "doctor", "evaluate", "images", "localize", "map", "match", "serve", "simulate", "train",
)  # fmt: skip


def in_force(capsys: Capture, *words: object) -> dict[str, tuple[object, str]]:
    """Setting -> value and source, as a command shows them."""
    capsys.readouterr()
    assert main([*map(str, words), "--show-settings", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    return {name: (setting["value"], setting["from"]) for name, setting in shown.items()}


def fault(capsys: Capture, *words: object) -> str:
    """The one line on standard error of a command that fails."""
    capsys.readouterr()
    assert main([*map(str, words)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def args_of(command: str, *words: object) -> Any:
    """What the words of a command are read as."""
    module = importlib.import_module(_modules()[command])
    return _parse.parse(module, command, [*map(str, words)]).args


@pytest.fixture
def toml(tmp_path: Path) -> Path:
    return tmp_path / "s.toml"


def test_these_commands_take_settings() -> None:
    modules = {name: importlib.import_module(_modules()[name]) for name in commands()}
    assert tuple(n for n in sorted(modules) if issubclass(modules[n].Args, SettingsFlags)) == TAKE_SETTINGS


@pytest.mark.parametrize("command", TAKE_SETTINGS)
@pytest.mark.parametrize("joined", [False, True])
def test_a_settings_file_is_read_however_it_is_named(
    command: str, joined: bool, toml: Path, capsys: Capture
) -> None:
    words = (f"--settings={toml}",) if joined else ("--settings", toml)
    assert "cannot read the settings file" in fault(capsys, command, *words)
    toml.write_text("nothing = 1\n")
    assert f"{toml}: unknown setting 'nothing': known are " in fault(capsys, command, *words)
    name = "overwrite" if command == "serve" else "json"
    toml.write_text(f"{name} = 3\n")
    told = f"{toml}: the setting '{name}' cannot be 3: it takes true or false"
    assert told in fault(capsys, command, *words)
    toml.write_text('settings = "other.toml"\n')
    assert "unknown setting 'settings'" in fault(capsys, command, *words)


def test_the_last_of_two_files_counts(toml: Path, capsys: Capture) -> None:
    toml.write_text("seed = 3\n")
    other = toml.with_name("other.toml")
    other.write_text("seed = 4\n")
    assert in_force(capsys, "simulate", "--settings", toml, f"--settings={other}")["seed"] == (4, str(other))


# A setting, its default, a preset's value, and the two as flags.
TRAINING = [
    ("dropout", 0.0, 0.5, ("--dropout", "0"), ("--dropout=0.5",)),
    ("optimiser", "adam", "sgd", ("--optimiser=adam",), ("--optimiser", "sgd")),
    ("epochs", 0, 1000, ("--epochs", "0"), ("--epochs", "1000")),
]


@pytest.mark.parametrize(("name", "default", "preset", "as_default", "as_preset"), TRAINING)
def test_what_wins(
    toml: Path,
    capsys: Capture,
    name: str,
    default: object,
    preset: object,
    as_default: tuple[str, ...],
    as_preset: tuple[str, ...],
) -> None:
    def shown(*words: object) -> tuple[object, str]:
        return in_force(capsys, "train", *words)[f"train.{name}"]

    assert shown() == (default, "default")
    assert shown("--preset", "notebook") == (preset, "preset notebook")
    assert shown("--preset=notebook", *as_default) == (default, "flag")
    assert shown(*as_default, "--preset", "notebook") == (default, "flag")
    assert shown(*as_preset) == (preset, "flag")
    toml.write_text(f"[train]\n{name} = {json.dumps(default)}\n")
    assert shown("--settings", toml, "--preset", "notebook") == (default, str(toml))
    assert shown("--settings", toml, *as_preset) == (preset, "flag")
    toml.write_text('preset = "notebook"\n')
    assert shown("--settings", toml) == (preset, "preset notebook")
    assert shown("--settings", toml, *as_default) == (default, "flag")
    assert shown("--settings", toml, "--preset", "paper") == (default, "default")
    toml.write_text(f'preset = "notebook"\n[train]\n{name} = {json.dumps(default)}\n')
    assert shown("--settings", toml) == (default, str(toml))


@pytest.mark.parametrize(("name", "default"), [("blur", True), ("mask_hot", False)])
@pytest.mark.parametrize("of_file", [True, False])
def test_a_switch_wins_over_the_file_both_ways(
    toml: Path, capsys: Capture, name: str, default: bool, of_file: bool
) -> None:
    table = "images" if name == "blur" else "cleaning"
    toml.write_text(f"[{table}]\n{name} = {str(of_file).lower()}\n")
    for flag, value in ((f"--{name}".replace("_", "-"), True), (f"--no-{name}".replace("_", "-"), False)):
        for words in (("--settings", toml, flag), (flag, "--settings", toml)):
            assert in_force(capsys, "images", *words)[f"{table}.{name}"] == (value, "flag")
    assert in_force(capsys, "images", "--settings", toml)[f"{table}.{name}"] == (of_file, str(toml))
    assert in_force(capsys, "images")[f"{table}.{name}"] == (default, "default")


def test_settings_of_parts_are_alike_by_flag_and_by_file(toml: Path, capsys: Capture) -> None:
    toml.write_text('matcher = "seqslam"\npreset = "openseqslam2"\n[set]\nds = 11\nv_min = 1\n')
    by_flags = ("--matcher", "seqslam", "--preset=openseqslam2", "--set", "ds=11", "--set=v_min=1")
    for command in ("localize", "evaluate", "match"):
        flags = in_force(capsys, command, *by_flags)
        of_file = in_force(capsys, command, "--settings", toml)
        assert {name: value for name, (value, _) in flags.items()} == {
            name: value for name, (value, _) in of_file.items()
        }
        assert (flags["set.ds"], of_file["set.ds"]) == ((11, "flag"), (11, str(toml)))
        both = in_force(capsys, command, "--settings", toml, "--set", "ds=15")
        assert (both["set.ds"], both["set.v_min"]) == ((15, "flag"), (1.0, str(toml)))
    sensor = in_force(capsys, "simulate", "--preset", "weak", "--set", "threshold_on=0.15")
    assert sensor["set.threshold_on"] == (0.15, "flag")
    assert "preset weak" in {source for _, source in sensor.values()}


def test_text_in_a_table_stays_text(toml: Path, capsys: Capture) -> None:
    toml.write_text('scorer = "ncc"\n[set]\nsigma = "2"\n')
    told = fault(capsys, "train", "--show-settings", "--settings", toml)
    assert f"{toml}: the setting 'sigma' cannot be '2': it takes a number" in told
    assert "cannot be '2'" in fault(capsys, "train", "--show-settings", "--scorer=ncc", "--set", 'sigma="2"')


def test_the_settings_of_a_tracks_format(tmp_path: Path, toml: Path, capsys: Capture) -> None:
    write_drive(tmp_path, "day", make_drive(windows=4))
    track = json.dumps(str(tmp_path / "day.csv"))
    toml.write_text(f'track = {track}\ntrack_preset = "nordland"\n[track_set]\ntime = "when"\n')
    for command in ("images", "train", "evaluate", "doctor"):
        shown = in_force(capsys, command, "--settings", toml)
        assert shown["track_set.time"] == ("when", str(toml))
        assert shown["track_set.latitude"] == ("lat", "preset nordland")
        assert "known are" in fault(
            capsys, command, "--settings", toml, "--show-settings", "--track-set", "a=1"
        )
    assert "has no preset 'moon': known are nordland" in fault(
        capsys, "images", "--settings", toml, "--show-settings", "--track-preset", "moon"
    )


@pytest.mark.parametrize(
    ("command", "words", "wanted"),
    [
        ("train", ("--scorer", "nc"), families.names("scorers")),
        ("match", ("--matcher", "fab-map"), families.names("matchers")),
        ("localize", ("--set", "k=5"), ["false_accept", "lag_s"]),
        ("localize", ("--matcher", "local", "--set", "k=5"), ["K", "tau1", "last_item"]),
        ("evaluate", ("--matcher", "graph", "--set", "k=5"), ["K", "alpha"]),
        ("train", ("--scorer", "ncc", "--set", "width=wide"), ["'wide'"]),
        ("train", ("--preset", "night"), ["notebook", "paper"]),
        ("match", ("--preset", "opr"), ["notebook", "paper"]),
        ("simulate", ("--preset", "strong"), ["ideal", "weak", "from-8bit"]),
        ("simulate", ("--set", "threshold=1"), ["threshold_on"]),
        ("match", ("--set", "K"), ["name=value"]),
    ],
)
def test_wrong_names_list_the_known(
    capsys: Capture, command: str, words: tuple[str, ...], wanted: list[str]
) -> None:
    told = fault(capsys, command, "--show-settings", *words)
    assert all(word in told for word in wanted), told


def test_the_help_shows_all_parts_and_presets(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    for command, family in (
        ("train", "scorers"),
        ("images", "datasets"),
        ("doctor", "datasets"),
        *((c, "matchers") for c in ("localize", "evaluate", "match")),
    ):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told = capsys.readouterr().out
        assert f"{{{','.join(families.names(family))}}}" in told
        for part in families.names(family):
            assert all(preset in told for preset in getattr(families.load(family, part), "PRESETS", ()))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("images = 3", "the setting 'images' cannot be 3: it is a table, [images]"),
        ("[images]\nblur = 3", "'images.blur' cannot be 3: it takes true or false"),
        ("[images]\nwidth = 1.5", "'images.width' cannot be 1.5: it takes a whole number"),
        ("[images]\nwidth = true", "'images.width' cannot be True: it takes a whole number"),
        ("[images]\nwidth = [1, 2]", "'images.width' cannot be [1, 2]: it takes a whole number"),
        ("[images]\ntau_ms = nan", "'images.tau_ms' cannot be nan: it takes a number"),
        ("[images]\ntau_ms = 1" + "0" * 400, "it takes a number"),
        ('[images]\nresize = "round"', "'images.resize' cannot be 'round': it takes 'area', 'linear'"),
        ("[images]\nwidht = 5", "unknown setting 'images.widht': did you mean 'width'?"),
        ("[images.width]\nx = 5", "'images.width' cannot be {'x': 5}"),
        ("[images]\nwidth = 0", "'width' cannot be 0"),
        ('[windows]\ndt = "soon"', "'dt' cannot be 'soon'"),
        ('dt = "1/30"', "unknown setting 'dt': did you mean 'windows.dt'?"),
        ("[colours]", "unknown setting 'colours': did you mean 'columns'? known are "),
        ("size = 3", "'size' cannot be 3: it takes a list of 2, each a whole number"),
        ("size = [3]", "'size' cannot be [3]"),
        ("size = [3, 4, 5]", "'size' cannot be [3, 4, 5]"),
        ("size = [3, true]", "'size' cannot be [3, True]"),
        ('size = "3 4"', "'size' cannot be '3 4'"),
        ("mask = 3", "'mask' cannot be 3: it takes a path"),
        ("fps = inf\nfps = 3", "is not TOML"),
        ('fps = "30"', "'fps' cannot be '30': it takes a number"),
        ("fps = nan", "'fps' cannot be nan"),
        ("track_set = 3", "'track_set' cannot be 3: it takes a table"),
        ('track_set = ["time=t"]', "it takes a table"),
        ("overwrite = 1", "'overwrite' cannot be 1: it takes true or false"),
        ("show_settings = true", "unknown setting 'show_settings'"),
        ("given = []", "unknown setting 'given'"),
    ],
)
def test_what_is_wrong_with_a_file(toml: Path, capsys: Capture, text: str, wanted: str) -> None:
    toml.write_text(text)
    told = fault(capsys, "images", "--show-settings", "--settings", toml)
    assert wanted in told
    assert str(toml) in told


TOML = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=5,
)


@pytest.mark.parametrize(
    ("command", "text", "flags", "wanted"),
    [
        ("train", 'preset = "moon"', (), "{}: there is no preset 'moon'"),
        (
            "train",
            'preset = "sun"',
            ("--preset", "moon"),
            "evplace: there is no preset 'moon'",
        ),
        ("train", 'scorer = "moon"', (), "{}: 'moon' is none of the scorers"),
        ("train", 'scorer = "sun"', ("--scorer", "moon"), "evplace: 'moon' is none of the scorers"),
        ("match", 'preset = "moon"', (), "{}: the matcher 'local' has no preset 'moon'"),
        ("match", "[set]\nmoon = 1", (), "{}: unknown setting 'moon'"),
        ("match", "[set]\nK = 1", ("--set", "moon=1"), "evplace: unknown setting 'moon'"),
        ("match", "[set]\nK = 1", ("--set=moon=1", "--preset", "paper"), "evplace: unknown setting 'moon'"),
        ("match", "[set]\nds = 11", ("--matcher=best",), "{}: unknown setting 'ds'"),
        ("simulate", 'preset = "moon"', (), "{}: the sensor has no preset 'moon'"),
        ("images", '"new\\nline" = 1', (), "{}: unknown setting 'new line'"),
    ],
)
def test_the_file_is_named_where_it_is_wrong(
    toml: Path, capsys: Capture, command: str, text: str, flags: tuple[str, ...], wanted: str
) -> None:
    toml.write_text(text)
    assert wanted.format(toml) in fault(capsys, command, "--show-settings", "--settings", toml, *flags)


@given(data=st.data(), command=st.sampled_from(TAKE_SETTINGS), value=TOML)
def test_any_value_of_any_key_is_taken_or_refused(data: st.DataObject, command: str, value: object) -> None:
    kind = importlib.import_module(_modules()[command]).Args
    hints = get_type_hints(kind)
    key = data.draw(st.sampled_from([field.name for field in dataclasses.fields(kind)]))
    values = {key: value}
    if dataclasses.is_dataclass(hints[key]):
        inner = [field.name for field in dataclasses.fields(hints[key])]
        values = {key: {data.draw(st.sampled_from(inner)): value}}
    try:
        _parse._default(kind, _parse._First(Path("s.toml")), values)
    except SettingsError as error:
        assert str(error).startswith("s.toml: ")  # noqa: PT017 - both outcomes are right


def test_a_file_may_hold_all_that_flags_can_say(tmp_path: Path, toml: Path, capsys: Capture) -> None:
    write_drive(tmp_path, "day", make_drive(windows=4))
    toml.write_text(
        f'sources = ["{tmp_path / "day.aedat4"}"]\nout = "{tmp_path / "t"}"\nsize = [80, 60]\njson = true\n'
        '[windows]\ndt = "1/15"\n'
    )
    capsys.readouterr()
    assert main(["images", "--settings", str(toml)]) == 0
    assert json.loads(capsys.readouterr().out)["images"] == 2
    told = fault(capsys, "images", "--settings", toml, tmp_path / "none.aedat4", "--overwrite")
    assert "none.aedat4" in told


def orders(words: list[str], more: list[list[str]]) -> Iterator[list[str]]:
    """The words that stand by themselves with groups of other words in every gap between them."""
    for first in range(len(words) + 1):
        for second in range(first, len(words) + 1):
            yield [*words[:first], *more[0], *words[first:second], *more[1], *words[second:]]


@pytest.mark.parametrize(
    ("command", "names", "out"),
    [
        ("convert", ("source", "target"), []),
        ("info", ("path",), []),
        ("doctor", ("recording",), []),
        ("localize", ("map", "source"), []),
        ("evaluate", ("map", "sources"), ["-o", "r"]),
        ("images", ("sources",), ["-o", "r"]),
        ("train", ("sources",), ["--out=r"]),
    ],
)
def test_a_flag_of_two_values_stands_anywhere(command: str, names: tuple[str, ...], out: list[str]) -> None:
    words = [f"{name}.x" for name in names]
    for size in (["--size", "640", "480"], ["--size=640", "480"]):
        for line in orders(words, [size, ["--json", *out]]):
            args = args_of(command, *line)
            assert args.size == (640, 480)
            read = [
                Path(word) if name != "sources" else (Path(word),)
                for name, word in zip(names, words, strict=True)
            ]
            assert [getattr(args, name) for name in names] == read


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_what_is_wrong_with_flags_is_told_plainly(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch, encoding: str
) -> None:
    """Whether or not the terminal can show frames."""
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding))
    for words, wanted in (
        (("convert", "a"), "Missing from evplace convert: PATH The file to write"),
        (("info", "a", "--size", "3"), "Missing value for argument '--size'. Expected 2 values"),
        (("info", "a", "--time-unit", "h"), "invalid choice 'h' for argument '--time-unit'"),
        (
            ("train", "a", "-o", "b", "--dropout", "some"),
            "Error parsing --dropout: could not convert string to float: 'some'",
        ),
        (("train", "a", "-o", "b", "--bogus"), "Unrecognized options: --bogus"),
        (("train", "--settings"), "Missing value for argument '--settings'. Expected 1 values"),
    ):
        assert main([*words]) == 2
        told = capsys.readouterr().err
        assert told.startswith(f"evplace: {wanted}")
        assert told.endswith(f"; see evplace {words[0]} --help\n")
        assert not set(told) & set("│╭─")
        assert " --- " not in told


def test_a_flag_of_too_few_values_is_told(capsys: Capture) -> None:
    assert "--size" in fault(capsys, "info", "a.raw", "--size", "640")
    assert "--size" in fault(capsys, "info", "a.raw", "--size", "640", "--json")
    assert "--size" in fault(capsys, "info", "a.raw", "--size", "640", "x")


def test_a_flag_of_any_number_of_values_says_what_it_took(capsys: Capture) -> None:
    told = fault(capsys, "reproduce", "--inputs", "events", "colour", "table2", "-o", "x")
    assert "--inputs takes all words after it" in told
    assert "--figures takes all words after it" in fault(capsys, "compare", "--figures", "accuracy", "a", "b")
    assert args_of("reproduce", "table2", "-o", "x", "--inputs", "events", "colour").inputs == (
        "events",
        "colour",
    )
    assert args_of("reproduce", "--inputs", "events", "colour", "-o", "x", "table2").name == "table2"


def test_nothing_is_done_where_settings_are_shown(tmp_path: Path, toml: Path, capsys: Capture) -> None:
    np.save(tmp_path / "scores.npy", np.eye(4))
    words = ["match", f"{tmp_path}/scores.npy", "-o", f"{tmp_path}/m.csv"]
    assert main([*words, "--show-settings"]) == 0
    told = capsys.readouterr().out
    assert "set.tau1" in told
    assert "default" in told
    assert not (tmp_path / "m.csv").exists()
    assert main(words) == 0


def test_settings_of_parts_are_checked_before_the_work(tmp_path: Path, capsys: Capture) -> None:
    for words in (
        ("train", "none.aedat4", "-o", tmp_path / "m", "--scorer", "ncc", "--set", "width=wide"),
        (
            "evaluate",
            "none.evp",
            "none.aedat4",
            "-o",
            tmp_path / "r",
            "--matcher",
            "local",
            "--set",
            "K=wide",
        ),
        ("simulate", "none.mp4", "-o", tmp_path / "s.npz", "--set", "threshold_on=wide"),
    ):
        assert "cannot be 'wide'" in fault(capsys, *words)


def test_words_after_two_dashes_are_no_flags() -> None:
    args = args_of("images", "-o", "x", "--dt", "1/30", "--", "--width")
    assert args.sources == (Path("--width"),)
    assert "dt" in args.given
    assert "width" not in args.given


def test_nan_is_refused_by_its_flag(capsys: Capture) -> None:
    for words, flag in (
        (("train", "--cell-m", "nan"), "--cell-m"),
        (("simulate", "--fps=nan"), "--fps"),
        (("images", "--track-offset", "nan"), "--track-offset"),
        (("train", "--dropout", "nan"), "--dropout"),
    ):
        assert f"{flag} cannot be nan" in fault(capsys, *words, "--show-settings")


def test_pairs() -> None:
    assert dict(map(pair, ["K=5", "kind=a", "wrap=true", "tau=1e-3", "text=a=b"])) == {
        "K": 5, "kind": "a", "wrap": True, "tau": 0.001, "text": "a=b",
    }  # fmt: skip
    for wrong in ("K", "=5"):
        with pytest.raises(SettingsError, match="name=value"):
            pair(wrong)
    assert tyro.cli(Pairs, args=[]) == ()
