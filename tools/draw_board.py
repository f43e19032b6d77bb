"""Draws firmware/board/wiring.svg: the board between host, servo bus and the KRC4's lines.

Three circuits, three colours: 5 V (the board), 24 V (the controller, isolated), 12 V (the servos).
Runs from left to right; a wire is drawn where it matters, else a tag names what it joins.
"""

from __future__ import annotations

import sys
from pathlib import Path

DRAWING = Path(__file__).resolve().parent.parent / "firmware/board/wiring.svg"

WIDTH, HEIGHT = 1240, 720

STYLE = """\
.paper { fill: #ffffff; stroke: #c8ccd0 }
.box { fill: #f4f6f8; stroke: #30363d; stroke-width: 1.5 }
.part { fill: #ffffff; stroke: #30363d; stroke-width: 1.5 }
.v5 { stroke: #1f4e9c } .v24 { stroke: #a5321f } .v12 { stroke: #8a5a00 }
.wire { fill: none; stroke-width: 1.7 }
.dot5 { fill: #1f4e9c }
.barrier { stroke: #6e7781; stroke-width: 1.5; stroke-dasharray: 6 5 }
text { font: 13px Helvetica, Arial, sans-serif; fill: #1f2328 }
.head { font-size: 15px; font-weight: bold }
.small { font-size: 11.5px; fill: #424a53 }
.middle { text-anchor: middle } .end { text-anchor: end }"""

MEGA_LEFT, MEGA_RIGHT, MEGA_TOP, MEGA_BOTTOM = 520, 760, 90, 570
OPTO_LEFT, OPTO_RIGHT, OPTO_DROP = 330, 420, 34
"""An optocoupler's sides, and how far its return is below its signal."""

INPUTS = (
    (220, "D49 (PL0, ICP4)", "low: line at 24 V", "$OUT", "knot"),
    (320, "D48 (PL1)", "low: line at 24 V", "$OUT", "arm moving"),
    (420, "D47 (PL2)", "high: pressed", "", "stop"),
)
OUTPUT = (520, "D46 (PL3)", "high: ok")

BUFFER_LEFT, BUFFER_RIGHT = 880, 1010
SERVOS_Y = (130, 240, 350)
SERVO_LEFT, SERVO_RIGHT, SERVO_HEIGHT = 1110, 1220, 70
DATA_X, VDD_X, GND_X = 1130, 1165, 1200

NOTES = (
    "Every line is safe when it is open: no 24 V at the stop's contact means pressed,",
    "no current in the last transistor means not ok. The emergency stop's safety contacts stay in",
    "the cell's own hard-wired chain: the contact drawn here only informs. Across each LED on the",
    "24 V side belongs a 1N4148, cathode to the resistor. Values in ohms.",
)


def text(x: float, y: float, words: str, kind: str = "") -> str:
    """A line of text; `kind` may join head, small, middle, end."""
    return f'<text x="{x:g}" y="{y:g}" class="{kind}">{words}</text>'


def box(x: int, y: int, width: int, height: int, kind: str = "box") -> str:
    """A box with round corners."""
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="5" class="{kind}"/>'


def wire(volts: str, *points: tuple[float, float]) -> str:
    """A wire through points; `volts` is v5, v12 or v24."""
    path = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f'<polyline points="{path}" class="wire {volts}"/>'


def dot(x: float, y: float) -> str:
    """A joint of 5 V wires."""
    return f'<circle cx="{x:g}" cy="{y:g}" r="3.2" class="dot5"/>'


def flat_resistor(x: float, y: float, value: str, volts: str) -> list[str]:
    """A resistor in a horizontal wire, 36 wide from `x` on, its value below it."""
    rect = f'<rect x="{x:g}" y="{y - 6:g}" width="36" height="12" class="part {volts}"/>'
    return [rect, text(x + 18, y + 20, value, "small middle")]


def ground(x: float, y: float) -> list[str]:
    """The board's ground, hanging from a point."""
    bars = [
        wire("v5", (x - half, y + 8 + 4 * n), (x + half, y + 8 + 4 * n))
        for n, half in enumerate((9, 6, 3))
    ]
    return [wire("v5", (x, y), (x, y + 8)), *bars]


