"""Drivers made from a cell file reach the emulated cell over TCP and a pseudo-terminal."""

from __future__ import annotations

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.config import Arm, Cell, Wrist, emulated_cell
from sphmctl.drivers.connect import make_arm, make_wrist
from sphmctl.emulators.cell import EmulatedCell, Setup
from sphmctl.errors import DeviceError

pytestmark = pytest.mark.realtime


def _cell(port: int, device: str, **wrist: object) -> Cell:
    parts = {"driver": "dynamixel", "port": device, **wrist}
    return Cell(
        version=1,
        name="lab",
        arm=Arm(driver="kvp", host="127.0.0.1", port=port),
        wrist=Wrist.model_validate(parts),
    )


def test_both_drivers_reach_their_devices_over_real_links() -> None:
    setup = Setup(
        cranks_deg=(10.0, 50.0, 100.0),
        zero_ticks=(1365, 2730, 1000),
        direction=(1, -1, 1),
        ids=(11, 12, 13),
    )

    async def main() -> None:
        emulated = EmulatedCell(1, setup, latency="none")
        port, device = await emulated.serve()
        cell = _cell(
            port, device, ids=setup.ids, zero_ticks=setup.zero_ticks, direction=setup.direction
        )
        arm, wrist = make_arm(cell), make_wrist(cell)
        try:
            await arm.connect()
            await wrist.connect()
            assert (await arm.identity()).program == "SPH_RUN"
            axes = np.degrees(await arm.read_axes())
            assert axes == pytest.approx(setup.arm_deg, abs=1e-3)
            cranks = np.degrees(await wrist.read_cranks())
            assert cranks == pytest.approx(setup.cranks_deg, abs=0.09)
            await wrist.verify()
        finally:
            await arm.close()
            await wrist.close()
            await emulated.close()

    clock.run(main())


@pytest.mark.parametrize("flavour", ["auto", "c3"])
def test_a_c3_bridge_is_reached_over_tcp(flavour: str) -> None:
    async def main() -> None:
        emulated = EmulatedCell(1, latency="none", flavour="c3")
        port, device = await emulated.serve()
        cell = _cell(port, device)
        arm = make_arm(
            cell.model_copy(update={"arm": cell.arm.model_copy(update={"flavour": flavour})})
        )
        try:
            await arm.connect()
            assert arm.flavour == "c3"
            assert (await arm.identity()).program == "SPH_RUN"
            assert np.degrees(await arm.read_axes()) == pytest.approx(Setup().arm_deg, abs=1e-3)
        finally:
            await arm.close()
            await emulated.close()

    clock.run(main())


def test_errors_name_host_and_port() -> None:
    async def main() -> None:
        emulated = EmulatedCell(1)
        port, _ = await emulated.serve()
        await emulated.close()
        arm = make_arm(_cell(port, "/dev/null"))
        with pytest.raises(DeviceError, match=f"controller 127.0.0.1:{port}: nothing listens"):
            await arm.connect()
        await arm.close()

    clock.run(main())


def test_a_port_without_servos_names_port_and_servo() -> None:
    async def main() -> None:
        emulated = EmulatedCell(1)
        port, device = await emulated.serve()
        wrist = make_wrist(_cell(port, device, ids=(4, 5, 6)))
        await wrist.connect()
        try:
            with pytest.raises(DeviceError, match=rf"wrist {device}: servo 4 \(leg 1\): does not"):
                await wrist.verify()
        finally:
            await wrist.close()
            await emulated.close()

    clock.run(main())


def test_only_a_cell_with_a_board_gets_a_board() -> None:
    cell = emulated_cell()
    assert make_wrist(cell).board is None
    wrist = cell.wrist.model_copy(update={"board_id": 200})
    assert make_wrist(cell.model_copy(update={"wrist": wrist})).board is not None


def test_a_board_with_another_id_is_refused() -> None:
    with pytest.raises(ValueError, match="7 should be 200, which is fixed in the board, or null"):
        _cell(1, "/dev/null", board_id=7)
