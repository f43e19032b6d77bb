"""URDF and MJCF against other libraries: Pinocchio's forward kinematics, MuJoCo's solver."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
import pytest

from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.robots import kr6, rrs, sphm
from sphmctl.robots.export import joint_values, links, mjcf, urdf
from sphmctl.robots.geometry import angle_between, pose_matrix
from sphmctl.robots.sphm import bodies

TOOL = pose_matrix([0.010, -0.020, 0.0589], [0.1, 0.2, 0.3])
YAW_RAD = 0.3
INDEPENDENT = (*JOINT_NAMES[:6], "heave", "direction", "tilt")


def draw(count: int, seed: int) -> Floats:
    low, high = sphm.RANGES9.T
    return np.asarray(np.random.default_rng(seed).uniform(low, high, (count, 9)))


def pinocchio_poses(text: str, values: dict[str, Floats], mimic: bool) -> Floats:
    """Tool poses (n, 4, 4) by Pinocchio of joint values (n,) by name."""
    model: Any = pinocchio.buildModelFromXML(text, mimic)
    data = model.createData()
    poses = []
    for row in range(len(next(iter(values.values())))):
        q = np.zeros(model.nq)
        for name, value in values.items():
            q[model.joints[model.getJointId(name)].idx_q] = value[row]
        pinocchio.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[model.getFrameId("tool")].homogeneous)
    return np.array(poses)


def test_pinocchio_has_the_tool_where_we_have_it_from_all_joints_of_the_urdf() -> None:
    q = draw(200, 1)
    values = joint_values(q)
    poses = pinocchio_poses(urdf(TOOL, YAW_RAD), values, mimic=False)
    assert poses == pytest.approx(sphm.forward(q, TOOL, YAW_RAD), abs=1e-12)


def test_nine_independent_joints_are_enough_for_a_reader_that_knows_mimic() -> None:
    q = draw(200, 2)
    values = {name: joint_values(q)[name] for name in INDEPENDENT}
    poses = pinocchio_poses(urdf(TOOL, YAW_RAD), values, mimic=True)
    assert poses == pytest.approx(sphm.forward(q, TOOL, YAW_RAD), abs=1e-12)


def test_the_arm_of_the_urdf_has_kukas_ranges_speeds_and_senses() -> None:
    joints = {joint.get("name"): joint for joint in ElementTree.fromstring(urdf()).iter("joint")}
    for k, name in enumerate(JOINT_NAMES[:6]):
        limit, axis = joints[name].find("limit"), joints[name].find("axis")
        assert limit is not None
        assert axis is not None
        ends = [float(limit.attrib[key]) for key in ("lower", "upper")]
        assert ends == pytest.approx(kr6.RANGES[k].tolist())
        assert float(limit.attrib["velocity"]) == pytest.approx(kr6.MAX_SPEED[k])
        senses = ["0 0 -1", "0 1 0", "0 1 0", "-1 0 0", "0 1 0", "-1 0 0"]
        assert axis.attrib["xyz"] == senses[k]


def test_every_platform_pose_is_within_the_limits_of_the_virtual_joints() -> None:
    values = joint_values(draw(20_000, 3))
    for joint in ElementTree.fromstring(urdf()).iter("joint"):
        limit = joint.find("limit")
        if limit is not None:
            value = values[joint.attrib["name"]]
            assert float(limit.attrib["lower"]) - 1e-9 <= value.min()
            assert value.max() <= float(limit.attrib["upper"]) + 1e-9


def test_the_capsules_move_with_their_links_as_the_collision_check_has_them() -> None:
    q = draw(50, 4)
    begin, extent = bodies.segments(q, TOOL, YAW_RAD)
    model: Any = pinocchio.buildModelFromXML(urdf(TOOL, YAW_RAD))
    data, values = model.createData(), joint_values(q)
    shapes = [k for k, group in enumerate(bodies.BODY_GROUPS) if group != "legs"]
    for row in range(len(q)):
        joints = np.zeros(model.nq)
        for name, value in values.items():
            joints[model.joints[model.getJointId(name)].idx_q] = value[row]
        pinocchio.framesForwardKinematics(model, data, joints)
        for k, shape in zip(shapes, links.capsules(TOOL), strict=True):
            frame = data.oMf[model.getFrameId(shape.link)].homogeneous
            placed = frame[:3, :3] @ shape.begin_m + frame[:3, 3]
            assert placed == pytest.approx(begin[:, k, row], abs=1e-9)
            placed = frame[:3, :3] @ shape.end_m + frame[:3, 3]
            assert placed == pytest.approx(begin[:, k, row] + extent[:, k, row], abs=1e-9)


def settled(model: Any, joints: Floats) -> Any:
    """MuJoCo's state after its drives took the cranks from home to joints (9,)."""
    data: Any = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[:6] = data.ctrl[:6] = joints[:6]
    home = data.ctrl[6:].copy()
    for step in range(600):
        data.ctrl[6:] = home + (joints[6:] - home) * min(1.0, step / 400)
        mujoco.mj_step(model, data)
    return data


def test_mujoco_closes_the_loops_where_our_kinematics_has_the_platform() -> None:
    model: Any = mujoco.MjModel.from_xml_string(mjcf(TOOL, YAW_RAD))
    assert (model.nu, model.neq) == (9, 3)
    for joints in draw(20, 5):
        data = settled(model, joints)
        reached = np.array([data.joint(name).qpos[0] for name in JOINT_NAMES])
        assert reached == pytest.approx(joints, abs=1e-4)
        expected = sphm.forward(reached, TOOL, YAW_RAD)
        tool = data.site("tool")
        assert np.linalg.norm(tool.xpos - expected[:3, 3]) < 1e-6
        assert angle_between(tool.xmat.reshape(3, 3), expected[:3, :3]) < 1e-5


def test_without_its_loops_the_mjcf_does_not_hold_the_platform() -> None:
    model: Any = mujoco.MjModel.from_xml_string(mjcf())
    model.eq_active0[:] = 0
    joints = np.radians([0.0, -90.0, 90.0, 0.0, 30.0, 0.0, 10.0, 80.0, 100.0])
    tool = settled(model, joints).site("tool")
    assert np.linalg.norm(tool.xpos - sphm.forward(joints)[:3, 3]) > 1e-3


def test_the_loops_are_closed_at_home_before_the_first_step() -> None:
    model: Any = mujoco.MjModel.from_xml_string(mjcf(None, YAW_RAD))
    data: Any = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    for leg in (1, 2, 3):
        apart = data.site(f"coupler_end_{leg}").xpos - data.site(f"ball_{leg}").xpos
        assert np.linalg.norm(apart) < 1e-9
    heave = np.linalg.norm(data.body("platform").xpos - data.body("wrist_base").xpos)
    assert heave == pytest.approx(rrs.forward(np.radians([60.0] * 3))[2, 3])
    assert data.ctrl == pytest.approx([data.joint(name).qpos[0] for name in JOINT_NAMES])


def test_both_models_carry_the_robots_weight_and_geometry() -> None:
    model: Any = mujoco.MjModel.from_xml_string(mjcf())
    assert 52.0 < model.body_mass.sum() < 54.0
    tree = ElementTree.fromstring(urdf())
    for use in ("visual", "collision"):
        assert len(list(tree.iter(use))) == 3 * len(links.capsules())
