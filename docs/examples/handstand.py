"""Finds a handstand, plays it in simulation and on robots that are not the model, and makes figures of all three.

usage: handstand.py FOLDER [--robots N]    PNG files go into FOLDER; N is 100 unless given

Needs the Python module (docs/python.md) and Matplotlib.
"""

import argparse
import pathlib

import matplotlib

matplotlib.use("Agg")  # No display is needed.
import matplotlib.pyplot as plt
import numpy as np

import tumbler

PRIMITIVES = pathlib.Path(__file__).resolve().parents[2] / "primitives"

# %% A motion for the task, found from nothing


def find():
    """The handstand of seed 3, and the best cost over the evaluations of the search."""
    costs = []

    def note(progress):
        if progress.stage == "solve" and progress.violation <= 1e-6:
            costs.append((progress.evaluations, progress.cost))

    outcome = tumbler.optimise(PRIMITIVES / "tasks/nominal/handstand.toml", seed=3, progress=note)
    if outcome.primitive is None:
        raise SystemExit(f"no motion was found: {outcome.reason}")
    return outcome, np.array(costs)


def draw_motion(outcome, costs):
    motion = outcome.primitive
    times = np.linspace(0, motion.duration_s, 600)
    values = motion.evaluate(times)
    figure, axes = plt.subplots(3, 1, figsize=(7, 8), layout="constrained")
    for j, joint in enumerate(motion.joints):
        color = f"C{j}"
        axes[0].plot(times, values.position_rad[:, j], color, label=joint.name)
        knots = joint.position.knots_s[joint.position.degree : -joint.position.degree]
        axes[0].plot(knots, motion.evaluate(knots).position_rad[:, j], color + "o", markersize=3)
        axes[1].plot(times, values.torque_nm[:, j], color, label=joint.name)
        for sign in (-1, 1):
            axes[1].axhline(sign * joint.torque_max_nm, color="0.6", linestyle=":", linewidth=1)
    axes[0].set(title=f"{motion.name}: paths with their knots, and feed-forward", ylabel="position [rad]")
    axes[1].set(xlabel="time [s]", ylabel="torque [N m], with its limits")
    axes[0].legend()
    axes[2].semilogy(costs[:, 0], np.minimum.accumulate(costs[:, 1]))
    axes[2].set(xlabel="evaluations of the solver", ylabel="best cost without a violation")
    return figure


# %% The same motion on the simulated robot


def draw_run(motion, run):
    record, truth = run.record, run.record.truth
    running = record["state"] == "running"
    begin_s = record["time_s"][running][0]
    figure, axes = plt.subplots(3, 1, figsize=(7, 8), sharex=True, layout="constrained")
    for j, joint in enumerate(record.joints):
        heard = record[f"{joint}_reply_age_ticks"] >= 0  # Before that, nothing is measured.
        time_s = record["time_s"][heard] - begin_s
        planned = record[f"{joint}_planned_position_rad"][heard]
        measured = record[f"{joint}_measured_position_rad"][heard]
        axes[0].plot(time_s, planned, f"C{j}--", linewidth=1)
        axes[0].plot(time_s, measured, f"C{j}", label=joint)
        axes[1].plot(time_s, 1e3 * (measured - planned), f"C{j}")
    axes[2].plot(truth["time_s"] - begin_s, np.degrees(truth["root_pitch_rad"]), "C2")
    last_s = motion.duration_s + 2
    axes[1].set(ylabel="measured - planned [mrad]")
    axes[0].set(title=f"{motion.name} in simulation: {run.outcome}", ylabel="position [rad]", xlim=(-0.2, last_s))
    axes[2].set(xlabel="time since the motion began [s]", ylabel="true pitch of the body [deg]")
    axes[0].legend()
    return figure


# %% Robots that differ from the model


def draw_robots(motion, robots):
    """Robots by the two parameters that those have most in common which do not stand."""
    influences = robots.summary["influences"]
    names = [influence["name"] for influence in influences[:2]] or robots.parameters[:2]
    x, y = (robots.sigma[:, robots.parameters.index(name)] for name in names)
    low, high = robots.share_95
    figure, axes = plt.subplots(figsize=(6.5, 6), layout="constrained")
    for verdict, marker, color in (
        ("stands", "o", "tab:green"),
        ("amiss", "s", "tab:orange"),
        ("fell", "x", "tab:red"),
        ("overlap", "^", "tab:purple"),
        ("fault", "*", "black"),
    ):
        chosen = robots.verdicts == verdict
        if chosen.any():
            axes.scatter(x[chosen], y[chosen], marker=marker, color=color, label=f"{verdict}: {chosen.sum()}")
    title = f"{motion.name}: {robots.share:.0%} of {len(robots)} robots do as asked (95 %: {low:.0%} ... {high:.0%})"
    axes.set(title=title, xlabel=f"{names[0]} [standard deviations]", ylabel=f"{names[1]} [standard deviations]")
    axes.axis("equal")
    axes.legend()
    return figure


# %% All of it


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--robots", type=int, default=100)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)

    outcome, costs = find()
    motion = outcome.primitive
    run = tumbler.simulate(motion)
    robots = tumbler.robustness(motion, robots=arguments.robots)
    figures = {
        "motion": draw_motion(outcome, costs),
        "run": draw_run(motion, run),
        "robots": draw_robots(motion, robots),
    }
    for name, figure in figures.items():
        figure.savefig(arguments.folder / f"{name}.png", dpi=110)
        print(arguments.folder / f"{name}.png")
    print(f"{motion.name}: cost {outcome.cost:.6g}, run {run.outcome}, {robots.stands.sum()} of {len(robots)} robots stand")


if __name__ == "__main__":
    main()
