"""A thousand random feasible paths: within every limit, on the path, and as quick as toppra's."""

from __future__ import annotations

from pathlib import Path as FilePath

import pytest

from tests.planner.judging import judge, planned
from tests.planner.many_paths import AUTO_EACH, KINDS, POLICIES
from tests.planner.witness import feasible

FEW, MANY = 40, 1000
HARD = (96, 783, 951)
"""Polylines and a passage whose usual rows are too coarse."""


def keeps_everything(seed: int, folder: FilePath) -> None:
    drawn, path = feasible(seed, folder)
    outcome = planned(path)
    about = f"seed {seed}, {drawn.kind}, {drawn.policy}, near {drawn.near or 'nothing'}"
    assert outcome.made is not None, f"{about}: {outcome.problems}\n{drawn.text}"
    assert outcome.made.rows.block[-1] == len(outcome.blocks) - 1
    verdict = judge(drawn, path, outcome)
    print(f"{about}: {verdict.text()}")
    assert verdict.failures() == [], f"{about}\n{drawn.text}"


@pytest.mark.parametrize("seed", [*range(FEW), *HARD])
def test_a_random_path_keeps_its_limits_and_its_time(seed: int, tmp_path: FilePath) -> None:
    keeps_everything(seed, tmp_path)


@pytest.mark.many
@pytest.mark.parametrize("seed", sorted({*range(FEW, MANY)} - {*HARD}))
def test_another_random_path_keeps_its_limits_and_its_time(seed: int, tmp_path: FilePath) -> None:
    keeps_everything(seed, tmp_path)


def test_the_seeds_mix_all_kinds_and_policies() -> None:
    mixes = {(seed % len(KINDS), seed // len(KINDS) % len(POLICIES)) for seed in range(FEW)}
    assert len(mixes) == len(KINDS) * len(POLICIES)
    assert sum(seed % 6 in (0, 3) for seed in range(MANY)) >= MANY // 3
    assert MANY // AUTO_EACH == 20
