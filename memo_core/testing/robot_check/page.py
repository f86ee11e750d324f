"""An HTML page about a robot: pictures, its reach, how its servos follow, what the tasks ask of it, and each rule."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment

from memo_core.errors import BackendUnavailable
from memo_core.testing.robot_check.trial import RobotTrial

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ name }}</title>
<style>
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 72em; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 1em 0 } td, th { text-align: left; padding: .2em .8em .2em 0 }
th { border-bottom: 1px solid #999 } td { border-bottom: 1px solid #eee; vertical-align: top }
td.number { text-align: right; font-variant-numeric: tabular-nums }
.broken { color: #a11 } .limited { color: #a60 } .kept { color: #172 } .skipped { color: #888 }
figure { display: inline-block; margin: 0 1em 1em 0 } figcaption { color: #666 } img { max-width: 100% }
</style></head><body>
<h1>{{ name }}</h1>
<p>{{ summary }}</p>
{% for one in causes %}<p class="{{ one.outcome }}"><b>{{ one.outcome }}</b>: {{ one.why }}</p>
{% else %}<p class="kept">Keeps every rule.</p>{% endfor %}
{% for title, picture in pictures %}
<figure><img alt="{{ title }}" src="data:image/png;base64,{{ picture }}"><figcaption>{{ title }}</figcaption></figure>
{% endfor %}{% for title, drawing in drawings %}
<figure>{{ drawing | safe }}<figcaption>{{ title }}</figcaption></figure>
{% endfor %}{% if no_pictures %}<p>No pictures: {{ no_pictures }}</p>{% endif %}
<h2>Joints</h2>
<p>Of turning joints; of slides in m, m/s, m/s2, N and kg.</p>
<table><tr><th>joint<th>limits, rad<th>home<th>rad/s<th>rad/s2<th>Nm<th>kp<th>kv<th>kg m2 moved<th>behind in a swing
</tr>{% for row in joints %}<tr>
{% for cell in row %}<td{% if not loop.first %} class="number"{% endif %}>{{ cell }}</td>{% endfor %}
</tr>{% endfor %}</table>
<h2>Gripper</h2>
<table>{% for key, value in gripper %}<tr><td>{{ key }}</td><td>{{ value }}</td></tr>{% endfor %}</table>
{% if tasks %}<h2>What the tasks grasp</h2>
<p>By inverse kinematics from above or from the front, seed 0, without obstacles: {{ reached }} of {{ grasped }}.</p>
<table><tr><th>task<th>grasped<th>out of reach</tr>
{% for one in tasks %}<tr><td>{{ one.task }}</td><td class="number">{{ one.grasped }}</td>
<td>{{ one.unreached | join(", ") }}</td></tr>{% endfor %}</table>{% endif %}
<h2>Rules</h2>
<table><tr><th>rule<th>outcome<th>why</tr>
{% for one in results %}<tr><td>{{ one.rule }}</td><td class="{{ one.outcome }}">{{ one.outcome }}</td>
<td>{{ one.why }}</td></tr>{% endfor %}</table>
</body></html>
"""


def write_robot_page(file: Path, name: str, summary: str, results: Sequence[Any], trial: RobotTrial | None) -> None:
    """Write the page. ``results`` are ``memo_core.testing.plugins.Result``; without a ``trial``, as where a static rule
    is broken, it holds those only. Raises ``OSError``."""
    causes = [one for wanted in ("broken", "limited") for one in results if one.outcome == wanted]
    values: dict[str, Any] = {"name": name, "summary": summary, "causes": causes, "results": results}
    if trial is not None:
        values |= _about(trial)
    file.write_text(Environment(autoescape=True).from_string(_PAGE).render(values), encoding="utf-8")


