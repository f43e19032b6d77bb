"""The pictures of the wrist policies: drawn, and named where they are explained."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

PLANNER = Path(__file__).parents[2] / "sphmctl" / "planner"
NAMES = ["cranks", "fixed", "level", "tilt", "auto"]


def test_each_policy_is_explained_with_a_picture_of_its_own() -> None:
    text = (PLANNER / "policies.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == NAMES
    pictures = re.findall(r"!\[[a-z]+\]\(([^)]+)\)", text)
    assert [Path(picture).stem for picture in pictures] == NAMES
    for picture, name in zip(pictures, NAMES, strict=True):
        words = " ".join(ElementTree.parse(PLANNER / picture).getroot().itertext())
        assert f"The policy {name}" in words
