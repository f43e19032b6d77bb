"""The pictures of the wrist policies: what the planner does now, named where they are explained."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

REPOSITORY = Path(__file__).parents[2]
PLANNER = REPOSITORY / "sphmctl" / "planner"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
NAMES = ["cranks", "fixed", "level", "tilt", "auto"]


def test_each_policy_is_explained_with_a_picture_of_its_own() -> None:
    text = (PLANNER / "policies.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == NAMES
    pictures = re.findall(r"!\[[a-z]+\]\(([^)]+)\)", text)
    assert [Path(picture).stem for picture in pictures] == NAMES
    for picture, name in zip(pictures, NAMES, strict=True):
        words = " ".join(ElementTree.parse(PLANNER / picture).getroot().itertext())
        assert f"The policy {name}" in words


def test_the_pictures_show_what_the_policies_do_now() -> None:
    tool = REPOSITORY / "tools" / "pictures" / "policies.py"
    drawn = runpy.run_path(str(tool))["drawings"]()
    assert list(drawn) == NAMES
    for name, now in drawn.items():
        kept = (PLANNER / "policies" / "pictures" / f"{name}.svg").read_text(encoding="utf-8")
        again = f"{name}.svg is stale: run python tools/pictures/policies.py"
        assert NUMBER.sub("", kept) == NUMBER.sub("", now), again
        numbers = [np.array(NUMBER.findall(text), dtype=float) for text in (kept, now)]
        # Another machine's rounding may move a line by the last figure drawn.
        assert numbers[0] == pytest.approx(numbers[1], abs=0.21), again
