"""Match a matrix of scores, or of distances, and write the matches as csv.

Examples:
  evplace match scores.npy -o matches.csv
  evplace match scores.npy --matcher graph --set K=5 --set alpha=0.3 --set m=2.6 -o matches.csv
  evplace match distances.npy --distances --matcher seqslam --preset openseqslam2 -o matches.csv

The matrix has queries as rows and references as columns, in the order of their drives. The csv has
query,reference,score,accepted; both count from 0, and the reference is -1 where there is none.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from evplace.core import settings
from evplace.matchers import _files, open_matcher


@dataclass(frozen=True)
class Args:
    """What `evplace match` can be told."""

    scores: tyro.conf.Positional[Path]
    """A .npy file, (queries, references); larger is better, unless --distances."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The csv file to write."""
    matcher: str = "local"
    """best, local, seqslam, graph, dp or hmm."""
    preset: str | None = None
    """Named settings of the matcher, for example openseqslam2, openseqslam2013, opr, isl, ism or paper."""
    set: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """A setting over those of the preset, as name=value; may be given several times."""
    distances: bool = False
    """Smaller is better."""
    overwrite: bool = False
    """Replace the output if it exists."""
    json: bool = False
    """Print the figures as one JSON object."""


def run(args: Args) -> int:
    """Match the whole matrix, a block of rows at a time; 0, or an EvplaceError."""
    matcher = open_matcher(args.matcher, args.preset, args.distances, **settings.from_pairs(args.set))
    table = _files.open_scores(args.scores)
    for rows in _files.score_blocks(table, args.distances):
        matcher.extend(rows)
    matches = matcher.path()
    _files.write_matches(args.output, matches, args.overwrite)
    queries, references = table.shape
    figures = {"queries": queries, "references": references, "accepted": int(matches.accepted.sum())}
    if args.json:
        print(json.dumps(figures))
    else:
        print(f"{figures['accepted']} of {queries} queries matched to {references} references: {args.output}")
    return 0
