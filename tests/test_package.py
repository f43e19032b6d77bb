"""What is installed from a wheel has all that the commands need, away from the source tree."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
KRC = REPOSITORY / "firmware" / "krc"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-index"]
    command += ["--no-build-isolation", "--wheel-dir", str(folder), str(REPOSITORY)]
    subprocess.run(command, check=True, capture_output=True, timeout=100)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(installed: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    begin = "from sphmctl.cli.main import main; main()"
    return subprocess.run(
        [sys.executable, "-c", begin, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


def test_it_exports_the_robot_program(installed: Path, tmp_path: Path) -> None:
    assert run(installed, tmp_path, "krl", "export", "stick").returncode == 0
    written = {path.name: path.read_text() for path in (tmp_path / "stick").iterdir()}
    assert written == {
        name: (KRC / name).read_text() for name in ("sph_run.src", "sph_run.dat", "sph_sps.src")
    }


@pytest.mark.realtime
def test_its_emulated_controller_runs_the_robot_program(installed: Path, tmp_path: Path) -> None:
    # A busy machine's own timers may be among the checks that fail.
    checks = json.loads(run(installed, tmp_path, "doctor", "--json").stdout)["checks"]
    assert {check["name"]: check["ok"] for check in checks}["program checksum"] is True


def test_it_carries_the_boards_firmware(installed: Path, tmp_path: Path) -> None:
    assert (installed / "sphmctl" / "board" / "board.hex").is_file()