def tag(x: float, y: float, words: str, volts: str) -> list[str]:
    """A supply above a point."""
    return [
        wire(volts, (x, y), (x, y - 8), (x - 8, y - 8), (x + 8, y - 8)),
        text(x, y - 13, words, "small middle"),
    ]


def upright_resistor(
    x: float, y: float, value: str, *, up: bool, label: str = "right"
) -> list[str]:
    """A resistor from a joint up to 5 V, or down to ground; its value stands beside it."""
    top = y - 32 if up else y + 8
    rect = f'<rect x="{x - 6:g}" y="{top:g}" width="12" height="24" class="part v5"/>'
    left = label == "left"
    words = text(x - 10 if left else x + 10, top + 16, value, "small end" if left else "small")
    end = tag(x, y - 36, "5 V", "v5") if up else ground(x, y + 38)
    return [dot(x, y), wire("v5", (x, y), (x, y - 38 if up else y + 38)), rect, words, *end]


def optocoupler(y: float, *, towards_board: bool) -> list[str]:
    """LED and transistor; the LED stands on the side that sends."""
    left, right, low = OPTO_LEFT, OPTO_RIGHT, y + OPTO_DROP
    mid = (y + low) / 2
    led, transistor = (left + 26, right - 30) if towards_board else (right - 26, left + 30)
    near, far = (left, right) if towards_board else (right, left)
    led_volts, far_volts = ("v24", "v5") if towards_board else ("v5", "v24")
    step = 1 if towards_board else -1
    tip = led + 25 * step
    shape = f"M {led - 8} {mid - 6:g} H {led + 8} L {led} {mid + 7:g} Z"
    triangle = f'<path d="{shape}" class="part {led_volts}"/>'
    return [
        box(left, round(y) - 16, right - left, OPTO_DROP + 32, "part"),
        wire(led_volts, (near, y), (led, y), (led, low), (near, low)),
        triangle,
        wire(led_volts, (led - 8, mid + 7), (led + 8, mid + 7)),
        *(
            wire(led_volts, (led + 13 * step, at), (tip, at))
            + wire(led_volts, (tip - 4 * step, at - 3), (tip, at), (tip - 4 * step, at + 3))
            for at in (mid - 4, mid + 4)
        ),
        wire(far_volts, (transistor, mid - 11), (transistor, mid + 11)),
        wire(far_volts, (transistor, mid - 5), (transistor + 12 * step, y), (far, y)),
        wire(far_volts, (transistor, mid + 5), (transistor + 12 * step, low), (far, low)),
        wire(
            far_volts,
            (transistor + 4 * step, low - 3.5),
            (transistor + 11 * step, low - 1.5),
            (transistor + 10 * step, low - 9),
        ),
    ]


def input_line(y: int, pin: str, level: str) -> list[str]:
    """From the resistor at the 24 V side to the board's pin."""
    low = y + OPTO_DROP
    return [
        wire("v24", (180, y), (OPTO_LEFT, y)),
        *flat_resistor(250, y, "2.2 k", "v24"),
        wire("v24", (OPTO_LEFT, low), (180, low)),
        *optocoupler(y, towards_board=True),
        wire("v5", (OPTO_RIGHT, y), (MEGA_LEFT, y)),
        *upright_resistor(490, y, "2.2 k", up=True, label="left"),
        wire("v5", (OPTO_RIGHT, low), (440, low)),
        *ground(440, low),
        text(MEGA_LEFT + 10, y + 5, pin),
        text(MEGA_LEFT + 10, y + 21, level, "small"),
    ]


