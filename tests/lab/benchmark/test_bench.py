"""Other methods beside ours: what they give, in every form, is judged alike."""

from __future__ import annotations

import csv
import importlib.util
import json
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from conftest import Drive
from evplace.cli import main
from evplace.core.events import Events
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import train
from evplace.sources.writers import write_recording
from evplace_lab.benchmark import Submission, tasks_of

Capture = pytest.CaptureFixture[str]
Rows = NDArray[np.float32]


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory, day: Traverse, night: Traverse) -> Path:
    """A city of two drives of different lengths."""
    out = tmp_path_factory.mktemp("bench") / "city"
    day[:50].save(out / "day-1" / "ideal")
    night.save(out / "night-1" / "ideal")
    (out / "city.json").write_text("{}")
    return out


@pytest.fixture(scope="module")
def vectors(city: Path) -> tuple[Rows, Rows]:
    """Descriptors of both drives: the images, small."""
    drives = (Traverse.load(city / name / "ideal") for name in ("night-1", "day-1"))
    query, database = (
        np.asarray(one.images[:, ::6, ::8], np.float32).reshape(len(one), -1) for one in drives
    )
    return query, database


@pytest.fixture(scope="module")
def rows(vectors: tuple[Rows, Rows]) -> Rows:
    """(queries, references) their cosines."""
    query, database = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in vectors)
    return np.asarray(query @ database.T, np.float32)


def write_list(path: Path, rows: Rows, many: int | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("query_id", "reference_id", "rank", "score"))
        for query, row in enumerate(rows):
            for rank, item in enumerate(np.argsort(-row, kind="stable")[:many], 1):
                writer.writerow((query, item, rank, repr(float(row[item]))))


def saved(path: Path, array: Rows) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, array)


FORMS: dict[str, Callable[[Path, Rows, tuple[Rows, Rows]], None]] = {
    "scores": lambda to, rows, _: saved(to / "night-1.npy", rows),
    "turned": lambda to, rows, _: saved(to / "night-1.npy", rows.T),
    "event-lab": lambda to, rows, _: saved(to / "night-1" / "similarity_matrix.npy", rows.T),
    "distances": lambda to, rows, _: saved(to / "night-1" / "distance_matrix.npy", 1 - rows.T),
    "descriptors": lambda to, _, of: (saved(to / "night-1.npy", of[0]), saved(to / "day-1.npy", of[1]))[0],
    "gmberton": lambda to, _, of: (
        saved(to / "night-1" / "queries_descriptors.npy", of[0]),
        saved(to / "night-1" / "database_descriptors.npy", of[1]),
    )[0],
    "list": lambda to, rows, _: write_list(to / "night-1.csv", rows),
    "megaevent": lambda to, rows, _: write_list(to / "night-1" / "retrievals.csv", rows),
}


@pytest.mark.parametrize("form", FORMS)
def test_all_forms_of_the_same_scores_are_read_alike(
    form: str, city: Path, rows: Rows, vectors: tuple[Rows, Rows], tmp_path: Path
) -> None:
    FORMS[form](tmp_path / "mine", rows, vectors)
    (task,) = tasks_of(city, "ideal")
    given = Submission("mine", tmp_path / "mine").given(task)
    np.testing.assert_allclose(given.rows - given.rows.max(), rows - rows.max(), atol=1e-6)
    assert given.listed == (rows.shape[1] if "list" in given.kind else None)


def test_a_short_list_ranks_what_it_names_first(city: Path, rows: Rows, tmp_path: Path) -> None:
    write_list(tmp_path / "mine" / "night-1.csv", rows, 5)
    (task,) = tasks_of(city, "ideal")
    given = Submission("mine", tmp_path / "mine").given(task)
    assert given.listed == 5
    np.testing.assert_array_equal(np.argsort(-given.rows, axis=1)[:, 0], rows.argmax(axis=1))
    assert (given.rows.min(axis=1) < rows.min()).all()


