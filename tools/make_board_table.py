"""Writes what follows from firmware/board/table.toml: C++ header, Python module, Markdown table.

Run it after each change of the table; a test fails when its three outputs are not up to date.
"""

from __future__ import annotations

import binascii
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DEFINITION = ROOT / "firmware/board/table.toml"
HEADER = ROOT / "firmware/board/board_table.h"
MODULE = ROOT / "sphmctl/wire/board_table.py"
PROTOCOL = ROOT / "firmware/board/PROTOCOL.md"

TABLE_BEGIN = "<!-- table: written by tools/make_board_table.py -->\n"
TABLE_END = "<!-- end of table -->\n"
C_TYPES = {1: "uint8_t", 2: "uint16_t", 4: "uint32_t"}
FULL_OF = {1: 0xFF, 2: 0xFFFF, 4: 0xFFFFFFFF}

MODULE_HEAD = '''\
"""Control table of the board. Written by tools/make_board_table.py; do not edit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Item:
    """One item; writable when `access` is RW, in units of `unit`."""

    address: int
    size: int
    name: str
    access: str
    default: int
    minimum: int
    maximum: int
    unit: str
'''


@dataclass(frozen=True)
class Item:
    """One item; `bits` are (name, meaning), lowest first, unnamed ones empty."""

    address: int
    size: int
    name: str
    access: str
    default: int
    minimum: int
    maximum: int
    unit: str
    text: str
    bits: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Table:
    """The whole definition, in order of addresses."""

    board_id: int
    model: int
    firmware: int
    revision: int
    items: tuple[Item, ...]

    @property
    def size(self) -> int:
        """Bytes from address 0 to the end of the last item."""
        return self.items[-1].address + self.items[-1].size

    @property
    def protocol(self) -> int:
        """CRC-16 (CCITT) of the canonical form: everything the wire depends on, no prose."""
        lines = [f"{self.board_id} {self.model} {self.revision}"]
        for item in self.items:
            # The firmware's own release number must not change the protocol.
            default = 0 if item.name == "FIRMWARE_VERSION" else item.default
            bits = ",".join(name for name, _ in item.bits)
            lines.append(
                f"{item.address} {item.size} {item.name} {item.access} {default} "
                f"{item.minimum} {item.maximum} {item.unit} {bits}"
            )
        return binascii.crc_hqx("\n".join(lines).encode(), 0xFFFF)


def read_table(path: Path = DEFINITION) -> Table:
    """The definition, checked."""
    source = tomllib.loads(path.read_text())
    board = source["board"]
    items = []
    for entry in source["item"]:
        size = entry["size"]
        bits = tuple(
            (name, meaning.strip())
            for name, _, meaning in (bit.partition(":") for bit in entry.get("bits", []))
        )
        # Whatever fits is a value that a read-only item can show; a writable one starts at 0.
        full = 0 if entry["access"] == "RW" else FULL_OF[size]
        items.append(
            Item(
                address=entry["address"],
                size=size,
                name=entry["name"],
                access=entry["access"],
                default=entry.get("default", 0),
                minimum=entry.get("min", 0),
                maximum=entry.get("max", full),
                unit=entry.get("unit", ""),
                text=entry["text"],
                bits=bits,
            )
        )
    table = Table(board["id"], board["model"], board["firmware"], board["revision"], tuple(items))
    _check(table)
    return table


def _check(table: Table) -> None:
    """What the firmware relies on."""
    end = 0
    writable_end = -1
    values = {"MODEL_NUMBER": table.model, "FIRMWARE_VERSION": table.firmware, "ID": table.board_id}
    for item in table.items:
        where = f"{DEFINITION.name}: {item.name}"
        if item.address < end:
            raise SystemExit(f"{where}: address {item.address}; {end} or more would be right")
        if item.access not in ("R", "RW"):
            raise SystemExit(f"{where}: access {item.access!r}; R or RW would be right")
        # Reads are copied in aligned words of 4 bytes: an item inside one is never torn.
        if item.address // 4 != (item.address + item.size - 1) // 4 and item.name != "BUILD_HASH":
            raise SystemExit(f"{where}: crosses a multiple of 4; an aligned address would be right")
        if item.access == "RW":
            # A Write therefore never spans two items.
            if item.address == writable_end:
                raise SystemExit(f"{where}: touches a writable item; a gap would be right")
            writable_end = item.address + item.size
        wanted = values.get(item.name, item.default)
        if item.default != wanted:
            raise SystemExit(f"{where}: default {item.default}; {wanted} would be right")
        end = item.address + item.size


def header_text(table: Table) -> str:
    """The C++ header: addresses, bits, the table as a packed structure, what may be written."""
    lines = [
        "// Control table of the board. Written by tools/make_board_table.py; do not edit.",
        "#ifndef BOARD_TABLE_H",
        "#define BOARD_TABLE_H",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
        f"const uint8_t BOARD_ID = {table.board_id};",
        f"const uint16_t BOARD_MODEL = {table.model};",
        f"const uint8_t BOARD_FIRMWARE = {table.firmware};",
        f"const uint16_t BOARD_PROTOCOL = 0x{table.protocol:04X};",
        f"const uint8_t TABLE_SIZE = {table.size};",
        "",
    ]
    lines += [f"const uint8_t ADDR_{item.name} = {item.address};" for item in table.items]
    lines.append("")
    lines += [
        f"const uint8_t {item.name}_{name} = 0x{1 << bit:02X};"
        for item in table.items
        for bit, (name, _) in enumerate(item.bits)
        if name
    ]
    lines += ["", *_structure_lines(table), "", *_default_lines(table), "", *_access_lines(table)]
    return "\n".join([*lines, "", "#endif", ""])


