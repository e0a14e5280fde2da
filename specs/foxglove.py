"""The layout with which Foxglove shows a live run or a recording, made from the signals.

Plots are by unit: what an engineer compares has one axis.  All of them read the topic `/tick`, which a live
run and a recording share.
"""

import json
from typing import Any

from specs import urdf
from specs.signals import definition

TARGETS, SURROUNDINGS, MOVING, PLAN, MACHINE = SCENES = (  # topics of foxglove.SceneUpdate
    "/scene", "/surroundings", "/moving", "/plan", "/machine",
)  # fmt: skip
MODEL = "package://slewright/machine.urdf"
MADE = "Generated from specs/signals.toml by slewright generate; do not edit."
PLOTS = (  # title, names of signals
    ("joint angles [rad]", ("q_slew", "q_boom", "q_stick")),
    ("tool angles [rad]", ("imu_tool_roll", "imu_tool_pitch")),
    ("joint velocities [rad/s]", ("qd_slew", "qd_boom", "qd_stick")),
    ("commands [1]", ("u_slew", "u_boom", "u_stick")),
    ("pressures [Pa]", tuple(n for n in definition().signals if n.startswith("p_"))),
)
COLORS = ("#4e79a7", "#f28e2b", "#e15759", "#76b7b2", "#59a14f", "#edc948", "#b07aa1", "#9c755f")


def layout() -> str:
    """The layout file: 3D beside the plots, log and mode below."""
    panels: dict[str, Any] = {"3D!machine": _machine(), "Log!log": {"topicToRender": "/log"}}
    plots = []
    for number, (title, names) in enumerate(PLOTS):
        plots.append(f"Plot!plot{number}")
        panels[plots[-1]] = _plot(title, names)
    panels["StateTransitions!mode"] = {
        "paths": [_path("control_mode"), _path("fault_code")],
        "isSynced": True,
    }
    below = _split("column", "3D!machine", _split("column", "StateTransitions!mode", "Log!log", 35), 60)
    found = {
        "_comment": MADE,
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", below, _stack(plots), 45),
    }
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


def _machine() -> dict[str, Any]:
    model = {
        "visible": True, "frameLocked": True, "label": "machine", "instanceId": "machine",
        "layerId": "foxglove.Urdf", "sourceType": "url", "url": MODEL, "order": 1,
    }  # fmt: skip
    grid = {"visible": True, "frameLocked": True, "label": "ground", "instanceId": "ground",
            "layerId": "foxglove.Grid", "size": 40, "divisions": 40, "order": 2}  # fmt: skip
    return {
        "layers": {"machine": model, "ground": grid},
        "followTf": urdf.BASE,
        "fixedFrame": urdf.BASE,
        "cameraState": {"distance": 40, "phi": 65, "thetaOffset": 45, "perspective": True, "fovy": 45},
        "topics": {topic: {"visible": True} for topic in SCENES},
    }


def _plot(title: str, names: tuple[str, ...]) -> dict[str, Any]:
    paths = [_path(name) | {"color": COLORS[i % len(COLORS)]} for i, name in enumerate(names)]
    return {"title": title, "paths": paths, "showLegend": True, "isSynced": True, "followingViewWidth": 30}


def _path(name: str) -> dict[str, Any]:
    return {"value": f"/tick.{name}", "enabled": True, "timestampMethod": "receiveTime", "label": name}


def _stack(panels: list[str]) -> Any:
    if len(panels) == 1:
        return panels[0]
    return _split("column", panels[0], _stack(panels[1:]), round(100 / len(panels)))


def _split(direction: str, first: Any, second: Any, percentage: int) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
