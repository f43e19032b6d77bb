"""The page with the robot in 3D: its kinematics in Chromium, its controls, its seclusion."""

from __future__ import annotations

import json
import re
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sphmctl.motion import Plan
from sphmctl.pictures import view
from sphmctl.robots import sphm
from sphmctl.robots.geometry import matrix_to_abc, pose_matrix
from sphmctl.robots.sphm.bodies import Box, Plane
from tests.pictures.rig import LIMITS, TOOL, YAW_RAD, browse, console, make_plan

NAMES = ("x", "y", "z", "A", "B", "C")
BUDGET = "--virtual-time-budget=2000"
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')


def make_page(plan: Plan, **more: Any) -> str:
    return view(plan, LIMITS, YAW_RAD, **more)


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'id="plan">(.*?)</script>', page)
    assert found is not None
    loaded: dict[str, Any] = json.loads(found[1])
    return loaded


def table(dom: str, name: str) -> dict[str, float]:
    """The numbers of one table by the heads of their rows."""
    body = dom.split(f'<tbody id="{name}">')[1].split("</tbody>")[0]
    rows = re.findall(r'<th scope="row">([^<]+)</th><td>([^<]+)</td>', body)
    return {head: float(value.replace("−", "-")) for head, value in rows}


def driven(folder: Path, page: str, script: str) -> tuple[dict[str, Any], list[str]]:
    """What a script finds out in the page, which then lets it run; and the console."""
    file = folder / "driven.html"
    told = f"<script>document.title = JSON.stringify((() => {{ {script} }})());</script>"
    file.write_text(POLICY.sub("", page).replace("</body>", told + "</body>"), encoding="utf-8")
    shown = browse(folder, file, BUDGET, "--dump-dom")
    title = re.search(r"<title>(.*?)</title>", shown.stdout)
    assert title is not None
    found: dict[str, Any] = json.loads(title[1].replace("&amp;", "&"))
    return found, console(shown.stderr)


@pytest.mark.parametrize("time_s", [0.0, 1.72, 4.0])
def test_the_pages_own_kinematics_has_the_tool_where_ours_has_it(
    tmp_path: Path, time_s: float
) -> None:
    base = pose_matrix([0.1, -0.2, 0.05], [0.3, 0.2, 0.1])
    plan = replace(make_plan(), base_in_world=base)
    file = tmp_path / "plan.html"
    file.write_text(make_page(plan), encoding="utf-8")
    opened = browse(tmp_path, file, BUDGET, "--dump-dom", at=f"t={time_s}")
    assert console(opened.stderr) == []
    joints = np.array([np.interp(time_s, plan.t, q) for q in plan.joints.T])
    shown = table(opened.stdout, "joints")
    assert list(shown.values()) == pytest.approx(np.degrees(joints).tolist(), abs=0.02)
    tool = np.linalg.inv(base) @ sphm.forward(joints, TOOL, YAW_RAD)
    expected = [*tool[:3, 3] * 1000.0, *np.degrees(matrix_to_abc(tool[:3, :3]))]
    pose = table(opened.stdout, "pose")
    assert list(pose) == list(NAMES)
    assert list(pose.values()) == pytest.approx(expected, abs=0.02)


