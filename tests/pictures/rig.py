"""A small plan to draw, and headless Chromium to look with."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from sphmctl.motion import Knot, NamedPoint, Plan
from sphmctl.pictures import Limits
from sphmctl.robots import sphm

LIMITS = Limits(sphm.RANGES9, sphm.MAX_SPEED9, sphm.MAX_ACCELERATION9)
START = np.radians([10.0, -60.0, 100.0, 5.0, 40.0, -5.0, 30.0, 60.0, 90.0])
END = np.radians([-20.0, -40.0, 80.0, -10.0, 60.0, 30.0, 90.0, 30.0, 60.0])
TOOL = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0.0589], [0, 0, 0, 1.0]])
YAW_RAD = 0.4

# What Chromium needs to run unattended, as root, without asking anything of a network.
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--hide-scrollbars",
    "--enable-logging=stderr",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def make_plan(name: str = "sweep", rows: int = 501) -> Plan:
    """A smooth way from START to END in 4 s."""
    u = np.linspace(0.0, 1.0, rows)
    w = u * u * (3.0 - 2.0 * u)
    joints = START + w[:, None] * (END - START)
    knots = tuple(Knot(k, joints[k, :6], 0.5, 0.5) for k in (rows // 2, rows - 1))
    points = (NamedPoint("A", 0), NamedPoint("B", rows - 1))
    tool = sphm.forward(joints, TOOL, YAW_RAD)
    return Plan(name, 4.0 * u, joints, tool, knots, points, (), TOOL, np.eye(4))


def browse(folder: Path, page: Path, *flags: str, at: str = "") -> subprocess.CompletedProcess[str]:
    """What Chromium prints of a page, opened at a fragment, with a profile of its own."""
    program = next(found for name in BROWSERS if (found := shutil.which(name)))
    profile = f"--user-data-dir={folder / 'profile'}"
    command = [program, *FLAGS, profile, *flags, f"{page.as_uri()}#{at}"]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)


def console(stderr: str) -> list[str]:
    """What the page and its loading wrote on the console."""
    return re.findall(r"CONSOLE[^\n]*", stderr)
