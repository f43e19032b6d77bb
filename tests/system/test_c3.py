"""The octagon over C3 Bridge: within the figures of KUKAVARPROXY's, and with fewer requests."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from unittest.mock import Mock

import pytest

from sphmctl.cli import main
from sphmctl.wire import c3
from tests.system.rig import run
from tests.system.test_octagon import LIMITS, figures, run_octagon

CELL = """
version: 1
name: emulated, with C3 Bridge
arm: {driver: emulated, flavour: c3}
wrist: {driver: emulated}
"""


def test_the_octagon_is_followed_in_step_over_c3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    wide = Mock(wraps=c3.encode_read)
    monkeypatch.setattr(c3, "encode_read", wide)
    cell = tmp_path / "cell.yaml"
    cell.write_text(CELL)
    folder = run_octagon(tmp_path, 1, capsys, "--cell", str(cell))
    result = figures(folder)
    print(result)
    assert wide.call_count > 1000, "it was not C3 Bridge"
    for name in ("p99_ms", "crank_deg", "tool_mm", "duration_s"):
        assert result[name] <= LIMITS[name], name
    assert result["share"] >= LIMITS["share"]


def test_a_run_needs_fewer_requests_before_it_moves() -> None:
    counts: dict[str, Counter[int]] = {}
    resting: dict[str, int] = {}
    for flavour in ("kvp", "c3"):
        ended = run(flavour="c3" if flavour == "c3" else "kvp")
        assert ended.outcome.outcome == "completed"
        frames = ended.rig.kvp.frames
        functions = [frame[4] for _, frame in frames]
        counts[flavour] = Counter(functions)
        knot = "SPH_KNOT".encode("utf-16-le" if flavour == "c3" else "ascii")
        resting[flavour] = next(n for n, (_, frame) in enumerate(frames) if knot in frame)
    whole = {flavour: sum(count.values()) for flavour, count in counts.items()}
    print(f"requests of a run: {whole}, ratio {whole['c3'] / whole['kvp']:.3f}; {counts}")
    print(f"before the first knot: {resting}, ratio {resting['c3'] / resting['kvp']:.2f}")
    # Both wait for the program to start, with the same requests.
    assert resting["c3"] < resting["kvp"]
    assert whole["c3"] < 1.02 * whole["kvp"]
    assert counts["c3"][6] > 0
    assert not set(counts["kvp"]) - {0, 1}


def test_emulate_refuses_a_flavour_that_does_not_exist(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["emulate", "--flavour", "c4"]) == 2
    assert "give kvp or c3" in capsys.readouterr().err