def test_buttons_slider_and_keys_do_what_they_say(tmp_path: Path) -> None:
    script = """
        const press = (target, key) => target.dispatchEvent(
            new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
        const found = {};
        byId("time").value = 1.5;
        byId("time").dispatchEvent(new Event("input"));
        found.scrubbed = time;
        press(canvas, "End");
        found.end = time;
        press(document.body, "Home");
        found.home = time;
        byId("points").lastElementChild.click();
        found.point = time;
        const before = eye.azimuth, far = eye.distance;
        press(canvas, "ArrowLeft");
        found.turned = eye.azimuth - before;
        press(canvas, "+");
        found.nearer = eye.distance / far;
        press(byId("time"), " ");
        found.spaceInSlider = playing !== null;
        press(document.body, "Home");
        press(document.body, " ");
        found.playing = byId("play").textContent;
        playing = 0;
        advance(1000);
        found.later = time;
        byId("play").click();
        found.paused = byId("play").getAttribute("aria-pressed");
        document.querySelector('[data-elevation="89"]').click();
        found.top = deg(eye.elevation);
        byId("time").value = byId("time").max;
        byId("time").dispatchEvent(new Event("input"));
        found.last = time;
        found.loaded = performance.getEntriesByType("resource").length;
        return found;
    """
    plan = make_plan()
    odd = replace(plan, t=plan.t * (4.0033 / 4.0))  # no multiple of any step
    found, said = driven(tmp_path, make_page(odd), script)
    assert said == []
    assert found["last"] == pytest.approx(4.0033, abs=1e-6)
    found["end"], found["point"] = (
        round(found["end"] - 0.0033, 9),
        round(found["point"] - 0.0033, 9),
    )
    assert (found["scrubbed"], found["end"], found["home"], found["point"]) == (1.5, 4, 0, 4)
    assert found["turned"] == pytest.approx(0.1)
    assert found["nearer"] == pytest.approx(0.9)
    assert found["spaceInSlider"] is False
    assert (found["playing"], found["paused"]) == ("Pause", "false")
    assert found["later"] == pytest.approx(1.0)
    assert found["top"] == pytest.approx(89.0)
    assert found["loaded"] == 0


def test_with_reduced_motion_the_robot_moves_twice_a_second_only(tmp_path: Path) -> None:
    script = """
        play(true);
        playing = 0;
        advance(400);
        const early = time;
        advance(600);
        return { calm: calm.matches, early, later: time };
    """
    page = make_page(make_plan())
    found, _ = driven(tmp_path, page.replace("(prefers-reduced-motion: reduce)", "all"), script)
    assert found == {"calm": True, "early": 0, "later": pytest.approx(0.6)}


def test_the_page_names_nothing_to_load_and_its_policy_would_not_let_it(tmp_path: Path) -> None:
    page = make_page(make_plan())
    assert not re.search(r"https?:|//[a-z]|@import|url\(|\ssrc=|\shref=", page, re.IGNORECASE)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        address = f"http://127.0.0.1:{server.getsockname()[1]}"
        bad = f'<img src="{address}/a.png"><script>fetch("{address}/b")</script></body>'
        file = tmp_path / "bad.html"
        file.write_text(page.replace("</body>", bad), encoding="utf-8")
        said = console(browse(tmp_path, file, BUDGET, "--dump-dom").stderr)
        with pytest.raises(BlockingIOError):
            server.accept()
    assert len(said) == 2
    assert all("Content Security Policy" in line for line in said)


def test_the_robot_is_drawn_in_its_colours_by_day_and_by_night(tmp_path: Path) -> None:
    script = """
        const pixels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
        let arm = 0, path = 0;
        for (let k = 0; k < pixels.length; k += 4) {
            const [r, g, b] = pixels.slice(k, k + 3);
            if (r > 150 && r > 1.4 * g && g > 1.5 * b) arm++;
        }
        return { arm, card: colours.card, all: pixels.length / 4 };
    """
    page = make_page(make_plan(), obstacles=[Box("box", np.eye(4), np.full(3, 0.1))])
    found, said = driven(tmp_path, page, script)
    assert said == []
    assert found["arm"] > 0.02 * found["all"]
    assert found["card"] == "#ffffff"
    dark = page.replace("(prefers-color-scheme: dark)", "all")
    assert driven(tmp_path, dark, script)[0]["card"] == "#1b2027"


def test_a_long_plan_stays_a_small_page() -> None:
    plan = make_plan(rows=2001)
    hour = replace(plan, t=plan.t * 900.0)
    page = make_page(hour, binding=["tool speed", "smoothing"] * 1000 + ["tool speed"])
    assert len(page) < 2_500_000
    data = data_of(page)
    assert (len(data["rows"]) - 1) * data["step_s"] == pytest.approx(3600.0)


