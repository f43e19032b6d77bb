"""The emulated cell: one world with a controller, an arm and three servos, on any links."""

from __future__ import annotations

import asyncio
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from sphmctl.emulators.adapter import Usb
from sphmctl.emulators.board import Board
from sphmctl.emulators.board_bus import BoardBus
from sphmctl.emulators.board_host import BoardHost
from sphmctl.emulators.controller import TICK_STEPS, Controller, Options
from sphmctl.emulators.krc_files import Numbers
from sphmctl.emulators.krc_lines import NUMBERS
from sphmctl.emulators.kvp_server import FlavourName, KvpServer, Latency
from sphmctl.emulators.kvp_server import Pipe as KvpPipe
from sphmctl.emulators.lines import Wiring
from sphmctl.emulators.servo_bus import Pipe as WristPipe
from sphmctl.emulators.servo_bus import ServoBus
from sphmctl.emulators.world import STEP_US, World
from sphmctl.emulators.xl430 import Servo

COUNTS_PER_TURN = 4096

LIVE_PERIOD_S = TICK_STEPS * STEP_US / 1e6
"""How often the world is brought up to date when nobody asks, in step with the robot program:
watchdogs must trip unobserved, and its outputs change on time."""

TruthSink = Callable[[float, tuple[float, ...]], None]


@dataclass(frozen=True)
class Setup:
    """How the cell is built.

    Attributes:
        arm_deg: the arm's axes at the start.
        cranks_deg: the cranks' angles at the start.
        zero_ticks: counts at crank angle 0, per leg.
        direction: 1 where counts rise with the crank angle, -1 where they fall.
        ids: servo ids in leg order.
        lines: where the controller's lines to a board are, if there is one.
    """

    arm_deg: tuple[float, ...] = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
    cranks_deg: tuple[float, ...] = (60.0, 60.0, 60.0)
    zero_ticks: tuple[int, ...] = (1365, 1365, 1365)
    direction: tuple[int, ...] = (1, 1, 1)
    ids: tuple[int, ...] = (1, 2, 3)
    lines: Numbers = NUMBERS


class EmulatedCell:
    """A cell that lives in the running loop's time.

    Args:
        seed: draws service times, the servos' lags, noise and phases; same seed, same cell.
        setup: how it is built.
        latency: the variable server's service times, "measured" or "none".
        flavour: which variable server it is, "kvp" or "c3".
        usb: the servos' USB adapter.
        pacing: whether the servo bus takes its wire time.
        truth: also told of each row of true joints.
        options: the controller's own settings.
        board: a simulated board between host and servos, its lines wired to the controller; the
            cell closes it.
    """

    def __init__(
        self,
        seed: int = 0,
        setup: Setup | None = None,
        *,
        latency: Latency = "measured",
        flavour: FlavourName = "kvp",
        usb: Usb = "16u2",
        pacing: bool = True,
        truth: TruthSink | None = None,
        options: Options | None = None,
        board: Board | None = None,
    ) -> None:
        self.setup = setup or Setup()
        rng = random.Random(seed)
        self.world = World(asyncio.get_running_loop().time)
        self.controller = Controller(
            self.world,
            random.Random(rng.random()),
            options
            or Options(
                start_deg=self.setup.arm_deg,
                lines=board is not None,
                line_numbers=self.setup.lines,
            ),
        )
        self.servos = tuple(self._servo(leg, random.Random(rng.random())) for leg in range(3))
        draws = random.Random(rng.random())
        self.kvp = KvpServer(self.controller, self.world, draws, latency, flavour=flavour)
        phase = random.Random(rng.random())
        self.bus = ServoBus(self.world, self.servos, phase, usb=usb, pacing=pacing)
        self.board = board
        self.wiring: Wiring | None = None
        if board is not None:
            self._connect(board, usb, phase)
        self.world.watch(self.true_joints_deg, truth)
        self._live = asyncio.get_running_loop().create_task(self._stay_live(), name="world")

    def _connect(self, board: Board, usb: Usb, phase: random.Random) -> None:
        self.board_bus = BoardBus(board, self.servos, self.world.advance)
        self._board_host = BoardHost(board, phase, usb)
        if self.controller.lines is not None:
            self.wiring = Wiring(self.controller.lines, board, self.world.advance)

    def _servo(self, leg: int, rng: random.Random) -> Servo:
        setup = self.setup
        counts = setup.cranks_deg[leg] * COUNTS_PER_TURN / 360.0
        start = setup.zero_ticks[leg] + setup.direction[leg] * counts
        return Servo(rng, setup.ids[leg], start)

    def true_joints_deg(self) -> tuple[float, ...]:
        """The nine joints as they are at the world's last step."""
        setup = self.setup
        cranks = (
            (servo.true_ticks - zero) * sign * 360.0 / COUNTS_PER_TURN
            for servo, zero, sign in zip(
                self.servos, setup.zero_ticks, setup.direction, strict=True
            )
        )
        return (*self.controller.true_joints_deg(), *cranks)

    def truth(self, begin_s: float, end_s: float) -> list[tuple[float, ...]]:
        """Rows of (world time s, nine true joints deg) between two instants of the loop's clock."""
        self.world.advance()
        return self.world.truth(begin_s, end_s)

    def attach(self, kvp: KvpPipe, wrist: WristPipe, baud: int) -> None:
        """Serve both protocols on memory links."""
        self.kvp.attach(kvp)
        self.attach_wrist(wrist, baud)

    def attach_wrist(self, wrist: WristPipe, baud: int) -> None:
        """Serve the servos on a memory link, through a held board where there is one."""
        if self.board is None:
            self.bus.attach(wrist, baud)
        else:
            self._board_host.attach(wrist, baud)

    async def serve(self, kvp_port: int = 0, wrist_link: Path | None = None) -> tuple[int, str]:
        """Serve on loopback TCP and a pseudo-terminal; returns port and device path.

        Raises:
            OSError: the port is in use, or the link cannot be made.
        """
        port = await self.kvp.serve_tcp("127.0.0.1", kvp_port)
        # A paced board has its own pseudo-terminal, and made its link at power-up.
        return port, self.bus.open_pty(wrist_link) if self.board is None else self.board.port

    async def close(self) -> None:
        """Hang up and stop living."""
        self._live.cancel()
        await asyncio.gather(self._live, return_exceptions=True)
        await self.kvp.close()
        await self.bus.close()
        if self.board is not None:
            self.board.close()

    async def _stay_live(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self.world.advance()
            turns = math.floor((loop.time() - self.world.start_s) / LIVE_PERIOD_S + 1e-6) + 1
            await asyncio.sleep(self.world.start_s + turns * LIVE_PERIOD_S - loop.time())
