"""What notebooks show of the package's objects."""

import html

import numpy as np

_MOST_ROWS = 8


def _cell(value):
    return html.escape(f"{value:.6g}" if isinstance(value, (float, np.floating)) else str(value))


def _table(head, rows):
    cells = lambda tag, row: "".join(f"<{tag}>{_cell(value)}</{tag}>" for value in row)
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table><thead><tr>{cells('th', head)}</tr></thead><tbody>{body}</tbody></table>"


def _titled(title, *parts):
    return f"<div><strong>{_cell(title)}</strong>{''.join(parts)}</div>"


def _facts(title, facts):
    return _titled(title, _table(("", ""), facts))


def _paths(primitive):
    """A picture of the joints' paths over time."""
    width, height = 480, 120
    times = np.linspace(0, primitive.duration_s, 121)
    position = primitive.evaluate(times).position_rad
    low, high = position.min(), position.max()
    y = height - 4 - (height - 8) * (position - low) / max(high - low, 1e-9)
    x = times / primitive.duration_s * width
    lines = "".join(
        f'<polyline fill="none" stroke="hsl({137 * j % 360} 60% 45%)" stroke-width="1.5" '
        f'points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y[:, j]))}">'
        f"<title>{_cell(joint.name)}</title></polyline>"
        for j, joint in enumerate(primitive.joints)
    )
    scale = f"<div>{low:.3g} ... {high:.3g} rad over {primitive.duration_s:.3g} s</div>"
    box = f'style="display:block" width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
    return f"<svg {box}>{lines}</svg>{scale}"


def _primitive(self):
    head = ("joint", "from [rad]", "to [rad]", "limits [rad]", "limit [rad/s]", "limit [N m]")
    ends = self.evaluate([0, self.duration_s]).position_rad
    rows = []
    for i, joint in enumerate(self.joints):
        limits = f"{joint.position_min_rad:.4g} ... {joint.position_max_rad:.4g}"
        rows.append((joint.name, *ends[:, i], limits, joint.velocity_max_rad_s, joint.torque_max_nm))
    return _titled(f"Primitive {self.name}, {self.duration_s:.6g} s", _paths(self), _table(head, rows))


def _joint(self):
    facts = [
        ("limits [rad]", f"{self.position_min_rad:.6g} ... {self.position_max_rad:.6g}"),
        ("limit [rad/s]", self.velocity_max_rad_s),
        ("limit [rad/s^2]", self.acceleration_max_rad_s2),
        ("limit [N m]", self.torque_max_nm),
    ]
    return _facts(f"Joint {self.name}", facts)


def _spline(self):
    facts = [("knots [s]", self.knots_s), ("control points", self.control_points)]
    return _facts(f"Spline of degree {self.degree}", facts)


def _sequence(self):
    followers = {node: [to for start, to in self.edges if start == node] for node in self.nodes}
    rows = [(node, primitive, ", ".join(followers[node])) for node, primitive in self.nodes.items()]
    return _titled(f"Sequence {self.name}, from {self.start}", _table(("node", "plays", "then"), rows))


def _task(self):
    facts = [
        ("robot", self.robot_file),
        ("duration [s]", self.duration_s),
        ("joints", ", ".join(self.joints)),
        ("parameters", self.parameters),
        ("seed", self.seed),
    ]
    return _facts(f"Task {self.name}", facts)


def _model(self):
    rows = zip(self.coordinates, ("prescribed" if p else "free" for p in self.prescribed), map(float, self.start))
    return _titled(f"Model of {self.task.name}", _table(("coordinate", "", "at the start"), rows))


def _outcome(self):
    facts = [("cost", self.cost), ("evaluations", self.evaluations), ("time [s]", self.wall_s)]
    motion = "" if self.primitive is None else _primitive(self.primitive)
    reason = f"<div>{_cell(self.reason)}</div>" if self.reason else ""
    return _titled(f"Outcome: {self.status}", reason, _table(("", ""), facts), motion)


def _run(self):
    asked = {True: "as asked", False: "not as asked", None: "not judged"}[self.as_asked]
    facts = [("the robot was", asked), ("reason", self.reason), ("ticks", len(self.record["tick"]))]
    return _facts(f"Run: {self.outcome}", [fact for fact in facts if fact[1] != ""])


def _record(self):
    names = list(self)
    length = len(self[names[0]]) if names else 0
    rows = [[self[name][i] for name in names] for i in range(min(length, _MOST_ROWS))]
    more = f"<div>{length} ticks, {len(names)} columns</div>"
    return _titled(f"Record {self.name}", f'<div style="overflow-x:auto">{_table(names, rows)}</div>', more)


def _robustness(self):
    verdicts, counts = np.unique(self.verdicts, return_counts=True)
    low, high = self.share_95
    share = "none was judged"
    if self.judged.any():
        share = f"{self.share:.1%} of those judged stand (95 %: {low:.1%} ... {high:.1%})"
    return _titled(f"{len(self)} robots: {share}", _table(("verdict", "robots"), zip(verdicts, counts)))


_SHOWN = {
    "Joint": _joint,
    "Model": _model,
    "Outcome": _outcome,
    "Primitive": _primitive,
    "Record": _record,
    "RobustnessMap": _robustness,
    "Run": _run,
    "Sequence": _sequence,
    "SpaceModel": _model,
    "Spline": _spline,
    "Task": _task,
}


def add_html(cls):
    """Lets notebooks show objects of a class of the package as tables."""
    cls._repr_html_ = _SHOWN[cls.__name__]
