"""Wrist poses that a policy leaves free: found in the graph, refined, smoothed, drawn in rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.policies.families import Family
from sphmctl.planner.policies.graph import Ridge, Seed, cheapest, has_answer, layer_rows
from sphmctl.planner.policies.known import Task, resolve_cranks
from sphmctl.planner.policies.outcome import Outcome, Reason, Resolved, Unresolved
from sphmctl.planner.policies.passage import led_through
from sphmctl.planner.policies.tube import inserted, refined, smooth

COARSE_M, FINE_M = 0.02, 0.01
"""Distance of layers: in the graph first, and where the way is refined. A hard path's graph has
fine ones too, and more wrist poses."""

FINE_HALVINGS = 3
"""Of the tube, done on the coarse layers already."""


def resolve_free(task: Task, family: Family, seeds: tuple[Seed, ...] = ()) -> Outcome:
    """The cheapest joints that the family of wrist poses allows."""
    failed: Outcome | None = None
    for dense in (False, True):
        rows = layer_rows(task.way_m, FINE_M if dense else COARSE_M)
        ridge = cheapest(task, family, rows, seeds, dense)
        if isinstance(ridge, Reason):
            failed = Unresolved((ridge,))
            if not has_answer(task, family, ridge.row):
                break
            continue
        for better, curved in _ways(task, family, ridge):
            outcome = resolve_cranks(
                replace(task, start=better.joints[0]), _drawn(task, family, better, curved)
            )
            if isinstance(outcome, Resolved):
                return outcome
            failed = outcome
        if seeds:
            break
    assert failed is not None  # the loop has run
    return failed


def resolve_best(
    task: Task, family: Family, others: Iterator[Outcome], fallback: Iterator[Outcome]
) -> Outcome:
    """The cheapest joints of the family's and of others.

    Args:
        others: answers that are part of the graph and compared with the result.
        fallback: answers that are asked for when there is no other.
    """
    known = [outcome for outcome in others if isinstance(outcome, Resolved)]
    found = resolve_free(task, family, tuple(Seed(outcome.joints) for outcome in known))
    if isinstance(found, Resolved):
        known.append(found)
    if known:
        return min(known, key=lambda outcome: outcome.cost)
    return next((outcome for outcome in fallback if isinstance(outcome, Resolved)), found)


def _ways(task: Task, family: Family, ridge: Ridge) -> Iterator[tuple[Ridge, bool]]:
    """The way refined, best first, then plainer ones; whether they are to be drawn as curves."""
    ridge = led_through(task, family, ridge)
    coarse = refined(task, family, ridge)
    rows = np.union1d(coarse.rows, layer_rows(task.way_m, FINE_M))
    fine = inserted(task, family, coarse, rows)
    if fine is not None:
        yield refined(task, family, fine, FINE_HALVINGS), True
    yield coarse, True
    yield coarse, False
    yield ridge, False


def _drawn(task: Task, family: Family, ridge: Ridge, curved: bool) -> Floats:
    """Crank angles (n, 3) of every row; those of the first and last layer as they are."""
    knots_m = task.way_m[ridge.rows]
    if curved:
        values = smooth(task.way_m, knots_m, ridge.values)
    else:
        columns = [np.interp(task.way_m, knots_m, column) for column in ridge.values.T]
        values = np.stack(columns, axis=1)
    rows = np.arange(len(task.target))
    cranks = np.array(family.cranks(rows, np.clip(values, family.low, family.high)))
    cranks[[0, -1]] = ridge.joints[[0, -1], 6:]
    return cranks
