"""Finding motions, and robots that are not the model, in Python against the programs."""

import json
import os
import pickle
import signal
import sys
import threading
import time

import numpy as np
import support
import tumbler

TASK = support.PRIMITIVES / "tasks/nominal/handstand.toml"
HANDSTAND = support.PRIMITIVES / "nominal/handstand.toml"


class Optimising(support.WithFolder):
    @classmethod
    def setUpClass(cls):
        cls.progress = []
        cls.threads = set()

        def note(progress):
            cls.progress.append(progress)
            cls.threads.add(threading.get_native_id())

        cls.outcome = tumbler.optimise(TASK, seed=1, threads=2, progress=note)

    def test_finds_what_the_program_finds_bit_for_bit(self):
        path = self.folder / "found.toml"
        self.run_program("tumbler optimize", TASK, "--seed", 1, "--threads", 2, "--out", path, "--quiet")
        self.assertEqual((self.outcome.status, self.outcome.reason), ("found", ""))
        program = tumbler.Primitive.load(path)
        for ours, theirs in zip(self.outcome.primitive.joints, program.joints):
            np.testing.assert_array_equal(ours.position.control_points, theirs.position.control_points)
            np.testing.assert_array_equal(ours.torque.control_points, theirs.torque.control_points)
        self.assertEqual(self.outcome.primitive.content_hash, program.content_hash)

    def test_tells_of_its_progress(self):
        self.assertEqual({p.stage for p in self.progress}, {"search", "solve"})
        counts = [p.evaluations for p in self.progress if p.stage == "search"]
        self.assertEqual(max(counts), len(counts))
        self.assertGreaterEqual(self.outcome.evaluations, max(counts))
        self.assertNotIn(threading.get_native_id(), self.threads)

    def test_an_exception_of_the_progress_ends_it_and_is_raised(self):
        calls = []

        def fail(progress):
            calls.append(progress)
            raise LookupError("enough")

        with self.assertRaisesRegex(LookupError, "enough"):
            tumbler.optimise(TASK, threads=2, progress=fail)
        self.assertEqual(len(calls), 1)

    def test_a_progress_that_returns_false_ends_it(self):
        outcome = tumbler.optimise(TASK, threads=1, progress=lambda p: p.evaluations < 10)
        self.assertEqual(outcome.status, "interrupted")
        self.assertIsNone(outcome.primitive)
        self.assertLess(outcome.evaluations, self.outcome.evaluations)

    def test_control_c_ends_it_and_others_run_meanwhile(self):
        begun = threading.Event()

        def interrupt():  # It would never run if the lock were kept.
            begun.wait(60)
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=interrupt, daemon=True).start()
        with self.assertRaises(KeyboardInterrupt):
            tumbler.optimise(TASK, threads=1, progress=lambda _: begun.set())
            time.sleep(60)  # If the task was done first.

    def test_a_guess_takes_the_place_of_the_search(self):
        stages = []
        outcome = tumbler.optimise(
            tumbler.Task.load(TASK), guess=self.outcome.primitive, progress=lambda p: stages.append(p.stage)
        )
        self.assertEqual(outcome.status, "found")
        self.assertNotIn("search", stages)
        with self.assertRaises(ValueError):
            tumbler.optimise(TASK, guess=self.outcome.primitive, seed=2)

    def test_what_it_cannot_use_is_an_error(self):
        with self.assertRaises(ValueError):
            tumbler.optimise(TASK, seed=-1)
        with self.assertRaises(ValueError):
            tumbler.optimise(TASK, threads=-1)
        task = self.folder / "task.toml"
        task.write_text(TASK.read_text().replace("duration_s", "duraton_s"))
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.optimise(task)
        self.assertEqual(caught.exception.file, str(task))


class Tasks(support.WithFolder):
    def test_have_names_and_the_values_of_their_file(self):
        task = tumbler.Task.load(TASK)
        self.assertEqual((task.name, task.joints), ("handstand", ("leg1", "leg2")))
        self.assertEqual(task.duration_s, task.values["duration_s"])
        self.assertEqual(task.text, TASK.read_text())
        self.assertGreater(task.parameters, 0)

    def test_errors_of_the_robot_are_about_its_file(self):
        task, robot = self.folder / "task.toml", self.folder / "robot.urdf"
        robot.write_text("<robot name='r'>\n<link/>\n</robot>")
        values = tumbler.Task.load(TASK).values
        task.write_text(TASK.read_text().replace(values["robot"], "robot.urdf"))
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.check(task)
        self.assertEqual(os.path.basename(caught.exception.file), "robot.urdf")


