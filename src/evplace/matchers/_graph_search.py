"""The lazy search of the graph matcher: the cheapest path through queries x references, mostly unseen.

A node is a query and a reference; its cost is their dissimilarity, an edge leads one query on. Each node
carries the sum of its path, so that no path is ever walked during the search; the path has one node a
query, so its length is known too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

NODE = np.dtype(
    [
        ("query", "i4"),
        ("item", "i4"),
        ("parent", "i4"),
        ("hidden", "i4"),
        ("own", "f8"),
        ("acc", "f8"),
        ("sum", "f8"),
    ]
)
"""own: cost; acc: the search's accumulated cost; sum: of the own costs of the path; hidden: how many nodes at
the path's end cost more than m."""

ENTRY = np.dtype([("acc", "f8"), ("node", "i8")])
"""An entry of the heap."""

QUERIES, NODES, ENTRIES, BEST, WANTED, EVALUATED = range(6)
"""Places in the search's state: queries taken, nodes and heap entries in use, the best node, whether
candidates are wanted to find back, cells looked at."""

NONE, ALL, WINDOW, OFFERED = range(4)
"""Ways to find back."""

LOST_AFTER = 5
"""Lost once this many last nodes of the best path are hidden: vpr and isl, window 5, more than 80 %."""

IMPOSSIBLE = np.finfo(np.float64).max
"""Cost of a similarity below 1e-9."""


def start(nodes: NDArray[Any]) -> NDArray[np.int64]:
    """The state of a search whose node 0 is the source, before the first query."""
    nodes[0] = (-1, 0, -1, 0, 0.0, 0.0, 0.0)
    return np.array([0, 1, 0, 0, 0, 0], np.int64)


@njit(cache=True)
def advance(
    rows: NDArray[Any],
    offered: NDArray[np.int64],
    scores: NDArray[Any],
    grid: NDArray[np.int32],
    nodes: NDArray[Any],
    heap: NDArray[Any],
    state: NDArray[np.int64],
    K: int,
    alpha: float,
    m: float,
    relocalise: int,
    distances: bool,
) -> int:
    """Take (queries, items) `rows`; how many were taken: fewer where room or candidates are wanted.

    `scores` and `grid` are rings (memory, items) of the last rows and of the nodes on them, -1 where none;
    `offered` are the candidates of the first row, used if it is lost. All but `rows` and `offered` change.
    """
    items = rows.shape[1]
    for i in range(rows.shape[0]):
        query = state[QUERIES]
        slot = query % scores.shape[0]
        if state[NODES] + items > nodes.shape[0]:
            return i
        scores[slot] = rows[i]
        grid[slot] = -1
        if relocalise != NONE and (query == 0 or nodes[state[BEST]].hidden >= LOST_AFTER):
            if relocalise == OFFERED and (i > 0 or state[WANTED] == 0):
                state[WANTED] = 1
                return i
            state[WANTED] = 0
            _find_back(offered, scores[slot], grid[slot], nodes, heap, state, K, m, relocalise, distances)
        elif query == 0:
            _expand(0, 0, items - 1, scores[slot], grid[slot], nodes, heap, state, m, distances)
        elif not _search(scores, grid, nodes, heap, state, K, alpha, m, distances):
            return i
        state[QUERIES] += 1
    taken: int = rows.shape[0]
    return taken


@njit(cache=True)
def _search(
    scores: NDArray[Any],
    grid: NDArray[np.int32],
    nodes: NDArray[Any],
    heap: NDArray[Any],
    state: NDArray[np.int64],
    K: int,
    alpha: float,
    m: float,
    distances: bool,
) -> bool:
    """Expand what is worth it, cheapest first, until the path reaches the newest query; False: lacks room."""
    memory, items = scores.shape
    query = state[QUERIES]
    while state[NODES] + 2 * K + 1 <= nodes.shape[0]:
        # Equal costs can empty the heap, where the originals stop with an error: go on from the best.
        n = _pop(heap, state) if state[ENTRIES] > 0 else state[BEST]
        node = nodes[n]
        if node.query + 1 <= query - memory or not _worth(n, nodes, state[BEST], alpha):
            continue
        slot = (node.query + 1) % memory
        low, high = max(0, node.item - K), min(items - 1, node.item + K)
        _expand(n, low, high, scores[slot], grid[slot], nodes, heap, state, m, distances)
        if node.query == query - 1:
            return True
    return False


@njit(cache=True)
def _worth(n: int, nodes: NDArray[Any], b: int, alpha: float) -> bool:
    """Whether a path over `n` could still beat the best, at alpha times the best path's mean cost a query."""
    if n == b:
        return True
    node, best = nodes[n], nodes[b]
    mean = best.sum / (best.query + 1)
    ahead: float = (best.query - node.query) * mean * alpha
    return bool(node.acc + ahead < best.acc)


