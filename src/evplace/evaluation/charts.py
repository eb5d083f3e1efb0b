"""Pictures of results, drawn with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.drawing import new_figure, save
from evplace.evaluation import OUTCOMES, Result, reliability

Curve = tuple[str, NDArray[np.float64], int, str]
"""Its name, (n, 2) recall and precision, the number of its colour, and its style: a key of STYLES."""

STYLES: dict[str, dict[str, Any]] = {
    "solid": {"linewidth": 2.0},
    "thin": {"linewidth": 0.9},
    "dotted": {"linestyle": ":", "linewidth": 1.8},
    "dashdot": {"linestyle": "-.", "linewidth": 1.4},
    "dashed": {"linestyle": "--", "linewidth": 1.4, "markerfacecolor": "none"},
}
"""Style of a curve -> how it is drawn."""

COLOURS = {"events": ("#1b6ca8", "#8fc1e3"), "colour": ("#c4622d", "#efb998")}
"""Input -> colour of its first and of its second matcher."""

PALETTE = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b4ea5", "#7a7a7a",
    "#8b5a2b", "#1a1a1a",
)  # fmt: skip
"""Colours that people with any colour vision tell apart (after Okabe and Ito), for lines and bars."""

OUTCOME_COLOURS = dict(zip(OUTCOMES, ("#0072b2", "#d55e00", "#e69f00", "#9a9a9a"), strict=True))
OUTCOME_WORDS = dict(
    zip(OUTCOMES, ("right", "wrong", "rejected, though known", "rejected, and unknown"), strict=True)
)

ERROR_EDGES_M = (10.0, 20.0, 40.0, 80.0)
"""Where the colours of errors change, in metres."""
ERROR_WORDS = ("below 10 m", "10 to 20 m", "20 to 40 m", "40 to 80 m", "80 m and more")
ERROR_COLOURS = ("#2c7fb8", "#7fb8d6", "#d9b65c", "#e8853a", "#b2381a")


def accuracy_chart(rows: Sequence[Mapping[str, Any]], path: str | Path) -> None:
    """Bars of accuracy for each query, input and matcher, over the level of chance, as a .png.

    `rows` have query, input, matcher, accuracy and chance. Raises MissingExtraError without matplotlib.
    """
    queries = list(dict.fromkeys(row["query"] for row in rows))
    kinds = list(dict.fromkeys((row["input"], row["matcher"]) for row in rows))
    width = 0.8 / len(kinds)
    figure = new_figure(9, 4)
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
    axes.set_title("Live answers; the map is day-1, the query as named")
    axes.legend(frameon=False, ncols=2)
    save(figure, path)


def bars_chart(groups: Mapping[str, Sequence[Mapping[str, Any]]], path: str | Path) -> None:
    """For each title, bars with their spread over the queries, and the paper's figures as black lines.

    The rows of a group have query, label, mean, spread and paper in %; spread and paper may be None.
    Raises MissingExtraError without matplotlib.
    """
    labels = list(dict.fromkeys(row["label"] for rows in groups.values() for row in rows))
    figure = new_figure(10, 3.2 * -(-len(groups) // 2))
    all_axes = figure.subplots(-(-len(groups) // 2), min(2, len(groups)), squeeze=False, sharey=True)
    for axes in all_axes.flat[len(groups) :]:
        axes.set_visible(False)
    for axes, (title, rows) in zip(all_axes.flat, groups.items(), strict=False):
        queries = list(dict.fromkeys(row["query"] for row in rows))
        width = 0.84 / len(labels)
        for row in rows:
            kind = labels.index(row["label"])
            at = queries.index(row["query"]) + (kind - (len(labels) - 1) / 2) * width
            axes.bar(at, row["mean"], width * 0.94, yerr=row["spread"], color=PALETTE[kind % len(PALETTE)])
            if row["paper"] is not None:
                axes.plot([at - width / 2, at + width / 2], [row["paper"]] * 2, color="black", linewidth=2)
        axes.set(title=title, ylim=(0, 100), ylabel="accuracy in %")
        axes.set_xticks(range(len(queries)), queries)
    for kind, label in enumerate(labels):
        all_axes[0, 0].bar([0], [0], color=PALETTE[kind % len(PALETTE)], label=label)
    if any(row["paper"] is not None for rows in groups.values() for row in rows):
        all_axes[0, 0].plot([], [], color="black", linewidth=2, label="the paper's")
    figure.legend(loc="outside lower center", ncols=min(len(labels) + 1, 4), frameon=False)
    save(figure, path)


def curve_chart(result: Result, path: str | Path) -> None:
    """A result's precision-recall curve, as a .png. Raises MissingExtraError."""
    curves_chart(f"answers: {result.timing}", [("", result.curve[:, [2, 1]], 0, "solid")], path)


