"""Leaves out what compares with toppra where that has no wheel: anything but x86-64."""

from __future__ import annotations

import platform

collect_ignore = [] if platform.machine() == "x86_64" else ["test_timelaw_toppra.py"]
