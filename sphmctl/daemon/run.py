"""One run from connected devices to a finished folder: session, record, assessment, report."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import gc
import json
import math
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from sphmctl import clock, planner
from sphmctl.config import Cell, dump
from sphmctl.daemon import assess
from sphmctl.daemon.board_report import KNOT_EDGE
from sphmctl.daemon.record import (
    FEEDBACK_COLUMNS,
    Events,
    RowFile,
    feedback_row,
    new_folder,
    write_truth,
)
from sphmctl.daemon.report import Event, ReportInput, Trace, write_report
from sphmctl.daemon.session import Consent, Outcome, Session
from sphmctl.drivers.kuka import KukaArm
from sphmctl.drivers.wrist import Wrist
from sphmctl.errors import InvalidError, SphmctlError, UsageError
from sphmctl.motion import Floats, Plan
from sphmctl.robots import sphm

ROWS_LIMIT = 1_000_000
"""Rows kept for the report: nearly three hours at 100 Hz, 80 MB; the file gets every row."""

OWN_FILES = ("cell.yaml", "plan.csv", "feedback.csv", "truth.csv", "summary.json")
"""Names in a run's folder that no input takes."""


class TruthSource(Protocol):
    """Knows the true joints of an emulated machine."""

    def truth(self, begin_s: float, end_s: float) -> list[tuple[float, ...]]:
        """Rows of (time on the emulators' clock, nine joints deg) between two host times."""


@dataclass(frozen=True)
class Job:
    """What to run, and where to leave the record.

    Attributes:
        speed: share by which the plan was scaled.
        inputs: what the plan was made from, by the name that the run's folder keeps it under.
        clock: "real" or "virtual".
    """

    plan: Plan
    cell: Cell
    speed: float
    inputs: dict[str, bytes]
    runs_dir: Path
    started: datetime
    clock: str


@dataclass
class _Rows:
    """What was measured, in memory for the assessment."""

    t_s: list[float] = field(default_factory=list)
    joints: list[Floats] = field(default_factory=list)


async def run_job(
    job: Job,
    arm: KukaArm,
    wrist: Wrist,
    consent: Consent,
    stop: asyncio.Event,
    on_progress: Callable[[float], None],
    echo: Callable[[str, dict[str, Any]], None],
    truth: TruthSource | None = None,
) -> dict[str, Any]:
    """Run a job on devices that are not connected yet.

    Args:
        job: what to run.
        arm, wrist: the devices.
        consent: asked once before anything moves.
        stop: set it for a controlled stop.
        on_progress: takes the plan time reached, s.
        echo: told of each event.
        truth: the emulated machine's true joints; None on a real one.

    Returns:
        The summary, as summary.json holds it.

    Raises:
        SphmctlError: before any motion; no folder is left then.
    """
    loop = asyncio.get_running_loop()
    early = Events(None, loop.time, echo)
    session = Session(job.cell, arm, wrist, early)
    try:
        await session.open()
        await session.verify()
        approach = await session.prepare(job.plan, job.speed, consent)
        if stop.is_set():
            raise UsageError("stopped before anything was armed or moved")
        folder = new_folder(job.runs_dir, job.plan.name, job.started)
        _write_inputs(folder, job)
        events = Events(folder / "events.jsonl", loop.time, echo)
        session.report_to(events)
        try:
            rows = _Rows()
            try:
                outcome = await _play(job, session, approach, stop, on_progress, folder, rows)
            except SphmctlError:
                # Only ever before motion: there is nothing to keep.
                shutil.rmtree(folder, ignore_errors=True)
                raise
            return _conclude(job, folder, outcome, rows, truth, events)
        finally:
            events.close()
    finally:
        await session.close()


async def _play(
    job: Job,
    session: Session,
    approach: Plan | None,
    stop: asyncio.Event,
    on_progress: Callable[[float], None],
    folder: Path,
    rows: _Rows,
) -> Outcome:
    feedback = RowFile(folder / "feedback.csv", FEEDBACK_COLUMNS)
    base = np.linalg.inv(job.plan.base_in_world)
    mount_yaw = job.cell.mount_yaw_rad

    def keep(t_s: float, joints: Floats, tau_s: float) -> None:
        tool = base @ sphm.forward(joints, job.plan.tool_on_platform, mount_yaw)
        feedback.row(feedback_row(t_s, joints, tool, tau_s))
        if len(rows.t_s) < ROWS_LIMIT and not np.isnan(joints).any():
            rows.t_s.append(t_s)
            rows.joints.append(np.degrees(joints))

    # What lives on from planning would be searched in each collection, for up to 45 ms.
    gc.collect()
    gc.freeze()
    real = job.clock == "real"
    try:
        with clock.urgent() if real else contextlib.nullcontext():
            return await session.play(job.plan, approach, stop, keep, on_progress)
    finally:
        gc.unfreeze()
        feedback.close()


