"""What firmware/krc tells the operator: every name, number and command in its guide, and the T1
session's sheet, whose programs run on the emulated controller and must give the sheet's answers."""

from __future__ import annotations

import ast
import asyncio
import dataclasses
import random
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sphmctl import config
from sphmctl.cli import main
from sphmctl.daemon import examine_arm
from sphmctl.drivers import krc_program
from sphmctl.emulators import interpreter
from sphmctl.emulators.controller import Controller, Options
from sphmctl.emulators.interpreter.options import Options as InterpreterOptions
from sphmctl.emulators.krl.parse import parse, read
from sphmctl.emulators.krl.project import check_files
from sphmctl.emulators.kvp_server import KvpServer
from sphmctl.emulators.motion import Options as MotionOptions
from sphmctl.emulators.world import World
from sphmctl.motion import Floats
from tests.emulators.interpreter.rig import Rig

KRC = Path(__file__).parents[1] / "firmware" / "krc"
T1 = KRC / "t1"
README = (KRC / "README.md").read_text()
SHEET = (KRC / "T1-SESSION.md").read_text()
PROGRAM = "\n".join((KRC / name).read_text() for name in krc_program.FILES)
RULES, MOVES = "SPH_T1_RULES", "SPH_T1_MOVES"

MOTION = Options().motion
"""The arm of the emulated controller."""

LIMIT_S = 60.0
"""Of emulated time; the longer program takes 25 s."""

MS, DEG = 24.0, 0.01
"""Two interpolation cycles; and a hundredth of a degree: what the sheet rounds off."""

OPEN = {
    "jerk: its units": "A3",
    "keep 12.5": "B1",
    "and 0.1": "B2",
    "always TRUE": "B3",
    "a condition that is TRUE already": "B5",
    "a SIGNAL's name in an interrupt's condition": "B6",
    "left out of an assigned aggregate": "B7",
    "a trigger looks at its right side": "B8",
    "does `$FLAG` stop it": "B10",
    "way of A6 in `BRAKE`": "C1",
    "in `BRAKE F`": "C2",
    "time of `BRAKE`, ms": "C3",
    "does `RESUME` forget the planned blocks": "C5",
    "`$APO.CPTP` 25": "C9",
    "| 50 |": "C10",
    "| 100 |": "C11",
    "by `SPTP` with `C_SPL`": "C14",
    "shortest blended block": "C15",
    "conditions of `INTERRUPT DECL 19`, `20`, `21`": "D1",
    "BCO: does it wait": "D2",
    "`$PRO_MOVE` at override 0": "D3",
    "ramp of the override": "D4",
    "after an acknowledged stop": "D8",
    "how finely a TRIGGER fires": "D10",
}
"""What KUKA's public documents leave open, or sources contradict, and the row that settles it."""


def rows(text: str) -> list[list[str]]:
    """Cells of every table's rows, heads included."""
    found = re.findall(r"^\| (.*) \|$", text, re.MULTILINE)
    return [[cell.strip() for cell in row.split(" | ")] for row in found if "---" not in row]


def section(text: str, head: str) -> str:
    """What stands under a heading that contains `head`."""
    parts = re.split(r"(?m)^## ", text)
    (part,) = [p for p in parts if head in p.splitlines()[0]]
    return part


def sheet_row(number: str) -> list[str]:
    (row,) = [row for row in rows(SHEET) if row[0] == number]
    return row


def code(text: str) -> list[str]:
    """What stands in backticks, and the lines of code blocks."""
    blocks = re.findall(r"(?s)^```\w*\n(.*?)^```", text, re.MULTILINE)
    inline = re.findall(r"`([^`\n]+)`", re.sub(r"(?ms)^```.*?^```", "", text))
    return inline + [line for block in blocks for line in block.splitlines()]


