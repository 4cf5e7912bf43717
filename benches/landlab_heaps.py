"""The collapsing cylinder and the cone of `dlsys report --surroundings`, with components of Landlab.

    pip install landlab==2.9.2
    python3 landlab_heaps.py

Landlab (https://landlab.csdms.io) has laws of hillslopes with a critical slope: below it soil creeps, near it the flux grows without bound. Heaps
do not come to rest there, as they do under a law of slipping; the table has the instant at which each is nearest to the exact heap.
"""

import time

import numpy as np
from landlab import RasterModelGrid
from landlab.components import FlowDirectorSteepest, TaylorNonLinearDiffuser, TransportLengthHillslopeDiffuser

SLOPE = 0.7
RADIUS, HEIGHT = 0.5, 0.4


def cylinder(r):
    return np.where(r <= RADIUS, HEIGHT, 0.0)


def exact_cylinder(r):
    plateau = -HEIGHT / (2 * SLOPE) + np.sqrt(RADIUS**2 - HEIGHT**2 / (12 * SLOPE**2))
    return np.clip(HEIGHT - SLOPE * (r - plateau), 0.0, HEIGHT)


def column(r):
    """A column as wide as a fifth of the cone that it becomes, of the same volume."""
    foot = RADIUS
    volume = np.pi * foot**3 * SLOPE / 3
    inner = foot / 5
    return np.where(r <= inner, volume / (np.pi * inner**2), 0.0)


def exact_cone(r):
    return np.clip(SLOPE * (RADIUS - r), 0.0, None)


def mean_over_cells(shape, of, cell, points=8):
    """Means over cells, by points within each."""
    rows, columns = shape
    offsets = (np.arange(points) + 0.5) / points - 0.5
    z, x = np.meshgrid(np.arange(rows) - rows // 2, np.arange(columns) - columns // 2, indexing="ij")
    total = sum(of(np.hypot((x + dx) * cell, (z + dz) * cell)) for dx in offsets for dz in offsets)
    return total / points**2


def run(component, begin, exact, fineness, steps, step):
    cell = RADIUS / fineness
    side = 2 * (9 * fineness // 5) + 1
    grid = RasterModelGrid((side, side), xy_spacing=cell)
    # The edges are closed, as they are in dlsys.
    grid.set_closed_boundaries_at_grid_edges(True, True, True, True)
    height = grid.add_zeros("topographic__elevation", at="node")
    height[:] = mean_over_cells((side, side), begin, cell).ravel()
    goal = mean_over_cells((side, side), exact, cell).ravel()
    volume = height.sum() * cell**2
    law = component(grid)
    best, when = np.inf, 0
    began = time.perf_counter()
    for number in range(steps):
        law.run_one_step(step * cell**2)
        error = np.abs(height - goal).sum() * cell**2 / volume
        if error < best:
            best, when = error, number
        elif number > 2 * when + 50:
            break
    seconds = time.perf_counter() - began
    lost = height.sum() * cell**2 / volume - 1
    return best, lost, seconds, number + 1


def taylor(grid):
    return TaylorNonLinearDiffuser(grid, linear_diffusivity=1.0, slope_crit=SLOPE, dynamic_dt=True, if_unstable="pass")


class transport_length:
    """Sediment goes down the steepest way of each cell, as far as the slope there lets it."""

    def __init__(self, grid):
        self.ways = FlowDirectorSteepest(grid)
        self.ways.run_one_step()
        self.law = TransportLengthHillslopeDiffuser(grid, erodibility=1.0, slope_crit=SLOPE)

    def run_one_step(self, dt):
        self.ways.run_one_step()
        self.law.run_one_step(dt)


if __name__ == "__main__":
    print(f"{'case':<10} {'component':<34} {'cells':>5} {'error (volumes)':>16} {'volume lost':>12} {'seconds':>8} {'steps':>6}")
    for case, begin, exact in [("cylinder", cylinder, exact_cylinder), ("cone", column, exact_cone)]:
        for name, finenesses, component, steps, step in [
            ("TaylorNonLinearDiffuser", (8, 16, 32), taylor, 400, 0.5),
            # Minutes at 32.
            ("TransportLengthHillslopeDiffuser", (8, 16), transport_length, 4000, 0.05),
        ]:
            for fineness in finenesses:
                best, lost, seconds, count = run(component, begin, exact, fineness, steps, step)
                print(f"{case:<10} {name:<34} {fineness:>5} {best:>16.2e} {lost:>12.1e} {seconds:>8.2f} {count:>6}", flush=True)
