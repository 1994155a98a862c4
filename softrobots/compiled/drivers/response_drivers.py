"""Derivatives of many cases side by side, in blocks of lanes; the text goes into generated modules once for each response."""

from __future__ import annotations

from typing import Any

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import zeros
from softrobots.compiled.drivers.lane_drivers import Places, Rows, load_block, store_block
from softrobots.compiled.settings import *


def respond_batch(inputs: Rows, places: Places, outputs: Rows, result_places: Places, sums: Any, first: int, last: int) -> None:
    """Compute rates or weights; add the weights of the numbers of the robot to row `first // CHUNK` of the sums."""
    lanes = zeros(LANE_SIZE * LANES)
    size = sums.shape[1] * LANES
    total = zeros(size + 1)
    for begin in range(first, last, LANES):
        load_block(lanes, inputs, places, begin, last)
        respond_lanes(lanes)
        store_block(lanes, outputs, result_places, begin, last)
        if last - begin >= LANES:
            for k in range(size):
                total[k] += lanes[NUMBER_WEIGHTS * LANES + k]
        else:
            for k in range(size):
                if k % LANES < last - begin:
                    total[k] += lanes[NUMBER_WEIGHTS * LANES + k]
    for k in range(size):
        sums[first // CHUNK, k // LANES] += total[k]
