"""A serial port before it is used: there, ours, free? Each refusal in plain words."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import grp
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from sphmctl.errors import DeviceError

TIOCGEXCL = 0x80045440
"""Linux <asm-generic/ioctls.h>: whether somebody has claimed the terminal with TIOCEXCL."""

DEFAULT_GROUP = "dialout"
"""Debian's group of serial ports, named when the device does not tell its own."""


def where(port: str) -> str:
    """How messages name a port."""
    return f"serial port {port}"


def look_at(port: str, device: str = "board") -> None:
    """Refuse a port that cannot be used. Opening it resets a board, as any opening does.

    Args:
        port: its path.
        device: what should be there, for the sentences.

    Raises:
        DeviceError: no such port, no permission (with the group to join), in use, no serial port.
    """
    try:
        file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise DeviceError(_reason(port, device, error), where(port)) from error
    try:
        if not os.isatty(file):
            raise DeviceError(f"this is no serial port; give the {device}'s", where(port))
        if _claimed(file):
            raise DeviceError(_busy(port), where(port))
    finally:
        os.close(file)


def user_of(port: str) -> str:
    """Which other program has the port open, say "picocom (process 123)"; "" when none is seen."""
    device = os.path.realpath(port)
    for process in Path("/proc").iterdir():
        if process.name.isdigit() and int(process.name) != os.getpid():
            with contextlib.suppress(OSError):
                if device in _open_files(process):
                    name = (process / "comm").read_text(encoding="utf-8").strip()
                    return f"{name} (process {process.name})"
    return ""


def _open_files(process: Path) -> Iterator[str]:
    for entry in (process / "fd").iterdir():
        with contextlib.suppress(OSError):
            yield os.readlink(entry)


def _claimed(file: int) -> bool:
    """Whether another program holds the port for itself: by TIOCEXCL, or by flock as pyserial."""
    exclusive = bytearray(4)
    with contextlib.suppress(OSError):
        fcntl.ioctl(file, TIOCGEXCL, exclusive)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    return any(exclusive)


def _busy(port: str) -> str:
    user = user_of(port)
    by = f"by {user}" if user else "by another program"
    return f"it is in use {by}; end that first (the sphmctl daemon, a terminal program)"


def _reason(port: str, device: str, error: OSError) -> str:
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"no {device}: there is no such port; is the cable in? {_present()}"
    if error.errno in (errno.EACCES, errno.EPERM):
        group = _group(port)
        return (
            f"no permission to open it; join the group {group}: "
            f"sudo usermod -aG {group} $USER, then log in again"
        )
    if error.errno == errno.EBUSY:
        return _busy(port)
    if error.errno == errno.EISDIR:
        return f"this is a folder; give the {device}'s serial port"
    return f"it cannot be opened: {error.strerror}"


def _group(port: str) -> str:
    """The group that may use the device; root's would be bad advice."""
    with contextlib.suppress(OSError, KeyError):
        status = os.stat(port)
        shared = status.st_mode & stat.S_IRGRP and status.st_mode & stat.S_IWGRP
        if shared and status.st_gid != 0:
            return grp.getgrgid(status.st_gid).gr_name
    return DEFAULT_GROUP


def _present() -> str:
    """The ports that are there, so that the right one can be named."""
    folder = Path("/dev/serial/by-id")
    found = sorted(map(str, folder.iterdir())) if folder.is_dir() else []
    found = found or sorted(map(str, Path("/dev").glob("tty[AU][CS][MB]*")))
    return f"these are there: {', '.join(found)}" if found else "no USB serial port is there"
