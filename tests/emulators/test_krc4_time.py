"""The controller's state is a function of time, not of who looks at it."""

from __future__ import annotations

from tests.emulators.krc4_rig import RUN, Rig, away


def test_how_often_somebody_reads_changes_nothing() -> None:
    def run(look_every_ms: int) -> list[tuple[float, ...]]:
        rig = Rig(seed=3)
        rig.session()
        for number in range(1, 5):
            rig.knot(number, away(5.7 * number, axis=number), 80.0)
        rig.command(RUN)
        for elapsed_ms in range(0, 1200, look_every_ms):
            rig.now_s += look_every_ms / 1000
            rig.read("$AXIS_ACT")
            rig.read("SPH_STATE")
            if (elapsed_ms + look_every_ms) % 40 == 0:
                rig.write("SPH_BEAT", str(elapsed_ms + look_every_ms))
        return rig.truth

    assert run(1) == run(20) == run(40)
    assert len(set(run(40))) > 100