def _structure_lines(table: Table) -> list[str]:
    """The table as a packed structure, and that the compiler lays it out so."""
    lines = ["struct __attribute__((packed)) BoardTable {"]
    end = 0
    for item in table.items:
        if item.address > end:
            lines.append(f"    uint8_t gap_{end}[{item.address - end}];")
        lines.append(f"    {C_TYPES[item.size]} {item.name.lower()};")
        end = item.address + item.size
    lines += ["};", ""]
    lines += [
        f'static_assert(offsetof(BoardTable, {i.name.lower()}) == {i.address}, "{i.name}");'
        for i in table.items
    ]
    return [*lines, 'static_assert(sizeof(BoardTable) == TABLE_SIZE, "table");']


def _default_lines(table: Table) -> list[str]:
    """What the table holds after a reset."""
    lines = [
        f"    table.{item.name.lower()} = {item.default};" for item in table.items if item.default
    ]
    return [
        "// Items that do not start at 0.",
        "inline void table_defaults(BoardTable& table) {",
        *lines,
        "    table.protocol_version = BOARD_PROTOCOL;",
        "}",
    ]


def _access_lines(table: Table) -> list[str]:
    """What may be written, and which stretches of addresses are defined."""
    writable = [item for item in table.items if item.access == "RW"]
    stretches: list[list[int]] = []
    for item in table.items:
        if stretches and stretches[-1][1] == item.address:
            stretches[-1][1] += item.size
        else:
            stretches.append([item.address, item.address + item.size])
    return [
        "struct Writable {",
        "    uint8_t address;",
        "    uint8_t size;",
        "    uint8_t low;",
        "    uint8_t high;",
        "};",
        f"const uint8_t WRITABLE_COUNT = {len(writable)};",
        "const Writable WRITABLE[WRITABLE_COUNT] = {",
        *(f"    {{{i.address}, {i.size}, {i.minimum}, {i.maximum}}}," for i in writable),
        "};",
        "",
        "// Defined addresses: the first one, the first one behind.",
        "struct Stretch {",
        "    uint8_t begin;",
        "    uint8_t end;",
        "};",
        f"const uint8_t STRETCH_COUNT = {len(stretches)};",
        "const Stretch STRETCHES[STRETCH_COUNT] = {",
        *(f"    {{{begin}, {end}}}," for begin, end in stretches),
        "};",
    ]


def module_text(table: Table) -> str:
    """The Python module: each item a constant, bits as masks."""
    lines = [
        MODULE_HEAD,
        "",
        f"BOARD_ID: Final = {table.board_id}",
        f"BOARD_MODEL: Final = {table.model}",
        f"BOARD_FIRMWARE: Final = {table.firmware}",
        f"BOARD_PROTOCOL: Final = 0x{table.protocol:04X}",
        f"TABLE_SIZE: Final = {table.size}",
        "",
    ]
    for item in table.items:
        values = f'{item.address}, {item.size}, "{item.name}", "{item.access}", {item.default}'
        limits = f'{item.minimum}, {item.maximum}, "{item.unit}"'
        lines.append(f"{item.name}: Final = Item({values}, {limits})")
    lines.append("")
    lines += [
        f"{item.name}_{name}: Final = 0x{1 << bit:02X}"
        for item in table.items
        for bit, (name, _) in enumerate(item.bits)
        if name
    ]
    lines += ["", "ITEMS: Final = ("]
    lines += [f"    {item.name}," for item in table.items]
    lines += [")", ""]
    return "\n".join(lines)


def markdown_text(table: Table) -> str:
    """The table of PROTOCOL.md, with its markers."""
    version = f"firmware {table.firmware}, protocol version 0x{table.protocol:04X}"
    lines = [
        f"Id {table.board_id}, model {table.model}, {version}, {table.size} bytes.",
        "",
        "| address | bytes | item | access | default | range | unit | meaning |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for item in table.items:
        limits = f"{item.minimum} to {item.maximum}" if item.access == "RW" else ""
        text = item.text
        named = [
            f"bit {bit} {name}" + (f" ({meaning})" if meaning else "")
            for bit, (name, meaning) in enumerate(item.bits)
            if name
        ]
        if named:
            text += ": " + ", ".join(named)
        lines.append(
            f"| {item.address} | {item.size} | {item.name} | {item.access} | {item.default} "
            f"| {limits} | {item.unit} | {text} |"
        )
    return TABLE_BEGIN + "\n".join(lines) + "\n" + TABLE_END


def protocol_text(table: Table, before: str) -> str:
    """PROTOCOL.md with its table renewed."""
    head, begin, rest = before.partition(TABLE_BEGIN)
    _, end, tail = rest.partition(TABLE_END)
    if not begin or not end:
        raise SystemExit(f"{PROTOCOL.name}: no table markers; {TABLE_BEGIN!r} would be right")
    return head + markdown_text(table) + tail


def outputs() -> dict[Path, str]:
    """What each output should hold."""
    table = read_table()
    return {
        HEADER: header_text(table),
        MODULE: module_text(table),
        PROTOCOL: protocol_text(table, PROTOCOL.read_text()),
    }


def main() -> int:
    """Writes the outputs."""
    for path, text in outputs().items():
        path.write_text(text)
        print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