def output_line() -> list[str]:
    """The only output: the transistor switches 24 V to the controller's input."""
    y, pin, level = OUTPUT
    low = y + OPTO_DROP
    return [
        wire("v5", (OPTO_RIGHT, y), (MEGA_LEFT, y)),
        *flat_resistor(462, y, "330", "v5"),
        *optocoupler(y, towards_board=False),
        wire("v5", (OPTO_RIGHT, low), (440, low)),
        *ground(440, low),
        wire("v24", (OPTO_LEFT, y), (300, y)),
        *tag(300, y, "+24 V", "v24"),
        wire("v24", (OPTO_LEFT, low), (180, low)),
        text(MEGA_LEFT + 10, y + 5, pin),
        text(MEGA_LEFT + 10, y + 21, level, "small"),
    ]


def stop_contact(y: int) -> list[str]:
    """A contact that is closed at rest; pressing opens it."""
    return [
        box(20, y - 34, 160, OPTO_DROP + 56),
        text(30, y - 14, "emergency stop,"),
        text(30, y + 2, "auxiliary contact"),
        text(30, y + 22, "24 V while released,", "small"),
        text(30, y + 37, "open while pressed", "small"),
        text(172, y + 5, "out", "small end"),
        text(172, y + OPTO_DROP + 5, "0 V", "small end"),
    ]


def left_side() -> list[str]:
    """Host, and the lines to the controller."""
    parts = [
        box(20, 100, 160, 56),
        text(100, 124, "Raspberry Pi", "middle"),
        text(100, 142, "sphmctl", "small middle"),
        wire("v5", (180, 128), (MEGA_LEFT, 128)),
        text(350, 120, "USB: 1 Mbaud, and the board's 5 V", "small middle"),
        text(MEGA_LEFT + 10, 133, "USB (UART0)"),
        '<line x1="375" y1="178" x2="375" y2="600" class="barrier"/>',
        text(375, 170, "4 optocouplers PC817", "small middle"),
        text(369, 616, "24 V side", "small end"),
        text(381, 616, "5 V side", "small"),
    ]
    for y, pin, level, kind, name in INPUTS:
        parts += input_line(y, pin, level)
        if name == "stop":
            parts += stop_contact(y)
            continue
        parts += [
            box(20, y - 28, 160, OPTO_DROP + 46),
            text(30, y - 4, f"KRC4 {kind}"),
            text(30, y + 16, name, "head"),
            text(172, y + 5, "out", "small end"),
            text(172, y + OPTO_DROP + 5, "0 V", "small end"),
        ]
    y = OUTPUT[0]
    return [
        *parts,
        *output_line(),
        box(20, y - 22, 160, OPTO_DROP + 46),
        text(30, y + 2, "KRC4 $IN"),
        text(30, y + 22, "wrist ok", "head"),
        text(172, y + OPTO_DROP + 5, "in", "small end"),
    ]


def buffer() -> list[str]:
    """The tri-state buffer that makes one wire of two."""
    middle = (BUFFER_LEFT + BUFFER_RIGHT) // 2
    right, left = BUFFER_RIGHT, BUFFER_LEFT
    return [
        box(left, 118, right - left, 250, "part"),
        text(middle, 140, "74HC241", "head middle"),
        text(middle, 156, "or 74LVC2G241", "small middle"),
        wire("v5", (left, 190), (middle - 14, 190)),
        f'<path d="M {middle - 14} 176 V 204 L {middle + 14} 190 Z" class="part v5"/>',
        wire("v5", (middle + 14, 190), (right, 190)),
        text(left + 6, 184, "2A", "small"),
        text(right - 6, 184, "2Y", "small end"),
        text(middle, 220, "on while D2 is high", "small middle"),
        wire("v5", (left, 262), (middle - 14, 262)),
        f'<path d="M {middle + 14} 248 V 276 L {middle - 14} 262 Z" class="part v5"/>',
        wire("v5", (middle + 14, 262), (right, 262)),
        text(left + 6, 256, "1Y", "small"),
        text(right - 6, 256, "1A", "small end"),
        text(middle, 292, "on while D2 is low", "small middle"),
        text(left + 6, 337, "1OE (low), 2OE", "small"),
        text(left + 6, 358, "VCC 5 V, 100 nF", "small"),
    ]


