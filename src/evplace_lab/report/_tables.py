"""The tables of a page, as HTML that needs no script."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from evplace.evaluation import Result, flat
from evplace_lab.report._found import Ablation, Found, TableRow
from evplace_lab.report._html import Html, join, tag

RULES = {
    "places": "the paper's rule: the right cell or one of its eight neighbours",
    "view": "the rule of views: also a reference near by that looks the same way",
}
"""Rule -> what it means."""
TIMINGS = {"live": "live", "hindsight": "in hindsight"}
"""When answers were given -> how a page says it."""
OVERVIEW = {
    "accuracy": "accuracy", "accuracy_seen": "seen only", "rejection_rate": "rejected",
    "precision": "precision", "recall": "recall", "average_precision": "AP", "recall@1": "recall@1",
    "chance": "chance",
}  # fmt: skip
"""Figure -> the head of its column, all of them in %."""
VERDICTS = {"better": "▲", "worse": "▼"}
BAR_PX = 60
"""Half the width of an effect's bar."""


def headline(found: Found) -> Html:
    """The few figures that a person asks for first."""
    return tag("div", *(_tile(*one) for one in _headline_figures(found)), class_="tiles")


def best_of(results: Mapping[str, Result]) -> int:
    """The number of the result with the highest accuracy, the first of equal ones; 0 without any."""
    shares = [result.figures.get("accuracy") or 0.0 for result in results.values()]
    return shares.index(max(shares)) if shares else 0


def subtitle(found: Found) -> str:
    """What the page is about, in a sentence."""
    results = list(found.results.values())
    if len(results) == 1:
        return _about_one(results[0])
    parts = []
    if found.table is not None or found.real is not None or found.curves is not None:
        parts.append("Tables and curves of methods side by side")
    if found.ablations is not None:
        parts.append("what single changes do")
    if results:
        timings = ", ".join(dict.fromkeys(TIMINGS.get(one.timing, one.timing) for one in results))
        parts.append(f"{len(results)} results ({timings} answers), of which the best is opened below")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def _about_one(result: Result) -> str:
    figures, settings = result.figures, flat(result.settings)
    found = f"{percent(figures['accuracy'])} % of {figures['judged']:,} images answered rightly"
    by = [str(settings[key]) for key in ("map.scorer.name", "matcher.name") if settings.get(key)]
    method = f", by {' and '.join(by)}" if by else ""
    query = f" of {settings['query']}" if settings.get("query") else ""
    timing = TIMINGS.get(result.timing, result.timing)
    return f"{found}{query}{method}; {timing} answers against a map of {figures['items']:,} items."


def accuracies(rows: Sequence[TableRow]) -> Html:
    """A table as the paper's Table 2: a block for each matcher, all rules, of which one is shown."""
    rules = list(dict.fromkeys(row.rule for row in rows))
    blocks = []
    for number, rule in enumerate(rules):
        of_rule = [row for row in rows if row.rule == rule]
        kinds = dict.fromkeys((row.matcher, row.answers) for row in of_rule)
        tables = [
            _block(*kind, [row for row in of_rule if (row.matcher, row.answers) == kind]) for kind in kinds
        ]
        blocks.append(tag("div", *tables, class_="rule", data_rule=rule, hidden=number > 0))
    return join(_rule_switch(rules), _legend(rows), *blocks)


def ablations(rows: Sequence[Ablation]) -> Html:
    """What each change did, from the best to the worst."""
    ranked = sorted(rows, key=lambda row: -row.effect)
    widest = max((abs(row.effect) for row in ranked), default=0) or 1
    words = [tag("th", word, scope="col") for word in ("open in the paper", "changed to", "query")]
    numbers = [_number_head("accuracy in %"), _number_head("effect in points"), tag("td")]
    head = tag("thead", tag("tr", *words, *numbers, tag("th", "verdict", scope="col")))
    body = [
        tag(
            "tr",
            tag("th", row.name, scope="row"),
            tag("td", row.change, class_="words"),
            tag("td", ", ".join(word for word in (row.query, row.method) if word), class_="short"),
            _number(_with_spread(row.mean, row.spread)),
            _number(_with_spread(row.effect, row.effect_spread, sign=True)),
            tag("td", _bar(row.effect / widest), class_="bar"),
            tag("td", f"{VERDICTS.get(row.verdict, '=')} {row.verdict}", class_=f"verdict {row.verdict}"),
        )
        for row in ranked
    ]  # fmt: skip
    return _scrolled("Ablations", tag("table", head, tag("tbody", *body)))


def lacking(found: Found) -> Html:
    """A panel for each curve's data that are not there, which says what it needs and what to do then."""
    told = found.curves.rest.get("lacking") if found.curves is not None else None
    panels = []
    for one in told if isinstance(told, list) else []:
        if isinstance(one, dict):
            needs = f"Needs data: {one.get('needs', '')}"
            command = tag("code", str(one.get("command", "")))
            panels.append(
                tag("div", tag("h3", str(one.get("panel", ""))), tag("p", needs), command, class_="panel")
            )
    return tag("div", *panels, class_="grid-2 lacking") if panels else Html()