class Robustness(support.WithFolder):
    def test_has_the_robots_of_the_program(self):
        path = self.folder / "map.json"
        self.run_program("tumbler robustness", HANDSTAND, "--robots", 12, "--scale", 1, "--json", path)
        program = json.loads(path.read_text())
        got = tumbler.robustness(HANDSTAND, robots=12, scale=1.0)
        self.assertEqual(len(got), 12)
        self.assertEqual(got.summary, {**program, "motion": got.summary["motion"]})
        self.assertGreater(program["as_asked"], 0)
        self.assertGreater(len(program["not_as_asked"]), 0)
        self.assertEqual((got.stands.dtype, int(got.stands.sum())), (np.bool_, program["as_asked"]))
        self.assertEqual(got.share, program["share"])
        self.assertEqual(got.share_95, (program["share_95_low"], program["share_95_high"]))
        for robot in program["not_as_asked"]:
            index = robot["index"]
            self.assertEqual(got.verdicts[index], robot["verdict"])
            self.assertEqual(got.reasons[index], robot["reason"])
            self.assertEqual(dict(zip(got.parameters, got.sigma[index])), robot["sigma"])
            left = got.left_s[index]
            self.assertEqual(-1 if np.isnan(left) else left, robot["left_s"])

    def test_of_a_motion_that_is_for_nothing_judges_no_robot(self):
        arm = tumbler.optimise(support.ROOT / "tests/data/tasks/arm.toml").primitive
        got = tumbler.robustness(arm, robots=3)
        self.assertEqual(list(got.verdicts), 3 * ["not judged"])
        self.assertFalse(got.judged.any() or got.stands.any())
        self.assertTrue(np.isnan(got.share))
        self.assertIsNone(got.summary["share"])
        self.assertIsNone(tumbler.simulate(arm).as_asked)

    def test_of_a_primitive_that_python_holds_is_that_of_its_file(self):
        primitive = tumbler.Primitive.load(HANDSTAND)
        told = []
        got = tumbler.robustness(primitive, robots=3, seed=5, spreads={"mass": 0.3}, progress=told.append)
        again = tumbler.robustness(HANDSTAND, robots=3, seed=5, spreads={"mass": 0.3}, threads=1)
        np.testing.assert_array_equal(got.sigma, again.sigma)
        np.testing.assert_array_equal(got.verdicts, again.verdicts)
        self.assertEqual(got.summary["spreads"]["mass"], 0.3)
        self.assertEqual(told[-1], 3)

    def test_takes_ranges_of_the_ground(self):
        spreads = {"mass": 0.0, "friction": {"from": 0.2, "to": 0.4}, "stiffness": {"factor": 2}}
        got = tumbler.robustness(HANDSTAND, robots=3, seed=5, spreads=spreads, lanes=True)
        self.assertEqual(got.summary["spreads"]["friction"], {"from": 0.2, "to": 0.4})
        self.assertEqual(got.summary["spreads"]["stiffness"], {"factor": 2})
        for wrong in ({"from": 0.4, "to": 0.2}, {"from": 0.2}, {"factor": 1}, {"factor": 2, "to": 3}, 1.5):
            with self.assertRaises(ValueError):
                tumbler.robustness(HANDSTAND, robots=3, spreads={"friction": wrong})
        for wrong in ({"friction": "some"}, {"friction": {"factor": "ten"}}, {"mass": {"factor": 2}}):
            with self.assertRaises(TypeError):
                tumbler.robustness(HANDSTAND, robots=3, spreads=wrong)

    def test_stops_when_its_progress_fails_or_says_so(self):
        def fail(known):
            raise LookupError("enough")

        with self.assertRaises(LookupError):
            tumbler.robustness(HANDSTAND, robots=100000, progress=fail)
        with self.assertRaises(tumbler.Refused):
            tumbler.robustness(HANDSTAND, robots=100000, progress=lambda known: False)

    def test_in_space_is_what_the_program_finds(self):
        solo8 = support.PRIMITIVES / "solo8/walk.toml"
        path = self.folder / "robots.json"
        self.run_program("tumbler robustness", solo8, "--robots", 4, "--scale", 2, "--json", path)
        got = tumbler.robustness(solo8, robots=4, scale=2.0)
        self.assertEqual(got.summary, json.loads(path.read_text()))
        self.assertEqual(int(got.stands.sum()), got.summary["as_asked"])
        self.assertEqual(got.sigma.shape, (4, len(got.parameters)))
        self.assertEqual([bool(reason) for reason in got.reasons], [not stands for stands in got.stands])
        self.assertEqual(got, pickle.loads(pickle.dumps(got)))
        for name, value in {"lanes": True, "get_ups": 1, "drives": "drives.toml", "twin": "twin.toml"}.items():
            with self.assertRaisesRegex(ValueError, f"{name}: is for motions in the plane so far"):
                tumbler.robustness(solo8, robots=1, **{name: value})
        with self.assertRaisesRegex(ValueError, "period_s: is for motions of robots in space"):
            tumbler.robustness(HANDSTAND, robots=1, period_s=0.002)

    def test_refuses_what_it_does_not_know(self):
        for arguments in (
            {"spreads": {"mas": 1}},
            {"spreads": {"mass": 2.0}},
            {"spreads": {"mass": np.nan}},
            {"robots": 0},
            {"cycles": 1},
            {"scale": np.nan},
        ):
            with self.assertRaises(ValueError):
                tumbler.robustness(HANDSTAND, **arguments)


if __name__ == "__main__":
    support.main(sys.argv)
