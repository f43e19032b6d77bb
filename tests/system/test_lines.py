"""What is told of the lines between controller and board before anything moves."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sphmctl import clock
from sphmctl.config import Lines
from sphmctl.drivers.finding import Finding
from sphmctl.emulators.controller import Options
from sphmctl.errors import DeviceError
from tests.system.rig import Rig, run


def findings(
    options: Options | None = None,
    prepare: Callable[[Rig], object] = lambda rig: None,
    lines: Lines | None = None,
) -> dict[str, Finding]:
    """What is found at arm and lines, by name."""

    async def main() -> list[Finding]:
        rig = Rig(options=options)
        arm = rig.cell.arm.model_copy(update={"lines": lines})
        wrist = rig.cell.wrist.model_copy(update={"board_id": None if lines is None else 200})
        rig.cell = rig.cell.model_copy(update={"arm": arm, "wrist": wrist})
        rig.anew()
        prepare(rig)
        try:
            await rig.session.open()
            return await rig.session.examine_arm()
        finally:
            await rig.close()

    return {finding.name: finding for finding in clock.run(main(), virtual=True)}


def test_without_a_board_the_lines_are_off_and_that_is_said() -> None:
    found = findings()
    assert all(finding.ok for finding in found.values())
    told = found["line wrist ok"].detail
    assert told == "off: a wrist that fails stops the arm through this computer only"
    events = run().rig.events.history
    assert [fields["message"] for _, name, fields in events if name == "lines off"] == [
        f"line wrist ok: {told}"
    ]


def test_a_program_whose_signal_and_number_differ_is_found() -> None:
    def rewire(rig: Rig) -> None:
        rig.emulated.controller.store.put("SPH_IN_OK", 7)

    found = findings(prepare=rewire)
    assert not found["signal wrist ok"].ok
    assert found["signal wrist ok"].detail == "SPH_OK on, its input off"


def test_an_input_that_should_always_be_true_and_is_not_is_found() -> None:
    def change(rig: Rig) -> None:
        rig.emulated.controller.krc.terminals.inputs[1024] = False

    found = findings(prepare=change)
    assert found["signal wrist ok"].detail == "SPH_OK off, its input off"
    assert not found["signal wrist ok"].ok


@pytest.mark.parametrize(("knot", "ok"), [(1, True), (9, False)])
def test_other_numbers_than_the_cell_files_are_found(knot: int, ok: bool) -> None:
    found = findings(Options(lines=True), lines=Lines(wrist_ok=1, knot=knot, arm_moving=2))
    assert found["line wrist ok"].ok
    assert found["lines' numbers"].ok is ok
    assert found["lines' numbers"].detail == "SPH_IN_OK=1, SPH_OUT_KNOT=1, SPH_OUT_MOVING=2"


def test_a_bridged_input_is_refused_before_anything_moves() -> None:
    async def main() -> str:
        rig = Rig(board="simulated")
        try:
            await rig.session.open()
            found = await rig.session.examine_level()
            assert [finding.detail for finding in found] == [
                "off at the board, off at the controller"
            ]
            lines = rig.emulated.controller.lines
            assert lines is not None
            lines.wrist_ok = True
            with pytest.raises(DeviceError) as raised:
                await rig.session.verify()
            return str(raised.value)
        finally:
            await rig.close()

    told = clock.run(main(), virtual=True)
    assert "level of wrist ok: off at the board, on at the controller; check the wire" in told