def bus_wires() -> list[str]:
    """The board's three pins of the bus, and the data wire."""
    right, left = MEGA_RIGHT, BUFFER_LEFT
    return [
        wire("v5", (right, 190), (left, 190)),
        wire("v5", (right, 262), (left, 262)),
        wire("v5", (right, 333), (left, 333)),
        text(right - 10, 195, "D18 (TXD1, PD3)", "end"),
        text(right - 10, 267, "D19 (RXD1, PD2)", "end"),
        text(right - 10, 338, "D2 (PE4)", "end"),
        text(right - 10, 354, "high: drive", "small end"),
        *upright_resistor(810, 262, "10 k", up=True),
        *upright_resistor(810, 333, "10 k", up=False),
        wire("v5", (BUFFER_RIGHT, 190), (1075, 190), (1075, 165), (SERVO_LEFT, 165)),
        wire("v5", (BUFFER_RIGHT, 262), (1050, 262), (1050, 190)),
        dot(1050, 190),
        *upright_resistor(1030, 190, "10 k", up=True),
    ]


def servos() -> list[str]:
    """Three servos in a chain of three wires, and their supply."""
    parts = []
    for number, y in enumerate(SERVOS_Y, 1):
        parts += [
            box(SERVO_LEFT, y, SERVO_RIGHT - SERVO_LEFT, SERVO_HEIGHT),
            text((SERVO_LEFT + SERVO_RIGHT) / 2, y + 32, f"XL430, id {number}", "middle"),
        ]
        if number < len(SERVOS_Y):
            below = y + SERVO_HEIGHT
            next_y = SERVOS_Y[number]
            parts += [
                wire("v5", (DATA_X, below), (DATA_X, next_y)),
                wire("v12", (VDD_X, below), (VDD_X, next_y)),
                wire("v5", (GND_X, below), (GND_X, next_y)),
            ]
    end = SERVOS_Y[-1] + SERVO_HEIGHT
    return [
        *parts,
        text(DATA_X - 4, 222, "DATA", "small end"),
        text(VDD_X - 3, end + 18, "12 V", "small end"),
        text(GND_X + 4, end + 18, "GND", "small"),
        box(BUFFER_LEFT, 450, 150, 90),
        text(BUFFER_LEFT + 75, 480, "servo supply", "middle"),
        text(BUFFER_LEFT + 75, 500, "12 V, 5 A", "head middle"),
        wire("v12", (BUFFER_LEFT + 150, 475), (VDD_X, 475), (VDD_X, end)),
        wire("v5", (BUFFER_LEFT + 150, 515), (GND_X, 515), (GND_X, end)),
        wire("v5", (MEGA_RIGHT, 515), (BUFFER_LEFT, 515)),
        *ground(820, 515),
        dot(820, 515),
        text(MEGA_RIGHT - 10, 520, "GND", "end"),
        wire("v5", (MEGA_RIGHT, 440), (810, 440)),
        *tag(810, 440, "5 V", "v5"),
        text(MEGA_RIGHT - 10, 445, "5V", "end"),
    ]


def notes() -> list[str]:
    """What the drawing cannot show."""
    return [text(20, 642 + 19 * n, line) for n, line in enumerate(NOTES)]


def drawing() -> str:
    """The SVG file."""
    width, height = MEGA_RIGHT - MEGA_LEFT, MEGA_BOTTOM - MEGA_TOP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}">',
        "<title>Wiring of the board</title>",
        f"<style>\n{STYLE}\n</style>",
        box(1, 1, WIDTH - 2, HEIGHT - 2, "paper"),
        text(20, 38, "Wiring of the board", "head"),
        text(20, 60, "blue 5 V, red 24 V (isolated), brown 12 V", "small"),
        box(MEGA_LEFT, MEGA_TOP, width, height),
        text((MEGA_LEFT + MEGA_RIGHT) / 2, MEGA_TOP + 24, "Arduino Mega 2560", "head middle"),
        *left_side(),
        *bus_wires(),
        *buffer(),
        *servos(),
        *notes(),
        "</svg>",
        "",
    ]
    return "\n".join(parts)


def main() -> int:
    """Writes the drawing."""
    DRAWING.write_text(drawing(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
