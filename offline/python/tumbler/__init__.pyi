"""Motions of robots with contact, found, looked at and played in simulation."""

import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

__version__: str

class FileError(ValueError):
    """A file that cannot be used. The whole message says what is wrong and what is allowed."""

    file: str
    line: int | None
    key: str | None

class RecordError(ValueError):
    """A flight record that cannot be used."""

class Refused(RuntimeError):
    """What was asked for is not done, although nothing is broken."""

class Evaluation(NamedTuple):
    """Values at times: of the times' shape, with one more dimension for the joints."""

    position_rad: npt.NDArray[Any]
    velocity_rad_s: npt.NDArray[Any]
    acceleration_rad_s2: npt.NDArray[Any]
    torque_nm: npt.NDArray[Any]

class Spline:
    """A clamped B-spline in the time since the motion began [s]. Its arrays are read-only views."""

    @property
    def degree(self) -> int: ...
    @property
    def knots_s(self) -> npt.NDArray[np.float64]: ...
    @property
    def control_points(self) -> npt.NDArray[np.float64]: ...
    def derivative_control_points(self, derivative: int) -> npt.NDArray[np.float64]: ...

class Joint:
    """The motion of one joint, and its limits."""

    @property
    def name(self) -> str: ...
    @property
    def position(self) -> Spline: ...
    @property
    def torque(self) -> Spline: ...
    @property
    def position_min_rad(self) -> float: ...
    @property
    def position_max_rad(self) -> float: ...
    @property
    def velocity_max_rad_s(self) -> float: ...
    @property
    def acceleration_max_rad_s2(self) -> float: ...
    @property
    def torque_max_nm(self) -> float: ...

class Primitive:
    """One motion of the robot's joints, as its file has it. Primitives are equal when their content_hash is."""

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Primitive: ...
    @staticmethod
    def parse(text: str, name: str = "text") -> Primitive: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def settle_s(self) -> float: ...
    @property
    def entry_tolerance_rad(self) -> float: ...
    @property
    def following_tolerance_rad(self) -> float: ...
    @property
    def joints(self) -> tuple[Joint, ...]: ...
    @property
    def content_hash(self) -> str: ...
    @property
    def maker(self) -> str: ...
    @property
    def text(self) -> str: ...
    def evaluate(self, times_s: npt.ArrayLike, dtype: npt.DTypeLike = "float64") -> Evaluation: ...

class Sequence:
    """Primitives, and how they may follow each other."""

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Sequence: ...
    @property
    def name(self) -> str: ...
    @property
    def primitives(self) -> dict[str, Primitive]: ...
    @property
    def nodes(self) -> dict[str, str]: ...
    @property
    def edges(self) -> tuple[tuple[str, str], ...]: ...
    @property
    def start(self) -> str: ...
    @property
    def branches(self) -> tuple[str, ...]: ...