def overview(results: Mapping[str, Result]) -> Html:
    """One row a result, in %."""
    shown = [
        key for key in OVERVIEW if any(result.figures.get(key) is not None for result in results.values())
    ]
    heads = ("queries", *(OVERVIEW[key] for key in shown), "took")
    words = [tag("th", word, scope="col") for word in ("result", "answers")]
    head = tag("thead", tag("tr", *words, *map(_number_head, heads)))
    body = [
        tag(
            "tr",
            tag("th", name, scope="row"),
            tag("td", TIMINGS.get(result.timing, result.timing)),
            _number(f"{len(result.judged):,}"),
            *(_number(percent(result.figures.get(key))) for key in shown),
            _number("–" if result.took_s is None else f"{result.took_s:.3g} s"),
        )
        for name, result in results.items()
    ]
    return _scrolled("All results", tag("table", head, tag("tbody", *body)))


def facts(values: Mapping[str, Any]) -> Html:
    """Names and values as they were saved; nested ones as in matcher.K."""
    pairs = [
        (key, value if isinstance(value, str) else json.dumps(value)) for key, value in flat(values).items()
    ]
    return tag("dl", *(join(tag("dt", key), tag("dd", value)) for key, value in pairs))


def percent(share: float | None) -> str:
    """A share as per cent with one decimal."""
    return "–" if share is None else f"{100 * share:.1f}"


def _headline_figures(found: Found) -> list[tuple[str, str, str]]:
    """(value, what it is, remark) each."""
    if found.table is not None and found.table.rows:
        return _of_table(found.table.rows)
    if found.real is not None and found.real.rows:
        return _of_table(found.real.rows)
    if found.results:
        return _of_results(found.results)
    if found.ablations is not None:
        best = max(found.ablations.rows, key=lambda row: row.effect, default=None)
        return [(f"{best.effect:+.1f} points", "the best change", best.name)] if best else []
    return []


def _of_table(rows: Sequence[TableRow]) -> list[tuple[str, str, str]]:
    """The first input by the paper's own matcher beside colour, and how often it beats it."""
    of_rule = [row for row in rows if (row.rule, row.answers) == (rows[0].rule, rows[0].answers)]
    matchers = [row.matcher for row in of_rule]
    matcher = "Algorithm 1" if "Algorithm 1" in matchers else matchers[0]
    main, *others = dict.fromkeys(row.input for row in of_rule)
    rival = "colour" if "colour" in others else next(iter(others), None)
    cases: dict[tuple[str, str, str], dict[str, TableRow]] = {}
    for row in of_rule:  # of several sensors, the first
        cases.setdefault((row.database, row.query, row.matcher), {}).setdefault(row.input, row)
    tiles = []
    for case in (case for key, case in cases.items() if key[2] == matcher and main in case):
        row = case[main]
        remarks = [f"{rival} {case[rival].mean:.1f}"] if rival in case else []
        remarks += [] if row.paper is None else [f"paper {row.paper:.1f}"]
        value = f"{_with_spread(row.mean, row.spread)} %"
        tiles.append((value, f"{row.query}, {main}, {matcher}, {row.answers}", ", ".join(remarks)))
    pairs = [(case[main], case[rival]) for case in cases.values() if rival in case and main in case]
    if pairs:
        wins = sum(one.mean > other.mean for one, other in pairs)
        tiles.append((f"{wins} of {len(pairs)}", f"{main} better than {rival}", "all queries and matchers"))
    return tiles


def _of_results(results: Mapping[str, Result]) -> list[tuple[str, str, str]]:
    tiles = [] if len(results) == 1 else [(str(len(results)), "results", "")]
    kinds = {"accuracy": "accuracy", "accuracy_seen": "accuracy on seen queries", "average_precision":
             "average precision", "recall@1": "recall@1"}  # fmt: skip
    for key, words in kinds.items():
        known = {
            name: result.figures[key]
            for name, result in results.items()
            if result.figures.get(key) is not None
        }
        if known:
            best = max(known, key=lambda name: known[name])
            several = len(results) > 1
            tiles.append((f"{percent(known[best])} %", f"best {words}" * several or words, best * several))
    return tiles


def _tile(value: str, words: str, remark: str) -> Html:
    return tag("div", tag("strong", value), tag("span", words), tag("small", remark), class_="tile")


def _rule_switch(rules: Sequence[str]) -> Html | None:
    if len(rules) < 2:
        return None
    buttons = [
        tag("button", rule, type="button", data_shows=rule, aria_pressed="false" if number else "true",
            title=RULES.get(rule))
        for number, rule in enumerate(rules)
    ]  # fmt: skip
    return tag("div", tag("span", "Right by"), *buttons, class_="switch", role="group", aria_label="Rule")