@njit(cache=True)
def _expand(
    parent: int,
    low: int,
    high: int,
    scores: NDArray[Any],
    grid: NDArray[np.int32],
    nodes: NDArray[Any],
    heap: NDArray[Any],
    state: NDArray[np.int64],
    m: float,
    distances: bool,
) -> None:
    """Give `parent` the children [low, high] of the next query, whose row of scores and of nodes is given."""
    least, nearest = np.inf, low
    for item in range(low, high + 1):
        own = cost(scores[item], distances)
        if own < least:
            least, nearest = own, item
        if grid[item] < 0:
            acc = nodes[parent].acc + own
            grid[item] = _add(parent, item, own, acc, nodes, state, m)
            _push(acc, grid[item], heap, state)
    state[EVALUATED] += high - low + 1
    child, best = nodes[grid[nearest]], nodes[state[BEST]]
    if child.query > best.query or (child.query == best.query and child.acc <= best.acc):
        state[BEST] = grid[nearest]


@njit(cache=True)
def _find_back(
    offered: NDArray[np.int64],
    scores: NDArray[Any],
    grid: NDArray[np.int32],
    nodes: NDArray[Any],
    heap: NDArray[Any],
    state: NDArray[np.int64],
    K: int,
    m: float,
    relocalise: int,
    distances: bool,
) -> None:
    """Go on from the cheapest candidate alone: the best so far becomes its parent, all else is forgotten."""
    b = state[BEST]
    least, nearest = np.inf, nodes[b].item  # no candidate: the same reference
    if relocalise == OFFERED:
        for item in offered:
            own = cost(scores[item], distances)
            if own < least or (own == least and item < nearest):
                least, nearest = own, item
    else:
        low, high = 0, scores.shape[0]
        if relocalise == WINDOW:
            low, high = max(0, state[QUERIES] - K), min(high, state[QUERIES] + K)
        for item in range(low, high):
            own = cost(scores[item], distances)
            if own < least:
                least, nearest = own, item
    own = cost(scores[nearest], distances)
    # The originals' parent is a copy whose accumulated cost is -1, but 0 for the source; it changes answers.
    acc = own if b == 0 else own - 1
    state[BEST] = grid[nearest] = _add(b, nearest, own, acc, nodes, state, m)
    state[ENTRIES] = 0
    _push(acc, state[BEST], heap, state)


@njit(cache=True)
def _add(
    parent: int, item: int, own: float, acc: float, nodes: NDArray[Any], state: NDArray[np.int64], m: float
) -> int:
    """A new node below `parent`; its number."""
    number: int = state[NODES]
    state[NODES] += 1
    node, above = nodes[number], nodes[parent]
    node.query, node.item, node.parent = above.query + 1, item, parent
    node.own, node.acc, node.sum = own, acc, above.sum + own
    node.hidden = above.hidden + 1 if own > m else 0
    return number


@njit(cache=True)
def cost(score: float, distances: bool) -> float:
    """The distance, or 1/similarity."""
    if distances:
        return -np.float64(score)
    return IMPOSSIBLE if score < 1e-9 else 1 / np.float64(score)


@njit(cache=True)
def trace(nodes: NDArray[Any], best: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The items and costs of the path that ends in node `best`; -1 and NaN of queries that are forgotten."""
    queries = nodes[best].query + 1
    item, own = np.full(queries, -1), np.full(queries, np.nan)
    n = best
    while n > 0:
        query = nodes[n].query
        item[query], own[query] = nodes[n].item, nodes[n].own
        n = nodes[n].parent
    return item, own


@njit(cache=True)
def forget(
    oldest: int, grid: NDArray[np.int32], nodes: NDArray[Any], heap: NDArray[Any], state: NDArray[np.int64]
) -> None:
    """Drop nodes of queries before `oldest`, which nothing reaches any more; paths begin after them."""
    now = np.zeros(state[NODES], np.int32)
    kept = 1
    for n in range(1, state[NODES]):
        if nodes[n].query >= oldest:
            now[n] = kept
            nodes[kept] = nodes[n]
            nodes[kept].parent = now[nodes[n].parent]
            kept += 1
    entries = state[ENTRIES]
    state[NODES], state[BEST], state[ENTRIES] = kept, now[state[BEST]], 0
    for i in range(entries):
        acc, node = heap[i].acc, now[heap[i].node]
        if node > 0:
            _push(acc, node, heap, state)
    for row in grid:
        for item in range(len(row)):
            if row[item] > 0:
                row[item] = now[row[item]]


@njit(cache=True)
def _push(acc: float, node: int, heap: NDArray[Any], state: NDArray[np.int64]) -> None:
    i = state[ENTRIES]
    state[ENTRIES] += 1
    while i > 0:
        above = (i - 1) // 2
        if heap[above].acc <= acc:
            break
        heap[i] = heap[above]
        i = above
    heap[i].acc = acc
    heap[i].node = node


@njit(cache=True)
def _pop(heap: NDArray[Any], state: NDArray[np.int64]) -> int:
    """Remove the cheapest entry; its node."""
    first: int = heap[0].node
    state[ENTRIES] -= 1
    size = state[ENTRIES]
    acc, node = heap[size].acc, heap[size].node
    i = 0
    while 2 * i + 1 < size:
        child = 2 * i + 1
        if child + 1 < size and heap[child + 1].acc < heap[child].acc:
            child += 1
        if acc <= heap[child].acc:
            break
        heap[i] = heap[child]
        i = child
    heap[i].acc = acc
    heap[i].node = node
    return first
