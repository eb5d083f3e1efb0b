"""Cells of tables: means and spreads of what several seeds gave."""

from __future__ import annotations

from typing import Any

import numpy as np

from evplace_lab.reproduction._runs import TIMINGS


def rows_of(outcomes: list[dict[str, Any]], rule: str) -> list[dict[str, Any]]:
    """The figures of one cell by a rule: of live answers, and of hindsight where that says something else."""
    live, late = (_row(outcomes, rule, timing) for timing in TIMINGS)
    return [live] if live == {**late, "answers": "live"} else [live, late]


def label_of(row: dict[str, Any]) -> str:
    """A row's method for people: live answers go without saying."""
    return f"{row['matcher']} (hindsight)" if row["answers"] == "hindsight" else str(row["matcher"])


def _row(outcomes: list[dict[str, Any]], rule: str, timing: str) -> dict[str, Any]:
    """In %, from the outcomes of the seeds."""
    figures = [outcome[timing][rule]["figures"] for outcome in outcomes]
    values = [round(100 * figure["accuracy"], 4) for figure in figures]
    return {
        "rule": rule,
        "answers": timing,
        "mean": float(np.mean(values)),
        "spread": deviation(values),
        "seeds": len(values),
        "values": values,
        "seen": _mean([figure["accuracy_seen"] for figure in figures]),
        "rejected": _mean([figure["rejection_rate"] for figure in figures]),
        "chance": _mean([figure["chance"] for figure in figures]),
        "trained": outcomes[0]["case"]["train"] is not None,
        "n": figures[0]["judged"],
    }


def deviation(values: list[float]) -> float | None:
    """Standard deviation over the seeds; None for one."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else None


def shown(cell: dict[str, Any], figure: str = "mean") -> str:
    """A cell for people, its mean with the spread."""
    value = cell[figure]
    if value is None:
        return "-"
    spread = f" ± {cell['spread']:.1f}" if figure == "mean" and cell["spread"] is not None else ""
    return f"{value:.1f}{spread}"


def _mean(shares: list[float | None]) -> float | None:
    known = [100 * share for share in shares if share is not None]
    return float(np.mean(known)) if known else None
