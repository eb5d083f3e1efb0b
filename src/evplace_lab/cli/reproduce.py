"""Make the paper's Table 2 and Figure 5, tables of what it leaves open and of real drives, or the descriptor.

Examples:
  evplace reproduce table2 -o out                       makes the benchmark city first: about 15 minutes
  evplace reproduce table2 --city city -o out           with drives that `evplace city -o city` made
  evplace reproduce figure5 --city city -o out          what table2 has trained is not trained again
  evplace reproduce ablations --city city -o out
  evplace reproduce real --data data -o out             real sets that lie in a folder
  evplace reproduce descriptor -o out                   the learned descriptor: 75 minutes of a core
  evplace reproduce table2 --city city -o out --methods own.toml    with methods of your own as further rows
  evplace reproduce table2 --city small -o quick --seeds 1 --set steps=50

OUT gets NAME.json and the results; `evplace report OUT` makes a page of them. A call that was stopped goes on
where it was when it is given again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from evplace.cli._output import print_json, print_table, progress, say
from evplace.cli._settings import Pairs, a_part_of
from evplace.cli._workers import WorkerFlags
from evplace.core import families
from evplace_lab.reproduction import Choice, reproduce
from evplace_lab.reproduction._recipes import read_methods


@dataclass(frozen=True)
class Args(WorkerFlags):
    """Flags of `evplace reproduce`."""

    name: Annotated[tyro.conf.Positional[str], a_part_of("reproduction")]
    """What to make."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The folder for the results; what is there is gone on with."""
    city: Path | None = None
    """Drives that `evplace city` made; without them the benchmark is made in OUT/city."""
    data: Path | None = None
    """For real and figure5: the folder of real sets; the recipes say which, and where in it each lies."""
    seeds: int = 3
    """Trainings of each network."""
    inputs: tuple[str, ...] = ()
    """For table2 and figure5: only these inputs, for example events colour; all if not given."""
    set: Pairs = ()
    """A setting of all trainings over the recipes', as name=value: for a quick look."""
    methods: Path | None = None
    """For table2, figure5 and real: a TOML file of further methods, a table each with scorer and matcher, and
    where they are not the defaults preset, settings, scorer_settings, every. Parts of other packages too."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Run what is missing, print the tables."""
    own = {} if args.methods is None else read_methods(args.methods)
    choice = Choice(args.seeds, dict(args.set), args.inputs, own)
    with args.opened_workers() as workers, progress(args.name) as show:
        document = reproduce(args.name, args.out, args.city, args.data, choice, workers, show)
    if args.json:
        print_json(document)
        return 0
    for table in families.load("reproduction", args.name).tables(document):
        print_table(*table)
    minutes = document["cpu_s"] / 60
    say(
        f"Kept in {args.out}/{args.name}.json, {minutes:.1f} minutes of one core in all",
        f"evplace report {args.out} makes a page of it",
    )
    return 0