class Task:
    """What is asked of a motion. Tasks never change, and are equal when their text and their robot's are."""

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Task: ...
    @staticmethod
    def from_toml(text: str, name: str = "task.toml", robot_text: str | None = None) -> Task: ...
    @staticmethod
    def from_values(values: Mapping[str, Any], name: str = "task.toml", robot_text: str | None = None) -> Task: ...
    def replace(self, changes: Mapping[str, Any] | None = None, robot_text: str | None = None, **keys: Any) -> Task: ...
    @property
    def name(self) -> str: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def settle_s(self) -> float: ...
    @property
    def seed(self) -> int: ...
    @property
    def joints(self) -> tuple[str, ...]: ...
    @property
    def parameters(self) -> int: ...
    @property
    def file(self) -> str: ...
    @property
    def robot_file(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def robot_text(self) -> str: ...
    @property
    def values(self) -> dict[str, Any]: ...
    @property
    def model(self) -> Model | SpaceModel: ...

class Derivatives(NamedTuple):
    """Of the results of g of a model (rows) by its arguments (columns), for each state."""

    q: npt.NDArray[np.float64]
    qd: npt.NDArray[np.float64]
    input: npt.NDArray[np.float64]

class Kinematics(NamedTuple):
    """The frames of all links in the world, for each state: x and z, and pitch from +x towards +z."""

    position_m: npt.NDArray[np.float64]
    pitch_rad: npt.NDArray[np.float64]
    velocity_m_s: npt.NDArray[np.float64]
    pitch_rate_rad_s: npt.NDArray[np.float64]

class SpaceKinematics(NamedTuple):
    """The frames of all links in the world, for each state: x, y, z and the unit quaternion w, x, y, z."""

    position_m: npt.NDArray[np.float64]
    quaternion: npt.NDArray[np.float64]
    velocity_m_s: npt.NDArray[np.float64]
    angular_velocity_rad_s: npt.NDArray[np.float64]

class Contacts(NamedTuple):
    """The contacts of all states that carry force, one in each entry, and each row of x and z (in space x, y, z)."""

    state: npt.NDArray[np.int64]
    shape: npt.NDArray[np.str_]
    touches: npt.NDArray[np.str_]
    depth_m: npt.NDArray[np.float64]
    normal_force_n: npt.NDArray[np.float64]
    point_m: npt.NDArray[np.float64]
    force_n: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]

class Model:
    """A task's robot on its ground, in the x-z plane. The last dimension of arrays is that of `coordinates`."""

    @property
    def task(self) -> Task: ...
    @property
    def coordinates(self) -> tuple[str, ...]: ...
    @property
    def prescribed(self) -> tuple[bool, ...]: ...
    @property
    def links(self) -> tuple[str, ...]: ...
    @property
    def mass_kg(self) -> float: ...
    @property
    def start(self) -> npt.NDArray[np.float64]: ...
    def g(
        self,
        q: npt.ArrayLike,
        qd: npt.ArrayLike | None = None,
        input: npt.ArrayLike | None = None,
        *,
        contact: bool = True,
    ) -> npt.NDArray[np.float64]: ...
    def dg(
        self,
        q: npt.ArrayLike,
        qd: npt.ArrayLike | None = None,
        input: npt.ArrayLike | None = None,
        *,
        contact: bool = True,
    ) -> Derivatives: ...
    def kinematics(self, q: npt.ArrayLike, qd: npt.ArrayLike | None = None) -> Kinematics: ...
    def contacts(self, q: npt.ArrayLike, qd: npt.ArrayLike | None = None) -> Contacts: ...

class SpaceModel:
    """A task's robot on its ground, in space. The root's angles are from `quaternion`; None: from that of the start."""

    @property
    def task(self) -> Task: ...
    @property
    def coordinates(self) -> tuple[str, ...]: ...
    @property
    def prescribed(self) -> tuple[bool, ...]: ...
    @property
    def links(self) -> tuple[str, ...]: ...
    @property
    def mass_kg(self) -> float: ...
    @property
    def start(self) -> npt.NDArray[np.float64]: ...
    @property
    def start_quaternion(self) -> npt.NDArray[np.float64]: ...
    def g(
        self,
        q: npt.ArrayLike,
        qd: npt.ArrayLike | None = None,
        input: npt.ArrayLike | None = None,
        *,
        quaternion: npt.ArrayLike | None = None,
        contact: bool = True,
    ) -> npt.NDArray[np.float64]: ...
    def dg(
        self,
        q: npt.ArrayLike,
        qd: npt.ArrayLike | None = None,
        input: npt.ArrayLike | None = None,
        *,
        quaternion: npt.ArrayLike | None = None,
        contact: bool = True,
    ) -> Derivatives: ...
    def kinematics(
        self, q: npt.ArrayLike, qd: npt.ArrayLike | None = None, *, quaternion: npt.ArrayLike | None = None
    ) -> SpaceKinematics: ...
    def contacts(
        self, q: npt.ArrayLike, qd: npt.ArrayLike | None = None, *, quaternion: npt.ArrayLike | None = None
    ) -> Contacts: ...

