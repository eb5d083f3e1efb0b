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
from typing import Annotated, Literal

import tyro

from evplace.cli._output import note
from evplace.core import settings
from evplace.matchers import _files, open_matcher, resolved_settings
from evplace.matchers._look import ScoreLook


@dataclass(frozen=True)
class Args:
    """What `evplace match` can be told."""

    scores: tyro.conf.Positional[Path]
    """A .npy file; larger is better, unless --distances."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The csv file to write."""
    matcher: str = "local"
    """best, local, seqslam, graph, dp or hmm."""
    preset: str | None = None
    """Named settings of the matcher, for example openseqslam2, openseqslam2013, opr, isl, ism or paper."""
    set: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """A setting over those of the preset, as name=value; may be given several times."""
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
    values = settings.from_pairs(args.set)
    matcher = open_matcher(args.matcher, args.preset, args.distances, **values)
    table = _files.open_scores(args.scores)
    if args.layout == "reference-query":
        table = table.T
    look = ScoreLook(args.distances)
    for rows in _files.score_blocks(table, args.distances):
        look.see(rows)
        matcher.extend(rows)
    matches = matcher.path()
    remarks = look.remarks(args.matcher, resolved_settings(args.matcher, args.preset, **values), matches)
    _files.write_matches(args.output, matches, args.overwrite)
    queries, references = table.shape
    figures = {"queries": queries, "references": references, "accepted": int(matches.accepted.sum())}
    if args.layout is None:
        note("rows are taken for queries, columns for references: --layout reference-query turns them")
    for remark in remarks:
        note(remark)
    if args.json:
        print(json.dumps(figures))
    else:
        print(f"{figures['accepted']} of {queries} queries matched to {references} references: {args.output}")
    return 0