def curves_chart(title: str, curves: Sequence[Curve], path: str | Path) -> None:
    """Precision over recall of several methods, as a .png. Raises MissingExtraError without matplotlib."""
    named = any(label for label, *_ in curves)
    figure = new_figure(8 if named else 5, 4)
    axes = figure.add_subplot(
        xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02), title=title
    )
    for label, points, colour, style in curves:
        marker = "o" if len(points) == 1 else "." if len(points) < 30 else None
        shade = PALETTE[colour % len(PALETTE)]
        axes.plot(points[:, 0], points[:, 1], marker=marker, color=shade, label=label, **STYLES[style])
    axes.grid(alpha=0.3)
    if named:
        figure.legend(loc="outside right upper", frameon=False, fontsize="small")
    save(figure, path)


def reliability_chart(result: Result, path: str | Path) -> None:
    """The share of answers that was right over the probability that they were given, as a .png.

    `result` is probabilistic. Raises MissingExtraError without matplotlib.
    """
    bins = reliability(result.answers.score[result.judged], result.right[result.judged])
    figure = new_figure(5, 4.5)
    axes = figure.add_subplot(
        xlabel="probability said", ylabel="share right", xlim=(0, 1), ylim=(0, 1.02),
        title=f"answers: {result.timing}",
    )  # fmt: skip
    axes.plot([0, 1], [0, 1], color="0.6", linestyle=":")
    axes.scatter(
        bins[:, 0], bins[:, 1], 10 + 290 * bins[:, 2] / max(bins[:, 2].max(), 1), PALETTE[0], alpha=0.75
    )
    axes.grid(alpha=0.3)
    save(figure, path)


def confusion_chart(result: Result, path: str | Path) -> None:
    """The items answered along the drive, coloured by what became of them, as a .png.

    Raises MissingExtraError without matplotlib.
    """
    figure = new_figure(7, 4.5)
    axes = figure.add_subplot(xlabel="query", ylabel="map item")
    query = np.arange(len(result.judged))
    if result.true_item is not None:
        known = result.true_item >= 0
        axes.scatter(query[known], result.true_item[known], 14, "0.85", label="the right item")
    for number, kind in enumerate(OUTCOMES):
        of_kind = (result.outcome == number) & (result.answers.item >= 0)
        axes.scatter(
            query[of_kind], result.answers.item[of_kind], 5, OUTCOME_COLOURS[kind], label=OUTCOME_WORDS[kind]
        )
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize="small", markerscale=2)
    save(figure, path)


def route_chart(result: Result, path: str | Path) -> None:
    """The query's drive over the map's items, coloured by error, as a .png with north up and equal axes.

    `result` has positions of its queries. Raises MissingExtraError without matplotlib.
    """
    assert result.query_xy is not None
    figure = new_figure(7, 5.5)
    axes = figure.add_subplot(xlabel="metres east", ylabel="metres north", aspect="equal")
    west, south = np.nanmin(result.query_xy, axis=0)
    if result.item_xy is not None:
        axes.scatter(*(result.item_xy - (west, south)).T, 12, "0.85", label="the map")
    accepted = result.answers.accepted & np.isfinite(result.error_m)
    here = (result.query_xy - (west, south)).T
    axes.scatter(*here[:, ~accepted], 9, "0.55", label="rejected")
    bands = np.digitize(result.error_m[accepted], ERROR_EDGES_M)
    colours = np.array(ERROR_COLOURS)[bands]  # in the order of the drive: no colour lies over all others
    axes.scatter(*here[:, accepted], 9, colours)
    for colour, words in zip(ERROR_COLOURS, ERROR_WORDS, strict=True):
        axes.scatter([], [], 9, colour, label=words)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize="small", markerscale=2)
    save(figure, path)