class Record(dict[str, npt.NDArray[Any]]):
    """A flight record: every tick of a run, as read-only columns with units in their names."""

    def __init__(
        self, columns: dict[str, npt.NDArray[Any]], truth: dict[str, npt.NDArray[Any]], about: Mapping[str, Any]
    ) -> None: ...
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Record: ...
    @property
    def name(self) -> str: ...
    @property
    def joints(self) -> tuple[str, ...]: ...
    @property
    def period_s(self) -> float: ...
    @property
    def remarks(self) -> list[str]: ...
    @property
    def complete(self) -> bool: ...
    @property
    def summary(self) -> str: ...
    @property
    def columns(self) -> dict[str, npt.NDArray[Any]]: ...
    @property
    def truth(self) -> dict[str, npt.NDArray[Any]]: ...

class Progress(NamedTuple):
    """One evaluation of a search for a motion: in stage 'search' or 'solve'."""

    stage: str
    start: int
    evaluations: int
    cost: float
    violation: float

class Outcome:
    """What came of a task."""

    @property
    def status(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def primitive(self) -> Primitive | None: ...
    @property
    def cost(self) -> float | None: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def wall_s(self) -> float: ...
    @property
    def cpu_s(self) -> float: ...

class Run:
    """A run on the simulated robot."""

    @property
    def record(self) -> Record: ...
    @property
    def outcome(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def as_asked(self) -> bool | None: ...
    @property
    def summary(self) -> dict[str, Any]: ...

class RobustnessMap:
    """What became of robots that are not the model, one in each row."""

    @property
    def verdicts(self) -> npt.NDArray[np.str_]: ...
    @property
    def stands(self) -> npt.NDArray[np.bool_]: ...
    @property
    def judged(self) -> npt.NDArray[np.bool_]: ...
    @property
    def reasons(self) -> tuple[str, ...]: ...
    @property
    def left_s(self) -> npt.NDArray[np.float64]: ...
    @property
    def parameters(self) -> list[str]: ...
    @property
    def sigma(self) -> npt.NDArray[np.float64]: ...
    @property
    def share(self) -> float: ...
    @property
    def share_95(self) -> tuple[float, float]: ...
    @property
    def summary(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...

def check(path: str | os.PathLike[str]) -> str: ...
def optimise(
    task: str | os.PathLike[str] | Task,
    *,
    seed: int | None = None,
    threads: int = 0,
    progress: Callable[[Progress], bool | None] | None = None,
    keep_best: bool = False,
    start_from: str | os.PathLike[str] | None = None,
    guess: Primitive | None = None,
) -> Outcome: ...
def simulate(
    motion: str | os.PathLike[str] | Primitive,
    *,
    cycles: int = 0,
    branch: str = "",
    from_node: str = "",
    get_ups: int = 0,
    speed: float = 1.0,
    hold_s: float = 2.0,
    twin: str | os.PathLike[str] | None = None,
    drives: str | os.PathLike[str] | None = None,
    faults: str | os.PathLike[str] | None = None,
    bus_faults: str | os.PathLike[str] | None = None,
    record: str | os.PathLike[str] | None = None,
) -> Run: ...
def robustness(
    motion: str | os.PathLike[str] | Primitive,
    *,
    robots: int = 100,
    cycles: int = 0,
    branch: str = "",
    seed: int = 1,
    scale: float = 1.0,
    spreads: Mapping[str, float | Mapping[str, float]] = {},
    hold_s: float | None = None,
    get_ups: int = 0,
    drives: str | os.PathLike[str] | None = None,
    twin: str | os.PathLike[str] | None = None,
    lanes: bool = False,
    threads: int = 0,
    progress: Callable[[int], bool | None] | None = None,
    period_s: float | None = None,
) -> RobustnessMap: ...