def test_the_scores_of_ours_get_the_figures_of_ours(city: Path, tmp_path: Path, capsys: Capture) -> None:
    (task,) = tasks_of(city, "ideal")
    ncc = Localizer(train(task.database, task.places, "ncc", matcher="best"))
    saved(tmp_path / "mine" / "night-1.npy", np.asarray(ncc.answers(task.query).rows))
    (tmp_path / "mine" / "method.toml").write_text('trained_on = ["night"]')
    words = ["bench", "--city", str(city), "--method", f"mine={tmp_path}/mine", "-o", f"{tmp_path}/out"]
    assert main([*words, "--ours", "ncc", "--matchers", "best", "hmm"]) == 0
    output = capsys.readouterr().out
    assert "mine *" in output
    document = json.loads((tmp_path / "out" / "bench.json").read_text())
    by_method = {row["method"]: row for row in document["rows"]}
    assert list(by_method) == ["ncc", "mine", "mine, hmm"]
    beside = {"method", "held_out"}
    ours, theirs = ({k: v for k, v in by_method[name].items() if k not in beside} for name in ("ncc", "mine"))
    assert ours == theirs
    assert [row["held_out"] for row in document["rows"]] == [True, False, False]
    assert document["versions"]["evplace"]
    assert main(["report", f"{tmp_path}/out"]) == 0
    assert "night-1 mine" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize(
    ("write", "text"),
    [
        (lambda to: None, "there is no"),
        (lambda to: to.mkdir(), "says nothing of night-1"),
        (lambda to: saved(to / "night-1.npy", np.zeros((3, 4), np.float32)), "has the shape (3, 4)"),
        (lambda to: saved(to / "night-1.npy", np.full((60, 50), np.nan, np.float32)), "NaN or infinity"),
        (lambda to: write_list(to / "night-1.csv", np.zeros((70, 50), np.float32)), "line 3002: query 60"),
        (lambda to: (to.mkdir(), (to / "night-1.csv").write_text("a,b\n1,2\n")), "has no column query_id"),
        (
            lambda to: (
                to.mkdir(),
                (to / "night-1.csv").write_text("query_id,reference_id,rank,score\n1,x,1,2\n"),
            ),
            "line 2 cannot be read: 1,x,1,2",
        ),
    ],
)
def test_check_says_which_file_does_not_fit(
    write: Callable[[Path], object], text: str, city: Path, tmp_path: Path, capsys: Capture
) -> None:
    write(tmp_path / "mine")
    words = ["bench", "check", "--city", str(city), "--method", f"mine={tmp_path}/mine"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


def test_check_says_what_files_are_taken_for(city: Path, rows: Rows, tmp_path: Path, capsys: Capture) -> None:
    saved(tmp_path / "mine.npy", rows)
    words = ["bench", "check", "--city", str(city), "--method", f"{tmp_path}/mine.npy", "--json"]
    assert main(words) == 0
    (found,) = json.loads(capsys.readouterr().out)["files"]
    assert found == {
        "method": "mine", "query": "night-1", "kind": "scores mine.npy, query-reference", "listed": "all",
    }  # fmt: skip
    assert main(["bench", "check", "--city", str(city), "--input", "weak"]) == 2
    assert "holds no day-1/weak" in capsys.readouterr().err


def test_the_export_has_megaevents_layout_and_is_read_again(
    city: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert main(["bench", "export", "--city", str(city), "-o", str(tmp_path / "layout")]) == 0
    folder = tmp_path / "layout" / "night-1"
    assert sorted(one.name for one in folder.iterdir()) == [
        "positives.npy", "retrievals.csv", "run.json", "samples.json",
    ]  # fmt: skip
    positives = np.load(folder / "positives.npy")
    (task,) = tasks_of(city, "ideal")
    assert (positives.dtype, positives.shape) == (np.bool_, task.shape[::-1])
    header, first, *_ = (folder / "retrievals.csv").read_text().splitlines()
    assert header == "query_id,reference_id,rank,score"
    assert first.split(",")[::2] == ["0", "1"]
    given = Submission("ours", tmp_path / "layout").given(task)
    assert given.listed == 20
    right = positives.T[np.arange(len(positives.T)), given.rows.argmax(axis=1)]
    assert right[positives.any(axis=0)].mean() > 0.5


def event_lab(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Our baseline file, beside stand-ins for Event-LAB's modules."""

    class EventBaseline:
        def __init__(self) -> None:
            self.judged: list[Any] = []

        def run_metrics(
            self, names: Any, arrays: Any, truth: Any, *_: Any, **more: Any
        ) -> tuple[list[Any], Any]:
            self.judged.append((names, arrays[0].shape, truth.shape, more["matrix_type"]))
            return [], {}

        def save_results(self, *_: Any) -> None: ...

    package, module = types.ModuleType("baselines"), types.ModuleType("baselines.EventBaselineLab")
    module.EventBaseline = EventBaseline  # type: ignore[attr-defined]
    yaml = types.ModuleType("yaml")
    yaml.safe_load = lambda text: {  # type: ignore[attr-defined]  # it has one key
        line.partition(":")[0]: line.partition(":")[2].strip().strip('"')
        for line in text.splitlines()
        if line and not line.startswith("#")
    }
    for name, one in {"baselines": package, "baselines.EventBaselineLab": module, "yaml": yaml}.items():
        monkeypatch.setitem(sys.modules, name, one)
    file = Path(__file__).parents[3] / "examples" / "event-lab" / "evplace_vpr.py"
    spec = importlib.util.spec_from_file_location("evplace_vpr", file)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made.evplace_vpr_baseline()


def test_the_event_lab_baseline_saves_references_by_queries(
    made_events: tuple[Events, Events], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sequences = []
    for name, events in zip(("sunset1", "night"), made_events, strict=True):
        write_recording(tmp_path / f"{name}.h5", [events], events.size)
        about = {"sequence_name": name, "hdf5_path": str(tmp_path / f"{name}.h5"), "dataset_name": "made"}
        sequences.append(types.SimpleNamespace(get_dataset_info=lambda about=about: about))
    np.save(tmp_path / "truth.npy", np.zeros((2, 2)))
    baseline = event_lab(monkeypatch)
    size = list(made_events[0].size)
    baseline.format_data({"frame_generator": "frames"}, {"dataset": {"resolution": size}}, *sequences, 33)
    baseline.build_execute({}, {}, "truth.npy")
    baseline.run()
    baseline.parse_results("truth.npy")
    ((names, shape, _, kind),) = baseline.judged
    matrix = np.load(tmp_path / "output/evplace_vpr/made/sunset1_night/frames_33/similarity_matrix.npy")
    assert (names, shape, kind) == (["similarity_matrix"], matrix.shape, "similarity")
    assert abs(int(np.median(matrix.argmax(axis=0) - np.arange(matrix.shape[1])))) <= 1


@pytest.fixture
def made_events(night_drive: Drive) -> tuple[Events, Events]:
    from conftest import make_drive

    return make_drive().events, night_drive.events
