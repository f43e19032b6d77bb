"""The command line as a whole: usage errors, help that teaches, which cell, and no traceback."""

from __future__ import annotations

import ast
import inspect
import json
import subprocess
import sys
from pathlib import Path

import pytest

from sphmctl.cli.main import app
from tests.cli.rig import OCTAGON, REPOSITORY, Sphmctl

COMMANDS = ("fk", "ik", "check", "plan", "run", "emulate", "doctor", "status", "commission")
# Not pydantic, which typer imports by itself from 0.29 on.
HEAVY = ("numpy", "sphmctl.config", "yaml", "serial", "dynamixel_sdk", "structlog", "click")


def callback_help(command: str) -> str:
    """The help text as it stands in the source."""
    callbacks = {item.name: item.callback for item in app.registered_commands}
    return inspect.getdoc(callbacks[command]) or ""


def examples(command: str) -> list[str]:
    """The command lines that the help teaches."""
    paragraphs = callback_help(command).split("\n\n")
    return [" ".join(text.split())[9:] for text in paragraphs if text.startswith("Example: ")]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "give a command"),
        (("dance",), "No such command 'dance'"),
        (("--speed", "5"), "No such option: --speed"),
        (("fk", "--jonts", "1"), "No such option: --jonts"),
        (("fk", "extra"), "unexpected extra argument"),
        (("fk", "--joints"), "requires an argument"),
        (("fk",), "give either --joints, or --csv IN with --out OUT"),
        (("ik",), "give either --pose, or --csv IN with --out OUT"),
        (("check",), "Missing argument 'PATH'"),
        (("check", "a", "b"), "unexpected extra argument"),
        (("check", "a", "--speed", "fast"), "Invalid value for '--speed'"),
        (("plan", "--out", "a.csv"), "Missing argument 'PATH'"),
        (("run",), "Missing argument 'PATH'"),
        (("emulate", "--kvp-port", "70000"), "Invalid value for '--kvp-port'"),
        (("doctor", "now"), "unexpected extra argument"),
        (("status", "--cell"), "requires an argument"),
    ],
)
def test_a_wrong_call_is_told_in_one_sentence(
    sphmctl: Sphmctl, arguments: tuple[str, ...], words: str
) -> None:
    told = sphmctl(*arguments)
    assert told.code == 2
    assert told.err.count("\n") == 1
    assert told.err.startswith("sphmctl: command line: ")
    assert words in told.err
    if arguments and arguments[-1] not in ("--joints", "--cell"):
        told = sphmctl(*arguments, "--json")
        assert told.code == 2
        if arguments[0] in COMMANDS:
            assert words in told.error["message"]
        assert told.error["where"] == "command line"


@pytest.mark.parametrize(
    "arguments",
    [
        ("fk", "--joints", "a,b"),
        ("fk", "--joints", "0,0,0,0,0,0,0,0,0", "--cell", "/"),
        ("ik", "--pose", "9,9,9"),
        ("ik", "--pose", "9000,0,0,0,0,0"),
        ("check", "/dev/null"),
        ("check", "/proc/self/mem"),
        ("check", sys.executable),
        ("plan", "/", "--out", "x.csv"),
        ("plan", str(OCTAGON), "--out", "/proc/x.csv"),
        ("run", "absent.yaml", "--dry-run"),
        ("doctor", "--cell", "absent.yaml"),
        ("status", "--cell", str(OCTAGON)),
    ],
)
def test_what_goes_wrong_is_one_sentence_and_never_a_traceback(
    sphmctl: Sphmctl, arguments: tuple[str, ...]
) -> None:
    told = sphmctl(*arguments)
    assert told.code in (3, 4)
    assert told.out == ""
    *said, sentence = told.err.splitlines()
    assert set(said) <= {"EMULATED: no robot will move"}
    assert sentence.startswith("sphmctl: ")
    told = sphmctl(*arguments, "--json")
    assert told.error["message"]
    assert told.out.count("\n") == 1


@pytest.mark.parametrize("command", COMMANDS)
def test_help_teaches_with_an_example(sphmctl: Sphmctl, command: str) -> None:
    told = sphmctl(command, "--help")
    assert (told.code, told.err) == (0, "")
    flat = " ".join(told.out.split())
    assert f"Example: sphmctl {command}" in flat
    assert "--json" in told.out
    assert "\x1b" not in told.out
    assert examples(command)
    assert all(line.startswith(f"sphmctl {command} ") for line in examples(command))


@pytest.mark.parametrize("command", ["fk", "ik", "check", "plan"])
def test_the_examples_of_the_help_work(sphmctl: Sphmctl, tmp_path: Path, command: str) -> None:
    (tmp_path / "configs").symlink_to(REPOSITORY / "configs")
    joints = "0,-90,90,0,40,0,60,60,60"
    names = [f"a{axis}_deg" for axis in range(1, 7)] + [f"theta{leg}_deg" for leg in (7, 8, 9)]
    (tmp_path / "joints.csv").write_text(f"{','.join(names)}\n{joints}\n")
    (tmp_path / "poses.csv").write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n500,0,300,180,0,180\n")
    for line in examples(command):
        told = sphmctl(*line.split()[1:])
        assert (told.code, told.err) == (0, "")
        assert told.out


def test_help_brings_no_heavy_module_with_it() -> None:
    program = (
        "import json, sys\n"
        "from sphmctl.cli.main import run\n"
        f"codes = [run([*command, '--help']) for command in {[[], *([c] for c in COMMANDS)]!r}]\n"
        f"found = [name for name in {HEAVY!r} if name in sys.modules]\n"
        "print(json.dumps([codes, found]), file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert json.loads(done.stderr) == [[0] * (1 + len(COMMANDS)), []]


def test_nothing_imports_click_which_typer_carries_inside_itself() -> None:
    for file in (REPOSITORY / "sphmctl").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names if name.split(".")[0] == "click"], file


def test_the_program_writes_json_alone_and_leaves_with_the_exit_code() -> None:
    def call(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", "from sphmctl.cli.main import main; main()", *arguments],
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )

    done = call("fk", "--joints", "-10,-90,90,0,40,0,60,60,60", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(json.loads(done.stdout)["position_mm"]) == 3
    done = call("fk", "--joints", "0,-90,90,0,40,0,60,60,150", "--json")
    assert done.returncode == json.loads(done.stdout)["error"]["exit_code"] == 4
    assert done.stderr.startswith("sphmctl: --joints: theta9 is 150 degrees")


def test_the_cell_is_the_options_then_the_environments_then_the_folders(
    sphmctl: Sphmctl, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cell(name: str) -> Path:
        file = tmp_path / f"{name}.yaml"
        file.write_text(
            f"version: 1\nname: {name}\narm: {{driver: emulated}}\nwrist: {{driver: emulated}}\n"
        )
        return file

    def used(*options: str | Path) -> str:
        joints = "0,-90,90,0,40,0,60,60,60"
        told = sphmctl("fk", "--joints", joints, "--tool", "none", "--json", *options)
        return str(told.error["message"]).split("'")[1]

    assert used() == "emulated"
    cell("cell")
    assert used() == "cell"
    monkeypatch.setenv("SPHMCTL_CELL", str(cell("environment")))
    assert used() == "environment"
    assert used("--cell", cell("option")) == "option"
