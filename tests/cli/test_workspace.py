"""`workspace`: its document, its files, and its ways to fail."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.cli.rig import Sphmctl, listed, read_csv

FEW = ("--samples", "300", "--seed", "4")
CELL = """\
version: 1
name: narrow
arm: {driver: emulated}
wrist: {driver: emulated}
limits:
  a1: {range_deg: [-80, 80]}
"""
WALLED = """\
version: 1
name: walled
arm: {driver: emulated, model: KR6R900}
wrist: {driver: emulated}
obstacles: {planes: {wall: {point_mm: [500, 0, 0], normal: [-1, 0, 0]}}}
"""
SOFT_AND_BANDS = {"soft", *(f"s{k}" for k in range(1, 6))}


def test_the_document_has_the_fields_of_the_contract(sphmctl: Sphmctl) -> None:
    told = sphmctl("workspace", *FEW, "--plane", "a1_90", "--json")
    assert told.code == 0, told.err
    document = told.document
    assert document["samples"] == 300
    assert document["elapsed_s"] > 0.0
    assert document["ratio_percent"] == pytest.approx(128.7, abs=0.3)
    assert document["hybrid"]["horizontal_mm"] == pytest.approx([-1093.96, 1093.96], abs=0.01)
    assert document["hybrid"]["z_mm"] == pytest.approx([-535.69, 1468.96], abs=0.01)
    ratio = 100.0 * document["hybrid"]["area_mm2"] / document["kuka"]["area_mm2"]
    assert document["ratio_percent"] == pytest.approx(ratio)
    sampled = document["monte_carlo"]
    bias = sampled["hybrid"]["z_mm"][1] - document["hybrid"]["z_mm"][1]
    assert sampled["bias"]["hybrid_z_mm"][1] == pytest.approx(bias)
    assert bias < 0.0


def test_people_get_the_same_figures_as_a_table(sphmctl: Sphmctl) -> None:
    told = sphmctl("workspace", *FEW)
    assert told.code == 0, told.err
    assert "-1044.0 to 1094.0" in told.out
    assert "hybrid by arm: 133.7" in told.out


def test_samples_and_map_are_written_and_the_samples_agree_with_fk(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    told = sphmctl("workspace", *FEW, "--csv", "samples.csv", "--map", "map.csv", "--json")
    assert told.code == 0, told.err
    rows = read_csv(tmp_path / "samples.csv")
    assert len(rows) == told.document["monte_carlo"]["kept"]
    free = [row["collides"] for row in rows].count("0")
    assert free == told.document["monte_carlo"]["free"] < len(rows)
    joints = [float(value) for name, value in rows[0].items() if name[0] in "at"][:9]
    pose = sphmctl("fk", "--joints", listed(joints), "--tool", "face", "--json").document
    written = [float(rows[0][name]) for name in ("x_mm", "y_mm", "z_mm")]
    assert written == pytest.approx(pose["position_mm"], abs=1e-3)
    cells = read_csv(tmp_path / "map.csv")
    assert len(cells) > 1000
    assert max(float(row["hybrid_share_percent"]) for row in cells) == 100.0
    assert any(row["hybrid_lean_deg"] == "" for row in cells)


def test_a_cell_with_obstacles_is_surveyed_with_all_files(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "walled.yaml").write_text(WALLED)
    files = ("--plot", "w.svg", "--csv", "samples.csv", "--map", "map.csv")
    told = sphmctl("workspace", *FEW, *files, "--cell", "walled.yaml", "--json")
    assert told.code == 0, told.err
    for part in (told.document["kuka"], told.document["hybrid"]):
        left, right = part["horizontal_mm"]
        assert left < -900.0
        assert 495.0 < right < 500.0
    for row in read_csv(tmp_path / "samples.csv"):
        assert row["collides"] == "1" or float(row["x_mm"]) < 500.0
    behind = [row for row in read_csv(tmp_path / "map.csv") if float(row["horizontal_mm"]) > 525.0]
    assert behind == []


@pytest.mark.parametrize("plane", ["a1_0", "a1_90"])
def test_the_picture_is_svg_with_eight_panels(sphmctl: Sphmctl, tmp_path: Path, plane: str) -> None:
    told = sphmctl("workspace", *FEW, "--plane", plane, "--plot", "w.svg", "--json")
    assert told.code == 0, told.err
    tree = ElementTree.parse(tmp_path / "w.svg").getroot()
    panels = [g for g in tree.iter("{http://www.w3.org/2000/svg}g") if g.get("class") == "chart"]
    assert len(panels) == 8
    labels = [panel.get("aria-label") for panel in panels]
    assert labels[:2] == ["Arm alone: samples in space", "Hybrid: samples in space"]
    texts = [text.text for text in tree.iter("{http://www.w3.org/2000/svg}text")]
    for meaning in ("z below −100", "above 1100 mm", "the arm's cut", "0 to 20 %", "90 to 180°"):
        assert texts.count(meaning) == 2
    keys = [path.get("class", "").split() for path in tree.iter("{http://www.w3.org/2000/svg}path")]
    patches = [style[-2] for style in keys if style[-1] == "key"]
    assert sorted(set(patches)) == sorted({*(f"m{k}" for k in range(5)), *SOFT_AND_BANDS})
    assert "http" not in (tmp_path / "w.svg").read_text().replace("http://www.w3.org/2000/svg", "")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("--tool", "pen"), 3, 'no tool "pen"'),
        (("--plot", "absent/w.svg"), 3, "make the folder first"),
        (("--plot", "f", "--csv", "f"), 2, "each its own file"),
        (("--csv", "f", "--map", "./f"), 2, "each its own file"),
        (("--plane", "x"), 2, "a1_0"),
        (("--samples", "0"), 2, "greater than or equal to 1"),
        (("--cell", "narrow.yaml", "--plane", "a1_90"), 4, "needs A1 at -90 degrees"),
    ],
)
def test_what_cannot_be_surveyed_is_told(
    sphmctl: Sphmctl, tmp_path: Path, arguments: tuple[str, ...], code: int, words: str
) -> None:
    (tmp_path / "narrow.yaml").write_text(CELL)
    told = sphmctl("workspace", *FEW, *arguments, "--json")
    assert told.code == code
    assert words in told.error["message"]
    assert [path.name for path in tmp_path.iterdir()] == ["narrow.yaml"]
