"""Match a matrix of scores, or of distances, and write the matches as csv.

Examples:
  evplace match scores.npy -o matches.csv
  evplace match scores.npy --matcher graph --set K=5 --set alpha=0.3 --set m=2.6 -o matches.csv
  evplace match distances.npy --distances --matcher seqslam --preset openseqslam2 -o matches.csv

The matrix has queries as rows and references as columns, unless --layout reference-query; both in the order
of their drives. The csv has query,reference,score,accepted; both count from 0, and the reference is -1 where
there is none.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from evplace.cli._output import note, say
from evplace.cli._settings import Pairs, Part, SettingsFlags, a_part_of, a_preset_of
from evplace.core import families
from evplace.matchers import Matcher, _files
from evplace.matchers._checks import check_path
from evplace.matchers._look import ScoreLook


@dataclass(frozen=True)
class Args(SettingsFlags):
    """What `evplace match` can be told."""

    PARTS: ClassVar[tuple[Part, ...]] = (Part.of("matchers", "matcher", preset="preset"),)

    scores: tyro.conf.Positional[Path]
    """A .npy file; larger is better, unless --distances."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The csv file to write."""
    matcher: Annotated[str, a_part_of("matchers")] = "local"
    """How score rows become answers; `evplace list matchers` says what each does."""
    preset: Annotated[str | None, a_preset_of("matchers")] = None
    """A preset of the matcher."""
    set: Pairs = ()
    """A setting of the matcher over those of the preset, as name=value."""
    layout: Literal["query-reference", "reference-query"] | None = None
    """What its rows and columns are; query-reference unless given."""
    distances: bool = False
    """Smaller is better."""
    overwrite: bool = False
    """Replace the output if it exists."""
    json: bool = False
    """Print the figures as one JSON object."""


def run(args: Args) -> int:
    """Match the whole matrix, a block of rows at a time; 0, or an EvplaceError."""
    matcher: Matcher = families.make("matchers", args.matcher, args.preset, dict(args.set))
    table = _files.open_scores(args.scores)
    if args.layout == "reference-query":
        table = table.T
    look = ScoreLook(args.distances)
    queries, references = table.shape
    with families.blaming("matchers", matcher):
        matching = matcher.start(args.distances)
        for rows in _files.score_blocks(table, args.distances):
            look.see(rows)
            matching.extend(rows)
        matches = matching.path()
    check_path(matches, queries, references, matcher)
    remarks = look.remarks(matcher, matches)
    _files.write_matches(args.output, matches, args.overwrite)
    figures = {"queries": queries, "references": references, "accepted": int(matches.accepted.sum())}
    if args.layout is None:
        note("rows are taken for queries, columns for references: --layout reference-query turns them")
    for remark in remarks:
        note(remark)
    if args.json:
        print(json.dumps(figures))
    else:
        say(f"{figures['accepted']} of {queries} queries matched to {references} references: {args.output}")
    return 0
