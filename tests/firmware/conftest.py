"""The compiled driver, once; a fresh board for each test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sphmctl.board.build import build
from tests.firmware.rig import Rig, compile_driver


@pytest.fixture(scope="session")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The board's modules compiled for this machine."""
    return compile_driver(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hex file of the present sources, which another test compares with the shipped one."""
    return build(tmp_path_factory.mktemp("built") / "board.hex").hex


@pytest.fixture
def bare(driver: Path) -> Iterator[Rig]:
    """A driver whose board has not been started."""
    rig = Rig(driver)
    yield rig
    rig.close()


@pytest.fixture
def rig(bare: Rig) -> Rig:
    """A board just powered up, in its safe state."""
    bare.start()
    return bare


@pytest.fixture
def free(rig: Rig) -> Rig:
    """A board whose safe state has been cleared: goals pass."""
    rig.write(98, 0)
    return rig