@pytest.fixture
def said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Any:
    """What a command says, away from the source tree, on the packaged cell."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SPHMCTL_CELL", raising=False)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments: str) -> str:
        capsys.readouterr()
        main.run(list(arguments))
        return capsys.readouterr().out

    return run


@pytest.mark.parametrize("text", [README, SHEET], ids=["guide", "sheet"])
def test_every_variable_of_the_program_that_is_named_exists(text: str) -> None:
    known = set(re.findall(r"\bSPH_\w+", PROGRAM)) | {RULES, MOVES}
    named = re.findall(r"\bSPH_\w+", text)
    # Names that are cut short with dots stand for several.
    assert {name for name in named if f"{name}..." not in text} - known - {"SPH_"} == set()
    fields = re.findall(r"STATE_T INT (.*)", PROGRAM)[0]
    for field in re.findall(r"SPH_STATE\.(\w+)", text):
        assert re.search(rf"\b{field}\b", fields), field


@pytest.mark.parametrize("text", [README, SHEET], ids=["guide", "sheet"])
def test_numbers_of_the_interface_are_named_as_it_names_them(text: str) -> None:
    for name in re.findall(r"\b(?:FAULT|STATUS|CMD|WRIST)_[A-Z]+\b|\bL(?:ATE|OST)_MS\b", text):
        assert f"CONST INT SPH_{name}=" in PROGRAM
    assert "CONST INT SPH_LATE_MS=120\n" in PROGRAM
    assert "held after 0.12 s and gave up after 1 s" in README
    assert "CONST INT SPH_LOST_MS=1000\n" in PROGRAM


def test_every_file_and_every_place_that_is_linked_exists() -> None:
    for text in (README, SHEET):
        for link, _, anchor in re.findall(r"\]\(([^)#]+)(#([^)]+))?\)", text):
            assert (KRC / link).is_file(), link
            heads = re.findall(r"(?m)^#+ (.*)$", (KRC / link).read_text())
            assert not anchor or anchor in [head.lower().replace(" ", "-") for head in heads]
    assert 'under "Checking the lines"' in README
    files = {row[0].strip("`") for row in rows(README.split("## 1.")[0])[1:]}
    assert files == set(krc_program.FILES)
    assert "four files of `firmware/krc/t1`" in SHEET


def test_every_command_is_one_and_has_the_options_that_are_used(said: Any) -> None:
    commands = [
        c.split("sphmctl ", 1)[1] for t in (README, SHEET) for c in code(t) if "sphmctl " in c
    ]
    assert len(commands) >= 5
    for command in commands:
        words = command.split()
        name = words[: 2 if words[0] in ("krl", "firmware") else 1]
        help_text = said(*name, "--help")
        assert "Usage" in help_text, command
        for option in (word for word in words if word.startswith("--")):
            assert re.search(rf"{option}\b", help_text), command


def test_the_exports_next_step_is_a_heading_of_the_guide(said: Any) -> None:
    told = re.search(r'firmware/krc/README\.md, "([^"]+)"', said("krl", "export", "stick"))
    assert told is not None
    assert section(README, told[1])


def test_the_lines_of_the_submit_program_call_what_the_files_define() -> None:
    block = section(README, "Submit interpreter").split("```")[1]
    calls = re.findall(r"(?m)^(\w+)\(\)$", block)
    assert calls == ["SPH_SPS_INIT", "SPH_SPS"]
    text = (KRC / "sph_sps.src").read_text()
    assert re.findall(r"(?m)^(?:GLOBAL )?DEF (\w+)\(\)", text) == ["SPH_SPS", "SPH_SPS_INIT"]
    assert "GLOBAL DEF SPH_SPS_INIT()" in text


def test_reserved_inputs_and_outputs_are_those_that_the_cell_file_refuses() -> None:
    place = section(README, "lines' numbers")
    numbers = {int(n) for n in re.findall(r"`\$(?:IN|OUT)\[(\d+)\]`", place)}
    outputs = {config.SYSTEM_OUTPUTS[0], config.SYSTEM_OUTPUTS[-1]}
    assert numbers == set(config.CONSTANT_INPUTS) | outputs
    assert f"GLOBAL SIGNAL SPH_OK $IN[{krc_program.ALWAYS_TRUE}]" in PROGRAM


def test_the_example_of_the_lines_is_exported_as_it_stands(tmp_path: Path, said: Any) -> None:
    block = re.findall(r"(?s)```yaml\n(.*?)```", README)[0]
    cell = yaml.safe_load((KRC.parents[1] / "configs/cells/lab.yaml").read_text())
    cell["wrist"]["board_id"] = 200
    cell["arm"] |= yaml.safe_load(block)["arm"]
    (tmp_path / "cell.yaml").write_text(yaml.safe_dump(cell))
    told = said("krl", "export", "stick", "--cell", "cell.yaml")
    assert "wrist ok $IN[17], knot $OUT[17], arm moving $OUT[18]" in told


def findings(module: Any) -> Iterator[str]:
    """Names of the findings that a module makes."""
    for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            first = node.args[0] if node.args else None
            if node.func.id in ("_finding", "Finding") and isinstance(first, ast.Constant):
                yield str(first.value)


def test_the_table_of_doctors_lines_is_complete_and_has_no_other() -> None:
    told = [row[0] for row in rows(section(README, "Ask `doctor`"))[1:]]
    arms = set(findings(examine_arm))
    assert set(told) == arms | {"controller connected", "controller's replies"}


def test_doctor_says_no_line_of_the_controller_that_the_table_lacks(said: Any) -> None:
    names = [f["name"] for f in yaml.safe_load(said("doctor", "--json"))["checks"]]
    begin, end = names.index("controller connected"), names.index("wrist connected")
    told = [row[0] for row in rows(section(README, "Ask `doctor`"))[1:]]
    assert [name for name in told if name in names] == names[begin:end]


@pytest.mark.parametrize("words", OPEN)
def test_what_is_open_has_its_row(words: str) -> None:
    assert words in "| " + " | ".join(sheet_row(OPEN[words])) + " |"


def test_every_guess_of_the_emulator_is_settled_by_a_row_and_no_other_option_is_named() -> None:
    motion = {field.name for field in dataclasses.fields(MotionOptions)}
    # Those that are numbers keep the emulator in hand, or are KUKA's manual's.
    language = {f.name for f in dataclasses.fields(InterpreterOptions) if f.type != "int"}
    changes = " ".join(row[-1] for row in rows(SHEET))
    named = set(re.findall(r"`([a-z]\w*_\w+)`", changes))
    assert named == motion | language


def test_every_interrupt_of_the_program_is_in_the_row_of_conditions() -> None:
    declared = re.findall(r"(?m)^INTERRUPT DECL (\d+)", PROGRAM)
    assert re.findall(r"\d+", sheet_row("D1")[1]) == declared


def test_what_a_row_would_change_exists() -> None:
    for row in rows(SHEET):
        for place in re.findall(r"`([\w/]+\.(?:py|md))`", row[-1]):
            found = [KRC / place, *Path(interpreter.__file__).parents[1].rglob(Path(place).name)]
            assert any(path.is_file() for path in found), place


def test_the_programs_of_the_session_check_clean() -> None:
    checked = check_files([T1])
    assert len(checked.files) == 4
    assert checked.findings == ()


def files_of(name: str) -> tuple[Path, ...]:
    """Data list and program."""
    return tuple(sorted(T1.glob(f"{name.lower()}.*")))


def session(name: str, mode: str = "T1") -> tuple[Controller, Floats]:
    """The emulated controller after a program of the session, and its joints each millisecond."""
    now_s = [500.0]
    world = World(lambda: now_s[0])
    options = Options(program=name, program_state="P_FREE", modules=files_of(name))
    controller = Controller(world, random.Random(1), options)
    controller.panel.mode = mode
    controller.krc.select(name)
    way: list[tuple[float, ...]] = []
    starts = 0
    while controller.krc.state != "P_END":
        if controller.krc.state != "P_ACTIVE":
            # Once to the BCO point, and once from there.
            starts += 1
            assert starts <= 2, controller.krc.messages
            controller.krc.start()
        now_s[0] += 0.001
        world.advance()
        way.append(controller.true_joints_deg())
        assert len(way) < 1000 * LIMIT_S
    return controller, np.array(way)


@pytest.mark.parametrize(("name", "letter"), [(RULES, "B"), (MOVES, "C")])
def test_the_emulated_controller_answers_as_the_sheet_says(name: str, letter: str) -> None:
    controller, way = session(name)
    told = [row for row in rows(SHEET) if re.fullmatch(rf"{letter}\d+", row[0])]
    for number, _, answer, emulated, _ in told:
        found = controller.store.read_text(answer.strip("`"))
        assert found is not None, answer
        if emulated in ("TRUE", "FALSE"):
            assert found == emulated, (number, answer)
        else:
            tolerance = MS if "MS" in answer else DEG
            assert float(found) == pytest.approx(float(emulated), abs=tolerance), (number, answer)
    assert controller.store.read_text(f"T1_{name.rpartition('_')[2]}_DONE") == "TRUE"
    assert way[:, 5].min() >= -1e-6
    assert 8.0 - 1e-6 < way[:, 5].max() < 10.0 + 1e-6
    assert np.abs(way[:, :5] - way[0, :5]).max() < 1e-6
    assert np.abs(way[-1] - way[0]).max() < 1e-4
    assert np.abs(np.diff(way[::4, 5])).max() / 0.004 < 62.0


@pytest.mark.parametrize(("name", "letter"), [(RULES, "B"), (MOVES, "C")])
def test_every_answer_of_a_program_has_its_row_and_no_other_is_named(
    name: str, letter: str
) -> None:
    data = (T1 / f"{name.lower()}.dat").read_text()
    answers = data.split(";FOLD Answers")[1].split(";ENDFOLD")[0]
    wanted = set()
    for variable, size in re.findall(r"DECL GLOBAL \w+ (T1_\w+)(?:\[(\d+)\])?", answers):
        indices = [f"[{index + 1}]" for index in range(int(size))] if size else [""]
        wanted |= {f"`{variable}{index}`" for index in indices}
    done = f"`T1_{name.rpartition('_')[2]}_DONE`"
    assert {row[2] for row in rows(SHEET) if re.fullmatch(rf"{letter}\d+", row[0])} == (
        wanted - {done}
    )
    assert done[1:-1] in section(SHEET, f"`{name}`").splitlines()[0]


@pytest.mark.parametrize("name", [RULES, MOVES])
@pytest.mark.parametrize("mode", ["T2", "AUT", "EX"])
def test_outside_t1_the_programs_end_before_any_motion(name: str, mode: str) -> None:
    controller, way = session(name, mode)
    assert (way == way[0]).all()
    assert controller.store.read_text(f"T1_{name.rpartition('_')[2]}_DONE") == "FALSE"


@pytest.mark.parametrize(
    ("option", "answer", "otherwise"),
    [
        ({"fires_when_already_true": True}, "T1_ALREADY", "1"),
        ({"trigger_value": "planning"}, "T1_AT", "1"),
        ({"flags_stop_advance": True}, "T1_AHEAD[2]", "FALSE"),
    ],
)
def test_a_controller_that_understands_krl_otherwise_answers_otherwise(
    option: dict[str, Any], answer: str, otherwise: str
) -> None:
    rig = Rig(
        *map(read, files_of(RULES)), options=InterpreterOptions(**option), motion=MOTION, mode="T1"
    )
    assert ended(rig, RULES).text(answer) == otherwise


@pytest.mark.parametrize(
    ("option", "answer"),
    [
        ({"brake_percent": 20.0}, "T1_WAY[1]"),
        ({"fast_brake_percent": (20.0,) * 6}, "T1_WAY[2]"),
        ({"t1_ptp_percent": 5.0}, "T1_FULL_MS"),
        ({"exact_stop_s": 0.1}, "T1_PAIR_MS[1]"),
        ({"shortest_blend_s": 0.06}, "T1_MS[5]"),
    ],
)
def test_a_controller_that_moves_otherwise_answers_otherwise(
    option: dict[str, Any], answer: str
) -> None:
    (usual,) = [row[3] for row in rows(SHEET) if row[2:3] == [f"`{answer}`"]]
    motion = dataclasses.replace(MOTION, **option)
    rig = Rig(*map(read, files_of(MOVES)), motion=motion, mode="T1")
    found = float(ended(rig, MOVES).text(answer) or "nan")
    assert found > float(usual) + (MS if "MS" in answer else DEG)


def ended(rig: Rig, name: str) -> Rig:
    """The rig after a program: once to the BCO point, and once from there."""
    rig.run(name)
    assert rig.krc.start()
    rig.until(lambda: rig.krc.state != "P_ACTIVE", LIMIT_S)
    assert rig.krc.state == "P_END", rig.krc.messages
    return rig


@pytest.mark.parametrize("kind", [1, 2])
def test_planned_blocks_that_are_not_forgotten_show(kind: int) -> None:
    source, data = sorted(files_of(MOVES), reverse=True)
    kept = source.read_text().replace("\nRESUME\n", "\n")
    rig = Rig(parse(kept, source.name), read(data), motion=MOTION, mode="T1")
    assert float(ended(rig, MOVES).text(f"T1_AFTER[{kind}]") or "nan") > 5.0


@pytest.mark.realtime
def test_the_line_that_looks_at_the_submit_interpreter_says_its_cycle() -> None:
    line = SHEET.split("```")[1].strip().removeprefix("python -c ").strip('"')

    async def look() -> bytes:
        world = World(asyncio.get_running_loop().time)
        server = KvpServer(Controller(world, random.Random(5)), world, random.Random(6), "measured")
        port = await server.serve_tcp("127.0.0.1")
        text = line.replace("ADDRESS", "127.0.0.1").replace("7000", str(port))
        try:
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-c", text, stdout=asyncio.subprocess.PIPE
            )
            return (await process.communicate())[0]
        finally:
            await server.close()

    steps = yaml.safe_load(asyncio.run(asyncio.wait_for(look(), 50.0)))
    assert steps[0] == 12
    assert all(step % 12 == 0 for step in steps)
