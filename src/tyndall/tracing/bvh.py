"""The tree that rays descend, made on the device.

**Theory.** A bounding volume hierarchy by parallel locally-ordered clustering (PLOC: Meister and Bittner 2018). The
triangles are put in order along a Morton curve (48 bits; a radix sort). Each is a cluster at first. In every step each
cluster looks for the neighbour along the curve, no more than ``radius`` places away, with which it would have the
smallest box; two that have chosen each other merge into a node. A step leaves about half of the clusters, and the
tree is within some per cent of one built by the surface area heuristic (Wald 2007) from the top.

**Two levels.** Triangles belong to *groups*, each in one space: a mesh that is placed many times, or everything that is
placed once, in world space. All groups are built at once: the group is above the Morton code in the key, and clusters
of different groups never merge. Then the same steps cluster the instances, whose boxes are those of their groups'
roots, into the upper tree. What is in world space already hangs in it without a transform.

**Practice.** Steps are dispatched for as many clusters as were left when the host last looked: after two, four, eight
steps and so on, since a look costs more than a few empty workgroups. Nodes are numbered in the order of the steps, so a
child precedes its parent, and moving instances is a refit: the upper tree's nodes, step by step. Equal input gives the
same tree on the same device. Buffers beyond an adapter's limit of a binding are bound in parts. A tree deeper than the
traversal's stack (triangles of exponentially growing size) is built again by pairing neighbours on the curve, whatever
their boxes, which has logarithmic depth.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, GpuError, Prepared
from tyndall.gpu.resources import Buffer, Closing, Parts

OWNER = "tracing"
RADIUS = 16  # neighbours searched on either side; 8 builds faster, 32 hardly traces faster
STACK = 96  # as tracing/rays.wesl has it

_BUILD = "package::tracing::build"
_SORT = "package::tracing::sort"
_THREADS = 256
_BLOCK = 1024  # keys of a block of the sort
_LOOKS = (2, 2, 4)  # steps between looks at how far it has come; then 8
_PATIENCE = 96  # steps before pairing
_MOST = 2 * _PATIENCE  # pairing halves what is left at every other step


@dataclass(frozen=True)
class Steps:
    """Where the nodes of each step of a clustering begin; the last entry is the end."""

    starts: tuple[int, ...]
    depth: int


class Clustering(Closing):
    """One build: temporary buffers for a number of leaves, freed by :meth:`close`.

    Args:
        nodes: receives the nodes, from ``first_node`` on.
        leaves: triangles or instances.
        groups: how many groups they are in; each ends as one root.
    """

    def __init__(self, gpu: Gpu, nodes: Buffer, *, leaves: int, groups: int, first_node: int) -> None:
        self._gpu, self._nodes, self._leaves, self._groups, self._first = gpu, nodes, leaves, groups, first_node
        self._buffers: list[Buffer] = []
        try:
            self._allocate(leaves)
        except BaseException:
            self.close()
            raise

    def _allocate(self, leaves: int) -> None:
        gpu, made = self._gpu, self._buffer
        self._keys = [made(f"keys{i}", 8 * leaves, "vec2u").split(write=True) for i in range(2)]
        self._values = [made(f"order{i}", 4 * leaves, "u32").split(write=True) for i in range(2)]
        self._counts = made("digits", 64 * -(-leaves // _BLOCK), "u32")
        cluster = f"{_BUILD}::Cluster"
        size = gpu.dtype(cluster).itemsize
        self._clusters = [made(f"clusters{i}", size * leaves, cluster) for i in range(2)]
        self._neighbours = made("neighbours", 4 * leaves, "u32")
        self._blocks = made("blocks", 8 * -(-leaves // _THREADS), "vec2u")
        self._progress = made("progress", 16, f"{_BUILD}::Progress")
        self._history = made("history", 4 * (_MOST + 16), "u32")
        self._deepest = made("deepest", 4, "atomic<u32>")
        self._digits = made("digit", 8, "u32")

    def _buffer(self, label: str, data: NDArray[Any] | int, element: str, usage: str = "storage") -> Buffer:
        buffer = self._gpu.buffer(f"tracing.build.{label}", data, owner=OWNER, element=element, usage=usage)
        self._buffers.append(buffer)
        return buffer

    def sort(self, entry: str, scope: Mapping[str, Any]) -> None:
        """Put the leaves in order; ``entry`` makes their keys."""
        gpu, leaves = self._gpu, self._leaves
        count = gpu.constant(leaves)
        gpu.compute("tracing.keys", _BUILD, entry).bind(
            scope, keys_out=self._keys[0], values_out=self._values[0], leaf_count=count
        ).dispatch_line(leaves)
        # 48 bits of the curve, and of the group as many as there are.
        digits = 12 + -(-(self._groups - 1).bit_length() // 4)
        blocks = -(-leaves // _BLOCK)
        gpu.write(self._digits, np.zeros(2, np.uint32))
        rounds = []
        for source, target in ((0, 1), (1, 0)):
            bound = {
                "keys_in": self._keys[source],
                "keys_out": self._keys[target],
                "values_in": self._values[source],
                "values_out": self._values[target],
                "digit_counts": self._counts.read_write(),
                "digits": self._digits.read_write(),
                "key_count": count,
            }
            names = ("sort_count", "sort_scan", "sort_scatter")
            rounds.append([gpu.compute("tracing.sort", _SORT, name).bind(bound).prepare() for name in names])
        with gpu.chain("tracing.sort"):
            for digit in range(digits):
                counting, scan, scatter = rounds[digit % 2]
                counting.line(blocks * _THREADS)
                scan.run(1)
                scatter.line(blocks * _THREADS)
        self._order = self._values[digits % 2]

    def cluster(self, entry: str, scope: Mapping[str, Any], *, paired: bool = False) -> tuple[Parts, Steps]:
        """Merge the leaves, which ``entry`` makes in their order, until one cluster of each group is left.

        Returns those clusters, and where the nodes of each step begin.
        """
        gpu = self._gpu
        clusters = [(buffer.split(), buffer.split(write=True)) for buffer in self._clusters]
        leaf_count = gpu.constant(self._leaves)
        gpu.compute("tracing.leaves", _BUILD, entry).bind(
            scope, values_in=self._order, clusters_out=clusters[0][1], leaf_count=leaf_count
        ).dispatch_line(self._leaves)
        start = np.zeros(2, self._progress.dtype)
        start[0] = (self._leaves, self._first)
        gpu.write(self._progress, start)
        gpu.write(self._history, np.zeros(1, np.uint32))
        gpu.write(self._deepest, np.zeros(1, np.uint32))
        steps: dict[str, list[list[Prepared]]] = {}
        left, step = self._leaves, 0
        looks = itertools.chain(_LOOKS, itertools.repeat(8))
        while left > self._groups:
            if step > _MOST:
                raise GpuError(f"tracing: {left} clusters are left of {self._leaves} leaves after {step} steps")
            mode = "pair" if paired or step >= _PATIENCE else "nearest"
            if mode not in steps:
                steps[mode] = [self._prepare(parity, clusters, mode) for parity in range(2)]
            with gpu.chain("tracing.cluster"):
                for _ in range(next(looks)):
                    choose, count, scan, merge = steps[mode][step % 2]
                    choose.line(left)
                    count.line(left)
                    scan.run(1)
                    merge.line(left)
                    step += 1
            left = int(gpu.read_buffer(self._progress)["clusters"][step % 2])
        nodes = gpu.read_buffer(self._history)[1 : step + 1]
        depth = int(gpu.read_buffer(self._deepest)[0])
        starts = tuple(int(n) for n in np.unique([self._first, *nodes]))
        return clusters[step % 2][0], Steps(starts, depth)

    def _prepare(self, parity: int, clusters: list[tuple[Parts, Parts]], mode: str) -> list[Prepared]:
        """A step that reads the clusters of one parity and writes those of the other."""
        gpu = self._gpu
        bound = {
            "clusters_in": clusters[parity][0],
            "clusters_out": clusters[1 - parity][1],
            "blocks": self._blocks.read_write(),
            "progress": self._progress.read_write(),
            "history": self._history.read_write(),
            "deepest": self._deepest.read_write(),
            "trace_nodes": self._nodes.split(write=True),
            "parity": gpu.constant(parity),
            "radius": gpu.constant(RADIUS),
        }
        return [
            gpu.compute("tracing.cluster", _BUILD, entry)
            .bind(bound, neighbours=self._neighbours.split(write=entry == mode))
            .prepare()
            for entry in (mode, "count_merges", "scan_merges", "merge")
        ]

    def close(self) -> None:
        """Free the temporary buffers."""
        for buffer in self._buffers:
            buffer.destroy()
        self._buffers.clear()
        self._gpu.forget_groups()
