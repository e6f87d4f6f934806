"""A parameter study: handstands of five durations, in as many processes as there are cores.

usage: study.py [ROBOTS]    on which each is played; 100 unless given. Needs the Python module (docs/python.md).
"""

import concurrent.futures
import pathlib
import sys

import tumbler

PRIMITIVES = pathlib.Path(__file__).resolve().parents[2] / "primitives"


def study(task, known, robots):
    outcome = tumbler.optimise(task, guess=known, threads=1)
    if outcome.primitive is None:
        return f"no motion: {outcome.reason}"
    found = tumbler.robustness(outcome.primitive, robots=robots, lanes=True, threads=1)
    return f"cost {outcome.cost:.4g}, {found.share:.0%} of {len(found)} robots stand"


if __name__ == "__main__":
    robots = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    known = tumbler.Primitive.load(PRIMITIVES / "nominal/handstand.toml")
    base = tumbler.Task.load(PRIMITIVES / "tasks/nominal/handstand.toml")
    tasks = [base.replace(duration_s=duration_s) for duration_s in (0.6, 0.65, 0.7, 0.75, 0.8)]
    with concurrent.futures.ProcessPoolExecutor() as pool:
        for task, result in zip(tasks, pool.map(study, tasks, [known] * 5, [robots] * 5)):
            print(f"{task.duration_s} s: {result}")