def test_rows_are_evenly_apart_and_what_binds_is_told_until_when() -> None:
    plan = make_plan()
    data = data_of(make_page(plan, binding=["tool speed"] * 251 + ["smoothing"] * 250))
    assert len(data["rows"]) == 101
    assert data["binding"] == [[2.0, "tool speed"], [4.0, "smoothing"]]
    middle = [np.interp(2.0, plan.t, q) for q in np.degrees(plan.joints).T]
    assert data["rows"][50][:9] == pytest.approx(middle, abs=1e-3)


def test_a_name_from_outside_ends_no_element(tmp_path: Path) -> None:
    nasty = "</script><script>document.title = 'taken'</script>{{data}}"
    plan = make_plan(name=nasty)
    plan = replace(plan, points=tuple(replace(point, name=nasty) for point in plan.points))
    file = tmp_path / "plan.html"
    file.write_text(make_page(plan, binding=[nasty] * 501), encoding="utf-8")
    told = browse(tmp_path, file, BUDGET, "--dump-dom")
    assert console(told.stderr) == []
    assert "<title>taken" not in told.stdout
    assert data_of(make_page(plan))["points"][0]["name"] == nasty


def test_a_plan_of_one_row_stands_still(tmp_path: Path) -> None:
    plan = make_plan()
    one = replace(
        plan, t=plan.t[:1], joints=plan.joints[:1], tool=plan.tool[:1], knots=(), points=()
    )
    file = tmp_path / "plan.html"
    file.write_text(make_page(one), encoding="utf-8")
    told = browse(tmp_path, file, BUDGET, "--dump-dom")
    assert console(told.stderr) == []
    assert table(told.stdout, "joints")["A1"] == pytest.approx(10.0)


def test_walls_and_boxes_are_drawn_with_their_names(tmp_path: Path) -> None:
    script = """
        let strokes = 0;
        const stroke = pen.stroke.bind(pen);
        pen.stroke = () => {
            if (pen.strokeStyle === colours.obstacle) strokes++;
            stroke();
        };
        const count = () => { strokes = 0; draw(); return strokes; };
        const names = [], fill = pen.fillText.bind(pen);
        pen.fillText = (name, x, y) => { names.push(name); fill(name, x, y); };
        const all = count(), told = [...names];
        plan.planes = [];
        const boxes = count();
        plan.boxes = [];
        return { all, boxes, none: count(), told };
    """
    wall = Plane("wall", np.array([0.0, 0.5, 0.0]), np.array([0.0, -1.0, 0.0]))
    lid = Plane("lid", np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    box = Box("crate", pose_matrix([0.4, 0.0, 0.0], [0.0, 0.0, 0.0]), np.full(3, 0.1))
    page = make_page(make_plan(), obstacles=[box, wall, lid])
    found, said = driven(tmp_path, page, script)
    assert said == []
    assert found["all"] > found["boxes"] > found["none"] == 0
    assert found["told"][:3] == ["crate", "wall", "lid"]
    for plane, data in zip((wall, lid), data_of(page)["planes"], strict=True):
        u, v = np.array(data["across"])
        assert [*(u @ plane.normal, v @ plane.normal, u @ v)] == pytest.approx([0.0] * 3)
        assert (np.array(data["at"]) - plane.point_m) @ plane.normal == pytest.approx(0.0)


def test_half_a_turn_is_told_with_one_sign_and_the_frames_by_name(tmp_path: Path) -> None:
    script = """
        const turned = (angle) => {
            plan.base = inverse(turn([1, 0, 0], angle));
            tell(state(0), I);
            return byId("pose").rows[5].cells[1].textContent;
        };
        return { below: turned(-Math.PI + 1e-7), above: turned(Math.PI - 1e-7), less: turned(-3.1),
                 caption: byId("pose").parentElement.caption.textContent };
    """
    page = make_page(make_plan(), frames=("pen", "table"))
    found, said = driven(tmp_path, page, script)
    assert said == []
    assert (found["below"], found["above"], found["less"]) == ("180.00", "180.00", "−177.62")
    assert found["caption"] == "Tool pen in table"