def _legend(rows: Sequence[TableRow]) -> Html:
    seeds = sorted({int(row.seeds) for row in rows if row.seeds is not None})
    counted = f" over {seeds[0]} seeds" if len(seeds) == 1 and seeds[0] > 1 else " over seeds"
    spread = f", ± their spread{counted}" if any(row.spread is not None for row in rows) else ""
    paper = "; beside it the paper's figure" if any(row.paper is not None for row in rows) else ""
    below = ""
    if any(row.seen is not None or row.rejected is not None for row in rows):
        below = " Below: accuracy on the queries that the map has seen, and the share rejected as new."
    return tag(
        "p",
        f"Accuracy in %{spread}{paper}.{below}",
        class_="note",
    )


def _block(matcher: str, answers: str, rows: Sequence[TableRow]) -> Html:
    """A matcher's live answers, or hindsight: a row a database and query, columns for input and sensor."""
    kinds = list(dict.fromkeys(_kind(row) for row in rows))
    printed = {_kind(row) for row in rows if row.paper is not None}
    chance = any(row.chance is not None for row in rows)
    databases = {row.database for row in rows}
    cases: dict[tuple[str, str], list[TableRow]] = {}
    for row in rows:
        cases.setdefault((row.database, row.query), []).append(row)
    body = []
    for (database, query), of_case in cases.items():
        of_kind = {_kind(row): row for row in of_case}
        cells = [_cells(of_kind.get(kind), kind in printed) for kind in kinds]
        known = next((row.chance for row in of_case if row.chance is not None), None)
        last = _number(_one(known)) if chance else None
        first = tag("td", database) if len(databases) > 1 else None
        body.append(tag("tr", tag("th", query, scope="row"), first, *cells, last))
    learned = f" (database {next(iter(databases))})" if len(databases) == 1 and any(databases) else ""
    words = ("query", "database") if len(databases) > 1 else ("query",)
    caption = tag("caption", f"{matcher}, {TIMINGS.get(answers, answers)}", tag("small", learned))
    head = join(caption, _block_head(words, kinds, printed, chance))
    return _scrolled(f"{matcher}, {answers}", tag("table", head, tag("tbody", *body)))


def _block_head(
    words: Sequence[str], kinds: Sequence[tuple[str, str]], printed: set[tuple[str, str]], chance: bool
) -> Html:
    """Two lines: the inputs with their sensors where there are several; and ours beside the paper's."""
    inputs = [name for name, _ in kinds]
    top, under = [], []
    for kind in kinds:
        name, sensor = kind
        beside = tag("small", sensor) if inputs.count(name) > 1 else None
        span = 2 if kind in printed else 1
        top.append(tag("th", name, beside, scope="colgroup", class_="group", colspan=span))
        under.append(tag("th", "ours", scope="col", class_="group"))
        under.append(tag("th", "paper", scope="col") if kind in printed else Html())
    first = [tag("th", word, scope="col", rowspan=2) for word in words]
    last = tag("th", "chance", scope="col", rowspan=2, class_="number") if chance else None
    return tag("thead", tag("tr", *first, *top, last), tag("tr", *under))


def _kind(row: TableRow) -> tuple[str, str]:
    """Input and sensor, without a name for the sensor where each set has its own."""
    return row.input, "" if row.sensor == row.query else row.sensor


def _cells(row: TableRow | None, with_paper: bool) -> Html:
    if row is None:
        return join(_number("–", "number group"), _number("–") if with_paper else None)
    beside = {"seen": row.seen, "rejected": row.rejected}
    small = [tag("small", f"{word} {_one(value)}") for word, value in beside.items() if value is not None]
    ours = tag("td", tag("b", _with_spread(row.mean, row.spread)), *small, class_="number group")
    return join(ours, _number(_one(row.paper), "number paper") if with_paper else None)


def _bar(share: float) -> Html:
    """A bar to the right of the middle for a gain, to the left for a loss."""
    width = abs(share) * BAR_PX
    start = BAR_PX if share >= 0 else BAR_PX - width
    shape = tag("rect", x=f"{start:.1f}", y="2", width=f"{max(width, 1):.1f}", height="10",
                class_="gain" if share >= 0 else "loss")  # fmt: skip
    middle = tag("line", x1=BAR_PX, x2=BAR_PX, y1="0", y2="14", class_="axis")
    return tag("svg", shape, middle, width=2 * BAR_PX, height="14", aria_hidden="true")


def _number_head(word: str) -> Html:
    return tag("th", word, scope="col", class_="number")


def _number(text: str, class_: str = "number") -> Html:
    return tag("td", text, class_=class_)


def _one(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}"


def _with_spread(value: float, spread: float | None, sign: bool = False) -> str:
    return (f"{value:+.1f}" if sign else f"{value:.1f}") + ("" if spread is None else f" ± {spread:.1f}")


def _scrolled(name: str, table: Html) -> Html:
    """A wide table scrolls by itself, also by keyboard, and the page does not."""
    return tag("div", table, class_="scroll", tabindex="0", role="region", aria_label=name)
