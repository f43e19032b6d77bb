"""The arm's driver against the emulated controller, and against answers that are wrong."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers.kuka import SESSION_TIMEOUT_S, KukaArm
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.emulators.controller import Options
from sphmctl.errors import DeviceError
from tests.drivers.far_end import FarEnd, kvp_name, kvp_reply
from tests.system.rig import Rig

AXES = "{E6AXIS: A1 1.0, A2 -90.0, A3 9.0E+01, A4 0, A5 90.0, A6 0.0, E1 0.0}"
STATE = (
    "{SPH_STATE_T: VERSION 3, CHECK 5, SESSION 3, STATUS 2, FAULT 0, WRIST 2, RD 7, DONE 5, "
    "BEAT 9, TIME 3600012, OV 50, MOVING TRUE, STOPPED FALSE, DRIVES TRUE, SAFE TRUE, "
    f"STOPMESS FALSE, MODE #T1, Q {AXES}}}"
)


def _with_arm(test: Callable[[Rig], Awaitable[None]], options: Options | None = None) -> None:
    async def main() -> None:
        rig = Rig(options=options)
        await rig.arm.connect()
        try:
            await test(rig)
        finally:
            await rig.close()

    clock.run(main(), virtual=True)


def _answered(value: str, ask: Callable[[KukaArm], Awaitable[object]]) -> object:
    """What the driver makes of a controller that answers `value` to everything but PING."""

    def answer(far: FarEnd, request: bytes) -> None:
        far.send(kvp_reply(request, "PONG" if kvp_name(request) == "PING" else value), 0.002)

    async def main() -> object:
        arm = KukaArm(KvpClient(FarEnd(answer).open, "controller"), "controller")
        await arm.connect()
        try:
            return await ask(arm)
        finally:
            await arm.close()

    return clock.run(main(), virtual=True)


def test_the_state_structure_is_read_in_one_request_and_in_radians() -> None:
    async def ask(arm: KukaArm) -> object:
        return await arm.read_state()

    state = _answered(STATE, ask)
    assert getattr(state, "status", None) is krc.Status.RUNNING
    assert getattr(state, "mode", None) == "T1"
    assert (getattr(state, "taken", 0), getattr(state, "passed", 0)) == (7, 5)
    assert getattr(state, "moving", False) is True
    joints = np.degrees(getattr(state, "joints", np.zeros(6)))
    assert joints == pytest.approx((1.0, -90.0, 90.0, 0.0, 90.0, 0.0))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("7", "is '7', not a structure"),
        (STATE.replace("STATUS 2", "STATUS 9"), "holds 9, which is no status of interface"),
        (STATE.replace("FAULT 0", "FAULT -3"), "holds -3, which is no fault of interface"),
        (STATE.replace("WRIST 2", "WRIST 3"), "holds 3, which is no wrist of interface"),
        (STATE.replace("BEAT 9, ", ""), "lacks BEAT: SPH_RUN is of another version than 3; write"),
        (STATE.replace("RD 7", "RD 7.5"), "a whole number was expected"),
        (STATE.replace("A3 9.0E+01", "A4 0.0"), "twice"),
        (STATE.replace("A3 9.0E+01, ", ""), "axis angles were expected"),
        (STATE[:-5], "KRL value"),
    ],
)
def test_a_state_that_is_not_the_interfaces_is_a_clear_error(text: str, sentence: str) -> None:
    async def ask(arm: KukaArm) -> object:
        return await arm.read_state()

    with pytest.raises(DeviceError) as raised:
        _answered(text, ask)
    assert sentence in str(raised.value)


def test_a_session_clears_what_was_and_has_a_new_number() -> None:
    async def test(rig: Rig) -> None:
        first = await rig.arm.begin_session()
        assert (first.status, first.session) == (krc.Status.READY, 1)
        second = await rig.arm.begin_session()
        assert (second.session, second.taken, second.passed) == (2, 0, 0)

    _with_arm(test)


def test_a_program_that_does_not_take_a_session_is_told_and_stays_connected() -> None:
    async def test(rig: Rig) -> None:
        begin_s = rig.loop.time()
        with pytest.raises(DeviceError, match="SPH_RUN did not take the session within 1 s"):
            await rig.arm.begin_session()
        assert rig.loop.time() - begin_s < SESSION_TIMEOUT_S + 0.1
        assert rig.arm.connected

    _with_arm(test, Options(program_state="P_STOP"))


def test_knots_go_round_the_ring_with_degrees_and_percents() -> None:
    async def test(rig: Rig) -> None:
        joints = np.radians([1.5, -90.0, 90.0, 0.0, 90.0, -0.25])
        for sequence, slot in ((1, 1), (64, 64), (65, 1), (130, 2)):
            await rig.arm.write_knot(sequence, joints, 0.125, 1.0)
            knots = rig.emulated.controller.store.get("SPH_KNOT")
            assert isinstance(knots, list)
            knot = knots[slot - 1]
            assert isinstance(knot, dict)
            assert (knot["SEQ"], knot["VEL"], knot["ACC"]) == (sequence, 12.5, 100.0)
            axes = knot["Q"]
            assert isinstance(axes, dict)
            assert [axes[f"A{n}"] for n in (1, 2, 6)] == pytest.approx([1.5, -90.0, -0.25])

    _with_arm(test)


def test_the_heartbeat_changes_with_every_beat() -> None:
    async def test(rig: Rig) -> None:
        seen = []
        for _ in range(1100):
            await rig.arm.beat()
            seen.append(rig.emulated.controller.store.get("SPH_BEAT"))
        assert all(a != b for a, b in itertools.pairwise(seen))

    _with_arm(test)


def test_words_of_the_interface_reach_their_variables() -> None:
    async def test(rig: Rig) -> None:
        await rig.arm.publish(12)
        await rig.arm.declare_last(13)
        await rig.arm.command(krc.Command.STOP)
        store = rig.emulated.controller.store
        assert [store.get(n) for n in ("SPH_WR", "SPH_LAST", "SPH_CMD")] == [12, 13, 3]

    _with_arm(test)


def test_host_times_of_states_are_within_a_few_milliseconds_of_the_truth() -> None:
    async def test(rig: Rig) -> None:
        start_s = rig.emulated.world.start_s
        for _ in range(200):
            state = await rig.arm.read_state()
            await asyncio.sleep(0.001)
        # The emulated program turns every 12 ms from the world's begin on.
        away_s = (state.at_s - start_s + 0.006) % 0.012 - 0.006
        assert abs(away_s) < 0.002
        assert 0.0 < rig.loop.time() - state.at_s < 0.02

    _with_arm(test)


def test_a_slow_reply_is_not_taken_for_a_state_that_stands_still() -> None:
    delays_s = itertools.chain((0.4,), itertools.repeat(0.002))

    def answer(far: FarEnd, request: bytes) -> None:
        ping = kvp_name(request) == "PING"
        far.send(kvp_reply(request, "PONG" if ping else STATE), 0.002 if ping else next(delays_s))

    async def main() -> None:
        arm = KukaArm(KvpClient(FarEnd(answer).open, "controller"), "controller")
        await arm.connect()
        await arm.read_state()
        # The server was slow, and both replies show the cycle in which it woke up.
        await arm.read_state()
        await asyncio.sleep(0.13)
        with pytest.raises(DeviceError, match="has stood still for 13"):
            await arm.read_state()
        await arm.close()

    clock.run(main(), virtual=True)