def _about(trial: RobotTrial) -> dict[str, Any]:
    robot, gripper = trial.robot, trial.robot.gripper
    swings = trial.tracked if not trial.held.problem else ()
    behind = {one.joint: f"{100 * one.error / one.amplitude:.1f} %" for one in swings if len(one.time)}
    joints = [
        (
            joint.name,
            f"{joint.lower:.3f} to {joint.upper:.3f}",
            f"{home:.3f}",
            f"{joint.velocity:g}",
            f"{joint.acceleration:g}",
            f"{joint.effort:g}",
            f"{joint.kp:g}",
            f"{joint.kv:g}",
            f"{inertia:.3g}",
            behind.get(joint.name, ""),
        )
        for joint, home, inertia in zip(robot.joints, robot.home, trial.inertias, strict=True)
    ]
    facts = [
        ("kind", gripper.kind),
        ("joints", ", ".join(gripper.finger_joints) or "none"),
        ("widest opening", f"{1000 * gripper.stroke:.0f} mm"),
        ("force", f"{gripper.min_force:g} to {gripper.max_force:g} N"),
        ("fingertips beyond the tool centre", f"{1000 * gripper.fingertip_reach:.0f} mm"),
        ("palm behind the tool centre", f"{1000 * gripper.palm_distance:.0f} mm"),
        ("hand, along and across the closing axis", " x ".join(f"{1000 * v:.0f}" for v in gripper.hand_size) + " mm"),
        ("gives way at home under 20 N straight down", f"{20000 * float(trial.compliance.sum()):.1f} mm"),
    ]
    pictures, problem = [], ""
    try:
        pictures = [(title, _png(picture)) for title, picture in trial.pictures().items()]
    except BackendUnavailable as error:
        problem = str(error)
    drawings = [("share of eight hand poses reached, seen from above (m; the darker the more)", _reach(trial))]
    if behind:
        drawings.append(("each joint's swing: wanted (grey) and reached", _swings(trial)))
    tasks = trial.task_reach
    grasped = sum(one.grasped for one in tasks)
    missed = sum(len(one.unreached) for one in tasks)
    return {
        "joints": joints,
        "gripper": facts,
        "pictures": pictures,
        "drawings": drawings,
        "no_pictures": problem,
        "tasks": tasks,
        "grasped": grasped,
        "reached": grasped - missed,
    }


def _png(picture: Any) -> str:
    """Raises ``BackendUnavailable`` without Pillow."""
    try:
        from PIL import Image
    except ImportError as error:
        raise BackendUnavailable("pictures", "pillow", str(error), "pip install pillow") from error
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "PNG")
    return base64.b64encode(buffer.getvalue()).decode()


def _reach(trial: RobotTrial) -> str:
    """SVG, seen from above: x (forward) upwards, y to the left, the base as a triangle."""
    xs, ys, share = trial.reach_map
    scale, cell = 260 / float(ys[-1] - ys[0]), float(ys[1] - ys[0])
    tall = float(xs[1] - xs[0])
    width, height = 320, int(scale * (float(xs[-1]) + tall) + 40)
    middle, ground = width / 2, height - 30
    parts = []
    for i, y in enumerate(ys):
        for j, x in enumerate(xs):
            left, top = middle - scale * (y + cell / 2), ground - scale * (x + tall / 2)
            colour = f"hsl(210 60% {95 - 60 * share[i, j]:.0f}%)"
            title = f"x {x:.2f}, y {y:.2f} m: {100 * share[i, j]:.0f} %"
            box = f'x="{left:.1f}" y="{top:.1f}" width="{scale * cell:.1f}" height="{scale * tall:.1f}"'
            parts.append(f'<rect {box} fill="{colour}"><title>{title}</title></rect>')
    parts.append(f'<path d="M{middle - 8} {ground} h16 l-8 -14 z"/>')
    for share_of in (0.5, 1.0):
        x = share_of * trial.robot.reach
        parts.append(f'<text x="2" y="{ground - scale * x:.0f}" font-size="11">x {x:.2f}</text>')
    return _svg(width, height, parts)


def _swings(trial: RobotTrial) -> str:
    """SVG, a row a joint: the wanted angle thick and grey, the reached one thin."""
    row, width = 46, 420
    parts = []
    tracked = [one for one in trial.tracked if len(one.time)]
    for number, one in enumerate(tracked):
        across, up = (width - 140) / one.time[-1], (row - 12) / (2 * max(one.amplitude, 1e-6))
        zero = row * number + row / 2
        parts.append(f'<text x="0" y="{zero:.0f}" font-size="11">{html.escape(one.joint)}</text>')
        for angles, style in ((one.wanted, 'stroke="#bbb" stroke-width="4"'), (one.reached, 'stroke="#14c"')):
            points = " ".join(
                f"{130 + across * t:.1f},{zero - up * max(-1.2 * one.amplitude, min(1.2 * one.amplitude, angle)):.1f}"
                for t, angle in zip(one.time, angles, strict=True)
            )
            parts.append(f'<polyline points="{points}" fill="none" {style}/>')
    return _svg(width, row * len(tracked) + 6, parts)


def _svg(width: int, height: int, parts: list[str]) -> str:
    size = f'width="{width}" height="{height}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(parts)}</svg>'
