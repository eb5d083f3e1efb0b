"""`evplace report` after `evplace evaluate`, as a person types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conftest import make_drive, write_drive
from evplace.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two results of a map of images."""
    folder = tmp_path_factory.mktemp("report")
    write_drive(folder, "day", make_drive(windows=20))
    write_drive(folder, "night", make_drive(seed=1, windows=20))
    day = [f"{folder}/day.aedat4", "--track", f"{folder}/day.csv"]
    night = [f"{folder}/night.aedat4", "--track", f"{folder}/night.csv"]
    assert main(["train", *day, "-o", f"{folder}/street.evp", "--scorer", "ncc"]) == 0
    for matcher in ("best", "local"):
        out = ["-o", f"{folder}/results/{matcher}", "--matcher", matcher]
        assert main(["evaluate", f"{folder}/street.evp", *night, *out]) == 0
    return folder / "results"


def test_results_become_a_page(results: Path, tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    assert (results / "best" / "pr_curve.png").read_bytes().startswith(b"\x89PNG")
    assert main(["report", str(results)]) == 0
    output = capsys.readouterr().out
    assert f"{results}/report.html: open it" in output
    assert f"{results}/report-route.png" in output
    assert main(["report", f"{results}/best", "-o", f"{tmp_path}/best.html", "--json"]) == 0
    written = json.loads(capsys.readouterr().out)
    assert written["page"] == f"{tmp_path}/best.html"
    assert "data:image/png;base64" in Path(written["page"]).read_text()


def test_faults_are_one_line(results: Path, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "table2.json").write_text('{"format": "evplace-table-9"}')
    (tmp_path / "empty").mkdir()
    cases = {"none": "no folder", "empty": "nothing to report on", ".": "newer version"}
    for name, words in cases.items():
        assert main(["report", str(tmp_path / name)]) == 2
        message = capsys.readouterr().err
        assert words in message
        assert len(message.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "table2.json"]


def test_the_reference_drive_lends_a_networks_map_its_images(results: Path, tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    folder = results.parent
    day = [f"{folder}/day.aedat4", "--track", f"{folder}/day.csv"]
    night = [f"{folder}/night.aedat4", "--track", f"{folder}/night.csv"]
    assert main(["images", *day, "-o", f"{tmp_path}/day"]) == 0
    assert (
        main(
            [
                "train",
                *day,
                "-o",
                f"{tmp_path}/net.evp",
                "--scorer",
                "network",
                "--steps",
                "2",
                "--batch",
                "8",
            ]
        )
        == 0
    )
    command = ["evaluate", f"{tmp_path}/net.evp", *night, "-o", f"{tmp_path}/r"]
    assert main([*command, "--reference", f"{tmp_path}/day"]) == 0
    assert (tmp_path / "r" / "samples.npy").exists()


def test_the_reference_drive_is_told_to_evaluate(results: Path, tmp_path: Path, capsys: Capture) -> None:
    folder = results.parent
    command = ["evaluate", f"{folder}/street.evp", f"{folder}/night.aedat4", "-o", f"{tmp_path}/r"]
    assert main([*command, "--reference", str(tmp_path)]) == 2
    assert "traverse" in capsys.readouterr().err
    assert not (tmp_path / "r").exists()
