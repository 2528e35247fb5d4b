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

**Practice.** Nothing is read back while a step runs: a step says by an indirect dispatch how large the next one is.
Nodes are numbered in the order of the steps, so a child precedes its parent, and moving instances is a refit: the upper
tree's nodes, step by step. Equal input gives the same tree on every device. Buffers beyond an adapter's limit of a
binding are bound in parts. A tree deeper than the traversal's stack (triangles of exponentially growing size) is built
again by pairing neighbours on the curve, whatever their boxes, which has logarithmic depth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, GpuError, line_of
from tyndall.gpu.resources import Buffer, Closing, Parts, Resource

OWNER = "tracing"
RADIUS = 16  # neighbours searched on either side; 8 builds faster, 32 hardly traces faster
STACK = 96  # as tracing/rays.wesl has it

_BUILD = "package::tracing::build"
_SORT = "package::tracing::sort"
_THREADS = 256
_BLOCK = 1024  # keys of a block of the sort
_STEPS = 24  # encoded between two looks at how far it has come
_PATIENCE = 96  # steps before pairing


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
        made = self._buffer
        self._keys = [made(f"keys{i}", 8 * leaves, "vec2u").split(write=True) for i in range(2)]
        self._values = [made(f"order{i}", 4 * leaves, "u32").split(write=True) for i in range(2)]
        self._counts = made("digits", 64 * -(-leaves // _BLOCK), "u32")
        cluster = f"{_BUILD}::Cluster"
        size = gpu.dtype(cluster).itemsize
        self._clusters = [made(f"clusters{i}", size * leaves, cluster) for i in range(2)]
        self._neighbours = made("neighbours", 4 * leaves, "u32")
        self._blocks = made("blocks", 8 * -(-leaves // _THREADS), "vec2u")
        self._progress = made("progress", 8 * (2 * _PATIENCE + 2), f"{_BUILD}::Progress")
        self._arguments = made("arguments", 12 * (2 * _PATIENCE + 2), "u32", "storage indirect")
        self._deepest = made("deepest", np.zeros(4, np.uint32), "atomic<u32>")

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
        for digit in range(digits):
            source, target = digit % 2, (digit + 1) % 2
            bound = {
                "keys_in": self._keys[source],
                "keys_out": self._keys[target],
                "values_in": self._values[source],
                "values_out": self._values[target],
                "digit_counts": self._counts.read_write(),
                "key_count": count,
                "digit": gpu.constant(digit),
            }
            gpu.compute("tracing.sort", _SORT, "sort_count").bind(bound).dispatch_line(blocks * _THREADS)
            gpu.compute("tracing.sort", _SORT, "sort_scan").bind(bound).dispatch(1)
            gpu.compute("tracing.sort", _SORT, "sort_scatter").bind(bound).dispatch_line(blocks * _THREADS)
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
        rows = np.zeros(2 * _PATIENCE + 2, self._progress.dtype)
        rows[0] = (self._leaves, self._first)
        gpu.write(self._progress, rows)
        gpu.write(self._arguments, np.array(line_of(-(-self._leaves // _THREADS)), np.uint32))
        gpu.write(self._deepest, np.zeros(4, np.uint32))
        step = 0
        left = self._leaves
        while left > self._groups:
            end = step + _STEPS
            if end > 2 * _PATIENCE:
                raise GpuError(
                    f"tracing: {left} clusters are left of {self._leaves} leaves"
                )  # cannot be: pairing halves
            while step < end:
                self._step(step, clusters, paired or step >= _PATIENCE)
                step += 1
            left = int(gpu.read_buffer(self._progress)["clusters"][step])
        progress = gpu.read_buffer(self._progress)[: step + 1] if step else rows[:1]
        depth = int(gpu.read_buffer(self._deepest)[0])
        starts = tuple(int(n) for n in np.unique(progress["nodes"]))
        return clusters[step % 2][0], Steps(starts, depth)

    def _step(self, step: int, clusters: list[tuple[Parts, Parts]], paired: bool) -> None:
        gpu = self._gpu
        bound = {
            "clusters_in": clusters[step % 2][0],
            "clusters_out": clusters[(step + 1) % 2][1],
            "neighbours": self._neighbours.split(),
            "blocks": self._blocks.read_write(),
            "progress": self._progress.read_write(),
            "arguments": self._arguments.read_write(),
            "deepest": self._deepest.read_write(),
            "trace_nodes": self._nodes.split(write=True),
            "step": gpu.constant(step),
            "radius": gpu.constant(RADIUS),
            "pairing": gpu.constant(step % 2),
        }
        choose = {**bound, "neighbours": self._neighbours.split(write=True)}
        at = 12 * step

        def run(entry: str, scope: Mapping[str, Any]) -> None:
            gpu.compute("tracing.cluster", _BUILD, entry).bind(scope).dispatch_indirect(self._arguments, at)

        del bound["arguments"]
        run("pair" if paired else "nearest", {k: v for k, v in choose.items() if k != "arguments"})
        run("count_merges", bound)
        gpu.compute("tracing.cluster", _BUILD, "scan_merges").bind(
            bound, arguments=self._arguments.read_write()
        ).dispatch(1)
        run("merge", bound)

    def resources(self) -> list[Resource]:
        """What the build holds on the device."""
        return list(self._buffers)

    def close(self) -> None:
        """Free the temporary buffers."""
        for buffer in self._buffers:
            buffer.destroy()
        self._buffers.clear()
        self._gpu.forget_groups()
