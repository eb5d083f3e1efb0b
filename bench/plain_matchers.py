"""The matchers written plainly, with numpy where numpy helps: what the fast ones are compared with."""

from __future__ import annotations

import heapq

import numpy as np


def sad(queries: np.ndarray, references: np.ndarray) -> np.ndarray:
    wide = references.astype(np.int16)
    return np.stack([np.abs(wide - query).mean(1, dtype=np.float32) for query in queries.astype(np.int16)])


def algorithm_1(p: np.ndarray, K: int = 5, tau1: float = 0.99, tau2: float = 0.01) -> np.ndarray:
    match = np.full(len(p), -1)
    previous = -1
    for i, row in enumerate(p):
        if previous >= 0:
            first = max(0, previous - K)
            local = first + row[first : previous + K + 1].argmax()
            if row[local] > tau2:
                match[i] = previous = local
                continue
        best = row.argmax()
        match[i] = previous = best if row[best] > tau1 else -1
    return match


def seqslam(distances: np.ndarray, offsets: np.ndarray, R: int = 10) -> np.ndarray:
    """Best reference of each query; whole-matrix arithmetic, as one would first write it in numpy."""
    queries, items = distances.shape
    half = R // 2
    padded = np.pad(distances, ((0, 0), (half, half)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, R + 1, axis=1)
    contrast = np.empty_like(distances)
    for q in range(queries):  # one row at a time: all windows at once would be eleven matrices
        mean = np.nanmean(windows[q], 1)
        contrast[q] = (distances[q] - mean) / np.nanstd(windows[q], 1, ddof=1)
    span = offsets.shape[1]
    scores = np.full((queries - span + 1, items), np.inf, np.float32)
    for line in offsets:
        low, high = max(0, -line.min()), items - line.max()
        total = np.zeros((queries - span + 1, high - low), np.float32)
        for k, offset in enumerate(line):
            total += contrast[k : queries - span + 1 + k, low + offset : high + offset]
        np.minimum(scores[:, low:high], total, out=scores[:, low:high])
    return scores.argmin(1)


def graph(similarities: np.ndarray, K: int, alpha: float) -> np.ndarray:
    """opr's search with a heap of Python; the sum of the path is kept in each node here too."""
    queries, items = similarities.shape
    nodes = {(-1, 0): (0.0, None)}
    heap: list[tuple[float, tuple[int, int]]] = []
    best = (-1, 0)

    def expand(node: tuple[int, int], low: int, high: int) -> None:
        nonlocal best
        q, acc = node[0] + 1, nodes[node][0]
        own = 1 / similarities[q, low : high + 1].astype(np.float64)
        for r, cost in enumerate(own.tolist(), low):
            if (q, r) not in nodes:
                nodes[q, r] = (acc + cost, node)
                heapq.heappush(heap, (acc + cost, (q, r)))
        c = (q, low + int(own.argmin()))
        if q > best[0] or (q == best[0] and nodes[c][0] <= nodes[best][0]):
            best = c

    expand((-1, 0), 0, items - 1)
    for q in range(1, queries):
        while True:
            acc, node = heapq.heappop(heap)
            reach = nodes[best][0]
            if node != best and acc + (best[0] - node[0]) * reach / (best[0] + 1) * alpha >= reach:
                continue
            expand(node, max(0, node[1] - K), min(items - 1, node[1] + K))
            if node[0] == q - 1:
                break
    path, at = [], best
    while at[0] >= 0:
        path.append(at[1])
        at = nodes[at][1]
    return np.array(path[::-1])
