"""The open states of a search: the best first, or one at random."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

_Entry = tuple[float, int, int, float]  # priority, order, node, g
Priority = Callable[[int], float]


class OpenList:
    """Open nodes, sorted by a priority that may rise while they wait; the least is the best.

    Random draws are uniform. With layers, a random draw takes the best node of a random layer, which holds the nodes
    whose h lies in the same interval. So every depth of the search gets its share of the draws.

    The caller passes the function that gives a node's priority now. If the list held it, search and list would refer
    to each other, and their memory would stay until the garbage collector runs.

    Args:
        g: g of every node, kept up to date by the search. A node whose g falls must be added again.
        h: h of every node.
        layer: Width of the intervals of h; inf: uniform draws.

    Reference:
        Layers: Xie, Mueller, Holte, Imai: Type-based exploration with multiple search queues for satisficing planning,
        AAAI 2014.
    """

    def __init__(self, g: Sequence[float], h: Sequence[float], layer: float):
        self._g, self._h, self._layer = g, h, layer
        self._nodes: list[int] = []  # unsorted, for random draws
        self._place: dict[int, int] = {}  # index of each node in _nodes
        self._heap: list[_Entry] = []
        self._layers: dict[int, list[_Entry]] = {}
        self._pushes = 0

    def __len__(self) -> int:
        return len(self._nodes)

    def __iter__(self) -> Iterator[int]:
        return iter(self._nodes)

    def add(self, node: int, priority: float) -> None:
        """Open a node, or give it a new place."""
        if node not in self._place:
            self._place[node] = len(self._nodes)
            self._nodes.append(node)
        entry = self._entry(node, priority)
        heapq.heappush(self._heap, entry)
        if self._layer < math.inf:
            heapq.heappush(self._layers.setdefault(self._layer_of(node), []), entry)

    def take_best(self, priority: Priority) -> int:
        """Close the best node and return it."""
        node = self._take(self._heap, priority)
        assert node is not None  # every open node has a fresh entry
        return node

    def take_random(self, rng: np.random.Generator, priority: Priority) -> int:
        """Close a random node and return it; see the class."""
        if self._layer == math.inf:
            node = self._nodes[int(rng.integers(len(self._nodes)))]
            self._close(node)
            return node
        while True:
            layers = list(self._layers)
            layer = layers[int(rng.integers(len(layers)))]
            node = self._take(self._layers[layer], priority)
            if node is not None:
                return node
            del self._layers[layer]

    def reset(self, nodes: Iterable[int], priority: Priority) -> None:
        """Keep only these nodes and sort them again."""
        self._nodes = list(nodes)
        self._place = {node: place for place, node in enumerate(self._nodes)}
        self._heap, self._layers = [], {}
        for node in sorted(self._nodes):
            entry = self._entry(node, priority(node))
            self._heap.append(entry)
            if self._layer < math.inf:
                self._layers.setdefault(self._layer_of(node), []).append(entry)
        for heap in (self._heap, *self._layers.values()):
            heapq.heapify(heap)

    def _entry(self, node: int, priority: float) -> _Entry:
        self._pushes += 1
        # Of equal priorities the newest comes first, which keeps the search going in depth.
        return priority, -self._pushes, node, self._g[node]

    def _layer_of(self, node: int) -> int:
        return int(self._h[node] / self._layer)

    def _take(self, heap: list[_Entry], current: Priority) -> int | None:
        """Close the best node of a heap; None where none is open."""
        while heap:  # entries of closed nodes and of older paths are stale
            priority, order, node, g = heapq.heappop(heap)
            if node not in self._place or g != self._g[node]:
                continue
            now = current(node)
            if now > priority:  # it has become worse since
                heapq.heappush(heap, (now, order, node, g))
                continue
            self._close(node)
            return node
        return None

    def _close(self, node: int) -> None:
        place, last = self._place[node], self._nodes[-1]
        self._nodes[place], self._place[last] = last, place
        self._nodes.pop()
        del self._place[node]
