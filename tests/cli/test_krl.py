"""`krl check`: findings, exit codes, and what belongs to a file that is named."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.cli.rig import REPOSITORY, Sphmctl

SHIPPED = REPOSITORY / "firmware" / "krc"


def test_the_shipped_program_is_clean(sphmctl: Sphmctl) -> None:
    told = sphmctl("krl", "check", SHIPPED, "--json")
    assert told.code == 0
    assert told.document["problems"] == []
    assert len(told.document["files"]) >= 3


def test_an_error_ends_with_3_and_stands_in_the_document(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "a.src").write_text("DEF A()\nX=1\nEND\n")
    told = sphmctl("krl", "check", "a.src", "--json")
    assert told.code == 3
    assert told.document == {
        "files": ["a.src"],
        "problems": [
            {
                "file": "a.src",
                "line": 2,
                "severity": "error",
                "code": "undeclared",
                "message": "X is not declared",
            }
        ],
    }


def test_a_warning_alone_ends_with_0(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "a.src").write_text("DEF A()\nPTP $AXIS_ACT\nEND\n")
    told = sphmctl("krl", "check", "a.src")
    assert told.code == 0
    assert "a.src:2: warning: $VEL_AXIS is not set" in told.out
    assert "0 errors, 2 warnings" in told.out


def test_the_data_list_beside_a_program_is_checked_too(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "A.SRC").write_text("DEF A()\nX=1\nEND\n")
    (tmp_path / "a.dat").write_text("DEFDAT A\nINT X=TRUE\nENDDAT\n")
    told = sphmctl("krl", "check", "A.SRC", "--json")
    assert [(p["file"], p["line"]) for p in told.document["problems"]] == [("a.dat", 2)]


def test_the_global_names_of_neighbours_are_known(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "a.src").write_text("DEF A()\nB()\nEND\n")
    (tmp_path / "b.src").write_text("DEF B()\nUNKNOWN=1\nEND\n")
    assert sphmctl("krl", "check", "a.src", "--json").document["problems"] == []
    assert sphmctl("krl", "check", ".").code == 3


def test_what_is_no_krl_file_is_refused(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("DEF A()\nEND\n")
    for name, sentence in (
        ("missing.src", "no such file"),
        ("a.txt", "a KRL file is a .src"),
        ("empty", "the folder holds no"),
    ):
        told = sphmctl("krl", "check", name, "--json")
        assert told.code == 3
        assert sentence in told.error["message"]


def test_help_does_not_import_the_parser() -> None:
    code = (
        "import sys; from sphmctl.cli.main import run; run(['krl', 'check', '--help']); "
        "sys.exit('lark' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