def _write_inputs(folder: Path, job: Job) -> None:
    try:
        for name, content in job.inputs.items():
            file = folder / (f"path-{name}" if name in OWN_FILES else name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        (folder / "cell.yaml").write_text(dump(job.cell))
        (folder / "plan.csv").write_text(planner.plan_csv(job.plan))
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        message = f"the run's folder cannot be written: {error.strerror}; make room on the disk"
        raise InvalidError(message, str(folder)) from error


def _conclude(
    job: Job,
    folder: Path,
    outcome: Outcome,
    rows: _Rows,
    truth: TruthSource | None,
    events: Events,
) -> dict[str, Any]:
    """Assess what was recorded, and write truth, summary and report."""
    measured = np.array(rows.joints) if rows.joints else np.empty((0, 9))
    true_rows: list[tuple[float, ...]] = []
    if truth is not None and math.isfinite(outcome.begin_s):
        found = truth.truth(outcome.begin_s, outcome.end_s)
        true_rows = [(row[0] - found[0][0], *row[1:]) for row in found]
    true = np.array(true_rows) if true_rows else np.empty((0, 10))
    assessment = _Assessment(job, measured, true, outcome)
    summary = _summary(job, folder, outcome, assessment)
    try:
        if true_rows:
            write_truth(folder / "truth.csv", true_rows)
        (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
        report = _report(job, folder, outcome, rows, assessment, events)
        write_report(folder / "report.html", report)
    except OSError as error:
        # The run is over and its figures are known: they must not be lost with the files.
        problem = f"the record in {folder} is not complete: {error.strerror}; make room on the disk"
        outcome.unconfirmed.append(problem)
        events.add("record not complete", message=problem)
    return summary


def _summary(job: Job, folder: Path, outcome: Outcome, assessment: _Assessment) -> dict[str, Any]:
    """What summary.json holds."""
    summary = assessment.summary() | {
        "outcome": outcome.outcome,
        "cause": outcome.cause,
        "unconfirmed": outcome.unconfirmed,
        "remedy": outcome.remedy,
        "board": outcome.board,
        "run_dir": str(folder),
        "duration_s": round(_duration_s(outcome), 3),
        "planned_s": round(job.plan.duration_s, 3),
        "emulated": list(job.cell.emulated_devices),
        "clock": job.clock,
        "notes": list(job.plan.notes),
    }
    if job.clock == "real":
        # The system's monotonic clock: an emulator in another process dates its truth by it.
        summary["begin_monotonic_s"] = outcome.begin_s if math.isfinite(outcome.begin_s) else None
        summary["end_monotonic_s"] = outcome.end_s if math.isfinite(outcome.end_s) else None
    return summary


def _duration_s(outcome: Outcome) -> float:
    """How long the plan's motion took; 0 when it never began."""
    return outcome.end_s - outcome.begin_s if math.isfinite(outcome.begin_s) else 0.0


class _Assessment:
    """The figures of a run, from what was measured and, where there is one, from the truth."""

    def __init__(self, job: Job, measured: Floats, true: Floats, outcome: Outcome) -> None:
        plan = job.plan
        plan_deg = np.degrees(plan.joints)
        yaw = job.cell.mount_yaw_rad
        complete = outcome.outcome == "completed"
        self.measured = measured
        self.tracking = assess.tracking(plan, measured, mount_yaw_rad=yaw, complete=complete)
        self.points = assess.named_points(plan, measured, mount_yaw_rad=yaw)
        self.skew: assess.Skew | None = None
        self.trace: Trace | None = None
        self.truth: assess.Tracking | None = None
        if true.size:
            t, joints = true[:, 0], true[:, 1:]
            trace = assess.skew_trace(plan.t, plan_deg, t, joints)
            self.skew = assess.skew_figures(trace)
            self.trace = Trace(t, trace)
            self.truth = assess.tracking(plan, joints, mount_yaw_rad=yaw, complete=complete)

    def summary(self) -> dict[str, Any]:
        """The figures of the contract; null where there is no truth to take them from."""
        skew = self.skew
        return {
            "tracking": dataclasses.asdict(self.tracking),
            "true_tracking": None if self.truth is None else dataclasses.asdict(self.truth),
            "skew_ms": {
                "p50": skew.p50_ms if skew else None,
                "p99": skew.p99_ms if skew else None,
                "max": skew.max_ms if skew else None,
                "share_counted": skew.share_counted if skew else None,
            },
            "max_crank_error_deg": skew.max_crank_error_deg if skew else None,
            "points": [dataclasses.asdict(point) for point in self.points],
        }


def _report(
    job: Job,
    folder: Path,
    outcome: Outcome,
    rows: _Rows,
    assessment: _Assessment,
    events: Events,
) -> ReportInput:
    plan = job.plan
    yaw = job.cell.mount_yaw_rad
    measured = assessment.measured
    reached = assess.tool_in_base(plan, measured, yaw) if len(measured) else np.empty((0, 4, 4))
    return ReportInput(
        name=plan.name,
        started=f"{job.started:%Y-%m-%d %H:%M:%S}",
        outcome=outcome.outcome,
        cause=outcome.cause,
        emulated=bool(job.cell.emulated_devices),
        duration_s=_duration_s(outcome),
        planned_s=plan.duration_s,
        t_s=np.array(rows.t_s),
        required_deg=assess.required(plan, measured) if len(measured) else np.empty((0, 9)),
        measured_deg=measured,
        tool_required_mm=1000.0 * plan.tool[:, :3, 3],
        tool_reached_mm=1000.0 * reached[:, :3, 3],
        tracking=assessment.tracking,
        points=assessment.points,
        skew=assessment.skew,
        trace=assessment.trace,
        notes=plan.notes,
        events=tuple(_event(*entry) for entry in events.history if entry[1] != KNOT_EDGE),
        files=tuple(sorted(item.name for item in folder.iterdir())),
    )


BAD_EVENTS = {
    "fault",
    "wrist lost",
    "board lost",
    "board reset",
    "standstill not seen",
    "disarm",
    "faulted",
}


def _event(t_s: float, name: str, fields: dict[str, Any]) -> Event:
    text = ", ".join(f"{key} {value}" for key, value in fields.items() if value not in ("", None))
    level = "error" if name in BAD_EVENTS else "info"
    return Event(t_s, level, f"{name}: {text}" if text else name)
