"""Pictures of results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evplace.errors import MissingExtraError
from evplace.storage import new_file

COLOURS = {"events": ("#1b6ca8", "#8fc1e3"), "colour": ("#c4622d", "#efb998")}
"""Input -> colour of its first and of its second matcher."""


def accuracy_chart(rows: Sequence[Mapping[str, Any]], path: str | Path) -> None:
    """Bars of accuracy for each query, input and matcher, over the level of chance, as a .png.

    `rows` have query, input, matcher, accuracy and chance. Raises MissingExtraError without matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "report", "drawing a chart") from error
    queries = list(dict.fromkeys(row["query"] for row in rows))
    kinds = list(dict.fromkeys((row["input"], row["matcher"]) for row in rows))
    width = 0.8 / len(kinds)
    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.add_subplot(ylabel="accuracy in %", ylim=(0, 100))
    for place, (kind, matcher) in enumerate(kinds):
        shade = [other for name, other in kinds if name == kind].index(matcher)
        chosen = [row for row in rows if (row["input"], row["matcher"]) == (kind, matcher)]
        at = [queries.index(row["query"]) + (place - (len(kinds) - 1) / 2) * width for row in chosen]
        heights = [100 * row["accuracy"] for row in chosen]
        axes.bar(at, heights, width, label=f"{kind}, {matcher}", color=COLOURS[kind][shade % 2])
    for place, query in enumerate(queries):
        chance = 100 * next(row["chance"] for row in rows if row["query"] == query)
        axes.plot([place - 0.45, place + 0.45], [chance, chance], color="black", linestyle=":", label="_")
    axes.plot([], [], color="black", linestyle=":", label="chance")
    axes.set_xticks(range(len(queries)), queries)
    axes.set_title("The map is day-1; the query as named")
    axes.legend(frameon=False, ncols=2)
    axes.spines[["top", "right"]].set_visible(False)
    with new_file(path, overwrite=True) as partial:
        figure.savefig(partial, dpi=120)
