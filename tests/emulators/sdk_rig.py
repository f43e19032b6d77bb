"""dynamixel-sdk, unchanged, in a process of its own at a serial port: what its scripts share."""

from __future__ import annotations

import asyncio
import json
import sys
from typing import Any

PROCESS_LIMIT_S = 60.0

OPEN = r"""
import json, sys
from dynamixel_sdk import GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler

TRIES = 10  # on a loaded machine the SDK's fixed 34 ms may run out; a board boots when opened
NO_ANSWER = -3001

def settle(call):
    for _ in range(TRIES):
        try:
            answer = call()
        except IndexError:  # its fast sync read takes a late answer apart as if it were whole
            answer = (NO_ANSWER, 0)
        if answer[-2] == 0:
            break
    return answer

port = PortHandler(sys.argv[1])
assert port.openPort() and port.setBaudRate(1000000)
dxl = PacketHandler(2.0)
out = {}
"""
"""Begin of a script: `settle` asks again while the result, the last but one, is a failure."""

MOVE_AND_READ = r"""
writer = GroupSyncWrite(port, dxl, 116, 4)
for i in (1, 2, 3):
    writer.addParam(i, (2100 + i).to_bytes(4, "little"))
out["sync_write"] = writer.txPacket()
for name in ("txRxPacket", "fastSyncRead"):
    reader = GroupSyncRead(port, dxl, 132, 4)
    for i in (1, 2, 3):
        reader.addParam(i)
    for _ in range(500):
        result = settle(lambda: (getattr(reader, name)(), 0))[0]
        values = [reader.getData(i, 132, 4) if reader.isAvailable(i, 132, 4) else None
                  for i in (1, 2, 3)]
        if None not in values and all(abs(v - 2101 - n) <= 1 for n, v in enumerate(values)):
            break
    out[name] = [result, values]
"""
"""Moves the three servos by one sync write and reads them, plainly and fast, until they arrive."""


async def answers_of(script: str, device: str) -> dict[str, Any]:
    """What a script leaves in `out`.

    Args:
        script: between `OPEN` and the end.
        device: the port.
    """
    whole = f"{OPEN}{script}\nport.closePort()\nprint(json.dumps(out))\n"
    client = await asyncio.create_subprocess_exec(
        sys.executable, "-c", whole, device, stdout=asyncio.subprocess.PIPE
    )
    out, _ = await asyncio.wait_for(client.communicate(), PROCESS_LIMIT_S)
    answers: dict[str, Any] = json.loads(out)
    return answers
