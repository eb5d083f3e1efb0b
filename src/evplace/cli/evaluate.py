"""Measure how well a map finds a drive: figures, precision-recall curve, a result folder.

Examples:
  evplace evaluate campus.evp night.aedat4 --track night.nmea -o night.result
  evplace evaluate campus.evp night -o night.result --matcher seqslam
  evplace evaluate campus.evp night -o night.result --rule view       opposite directions are other views
  evplace evaluate campus.evp night -o night.result --reference day   keeps images of some matches
  evplace evaluate street.evp query/ -o q.result --truth truth.npy    a matrix, rows = queries
  evplace evaluate campus.evp dusk night rain -o results              results/dusk, results/night and so on

Many drives are evaluated several at a time; see evplace images for their names and logs. A call that was
stopped goes on where it was when it is given again, within a drive from where it was at most a minute before.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from evplace.cli._many import Made, are_many, run_many
from evplace.cli._matcher import MatcherFlags, matches_noted
from evplace.cli._output import USED_GOOD_PART, Show, note, print_facts, print_json, progress, warned
from evplace.cli._recording import DriveFlags
from evplace.cli._settings import Part
from evplace.cli._track import TrackFlags
from evplace.cli._workers import WorkerFlags
from evplace.core.errors import MissingExtraError, SettingsError
from evplace.core.storage import check_new_folder
from evplace.evaluation import MARK
from evplace.evaluation._aside import aside
from evplace.evaluation._evaluate import evaluate
from evplace.evaluation.charts import curve_chart, reliability_chart
from evplace.evaluation.truth import Truth, by_frames, by_matrix
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap

TIMINGS = {"live": "live answers", "hindsight": "answers in hindsight"}
SHOWN = (
    "queries", "left_out", "accuracy", "accuracy_seen", "rejection_rate", "false_accept_rate", "auroc",
    "within_20_m", "within_10_m", "within_5_m", "precision", "recall",
    "recall_accepted", "average_precision", "recall_at_full_precision", "recall@1", "recall@5", "recall@10",
    "recall@20", "chance", "gallery_spacing_m", "delay_images",
)  # fmt: skip
ROWS: dict[str, Literal["queries", "references"]] = {
    "query-reference": "queries",
    "reference-query": "references",
}
"""Layout -> what the rows of a matrix are."""


@dataclass(frozen=True)
class Args(WorkerFlags, MatcherFlags, TrackFlags, DriveFlags):
    """Flags of `evplace evaluate`."""

    PARTS: ClassVar[tuple[Part, ...]] = (
        *TrackFlags.PARTS, *MatcherFlags.PARTS,
    )  # fmt: skip

    map: tyro.conf.Positional[Path]
    """A map that `evplace train` wrote."""
    sources: tyro.conf.Positional[tuple[Path, ...]]
    """The query drive: an event recording, a video, a folder of images, a data set or a traverse folder; or
    several of them."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The result folder to write; for many drives, the folder of their result folders."""
    truth: Path | None = None
    """A .npy matrix of 0 and 1, queries and map items, in place of positions."""
    layout: Literal["query-reference", "reference-query"] | None = None
    """What the rows and the columns of --truth are; by default what fits its shape."""
    frames: int | None = None
    """Query and map are in step: how many items off an answer may be, in place of positions."""
    rule: Literal["places", "view", "radius"] = "places"
    """places: the paper's eight neighbours. view: also a reference within 20 m and 34 degrees. radius: at
    most --radius-m away, as is usual in the field."""
    radius_m: float = 25.0
    """For --rule radius: metres that an answer may be away."""
    answers: Literal["live", "hindsight"] = "live"
    """live: what the camera would have known as it drove. hindsight: what is known once it has arrived."""
    mask: Path | None = None
    """Pixels of this drive to leave out: a text file of x,y lines, or a .npy file."""
    reference: Path | None = None
    """The traverse that a network's map was learned from: lends the images of the sample matches."""
    scores: bool = False
    """Keep the score rows in the result."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object: all figures."""


def run(args: Args) -> int:
    """Localise the drive, measure, save and print; or many drives."""
    if are_many(args):
        return run_many("evaluate", args)
    with progress("localising") as show:
        facts, notes, code = made(args, show)
    if args.json:
        print_json(facts)
    else:
        shown = {name: facts[name] for name in SHOWN if facts.get(name) is not None}
        print_facts(f"{args.out}: {TIMINGS[args.answers]}", shown)
    for text in notes:
        note(text)
    return code


def made(args: Args, show: Show | None = None) -> Made:
    """Localise one drive, measure and save."""
    _check(args)
    place_map = PlaceMap.load(args.map)
    where = Localizer(place_map, args.matcher, args.preset, args.mask, **args.matcher_settings())
    query = _opened(args, place_map)
    reference = Traverse.load(args.reference) if args.reference is not None else None
    truth, notes = _truth(args, place_map, query)
    with warned() as warnings:
        result = evaluate(
            where, query, truth, args.rule, reference, args.answers, args.radius_m, args.scores or None, show,
            args.out.with_name(f".{args.out.name}.checkpoint"),
        )  # fmt: skip
    result.save(args.out, args.overwrite, args.scores)
    with contextlib.suppress(MissingExtraError):  # a result is whole without its picture
        curve_chart(result, args.out / "pr_curve.png")
        if result.is_probabilistic:
            reliability_chart(result, args.out / "reliability.png")
    notes += warnings + [str(guess) for guess in query.info.get("notes") or []]
    notes += [told] if (told := aside(result)) else []
    notes += matches_noted(where, result.figures["judged"], int(result.answers.accepted.sum()))
    fault = query.info.get("fault")
    notes += [f"{fault}; the good part was measured"] if fault else []
    return Made(result.figures, notes, USED_GOOD_PART if fault else 0)


def _check(args: Args) -> None:
    """What can be said before the work."""
    check_new_folder(args.out, args.overwrite, MARK)
    if args.truth is not None and args.frames is not None:
        raise SettingsError("--truth and --frames both say what is right: give one of them")
    if args.layout is not None and args.truth is None:
        raise SettingsError("--layout says what the rows of --truth are: give both")
    if args.frames is not None and args.frames < 0:
        raise SettingsError(f"--frames is how many items off an answer may be, 0 or more, not {args.frames}")


def _opened(args: Args, place_map: PlaceMap) -> Traverse:
    """The query, its images made as the map's were."""
    return place_map.open(args.sources[0], args.opened_track(), mask=args.mask, **args.reading())


def _truth(args: Args, place_map: PlaceMap, query: Traverse) -> tuple[Truth | None, list[str]]:
    """What flags say is right, and what is remarked on it."""
    if args.truth is not None:
        return _by_matrix(args, args.truth, len(query), len(place_map.items))
    if args.frames is not None:
        return by_frames(len(query), len(place_map.items), args.frames), []
    return None, []


def _by_matrix(args: Args, path: Path, n_queries: int, n_items: int) -> tuple[Truth, list[str]]:
    """The truth of a matrix; what its rows are is told where the flag does not say it."""
    truth = by_matrix(path, n_queries, n_items, ROWS[args.layout] if args.layout else None)
    taken = f"the rows of {path} are taken for"
    if args.layout is None and n_queries == n_items:
        return truth, [f"{taken} queries: --layout reference-query for the other way round"]
    if args.layout is None and truth.rule["rows"] == "references":
        return truth, [f"{taken} map items, as its shape fits so"]
    return truth, []
