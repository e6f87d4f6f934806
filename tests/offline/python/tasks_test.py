"""Tasks that are made and changed in Python."""

import pathlib
import pickle
import re
import sys
import tomllib

import numpy as np
import support
import tumbler
from tumbler import _toml

TASK = support.PRIMITIVES / "tasks/nominal/handstand.toml"
NOMINAL = support.PRIMITIVES / "nominal"
ALL_TASKS = sorted(
    path
    for folder in (support.PRIMITIVES, support.ROOT / "tests/data/tasks")
    for path in folder.rglob("*.toml")
    if tomllib.loads(path.read_text()).get("format") == "tumbler-task"
)


class Texts(support.WithFolder):
    def test_of_all_tasks_values_become_texts_with_the_same_values(self):
        self.assertGreater(len(ALL_TASKS), 10)
        for path in ALL_TASKS:
            values = tomllib.loads(path.read_text())
            self.assertEqual(tomllib.loads(_toml.dumps(values)), values, path)

    def test_become_the_same_of_any_text_key_and_number(self):
        values = {
            "text": 'a "quoted"\\ line\nand\ttab\x01\x7f, ümläut, \U0001f938',
            "a key. of any kind": {"": 1, "ümläut": [True, False, []]},
            "numbers": [0, -1, 2**62, 0.1, 1e300, 5e-324, -0.0],
            "empty": {},
            "nested": [{"deep": {"deeper": [{"x": 1}, {}]}}, {}],
        }
        self.assertEqual(tomllib.loads(_toml.dumps(values)), values)

    def test_take_numpys_numbers_and_arrays(self):
        values = {"a": np.float64(0.1), "b": np.int64(3), "c": np.array([[1.0, 2.0]]), "d": (1, 2), "e": np.bool_(True)}
        expected = {"a": 0.1, "b": 3, "c": [[1.0, 2.0]], "d": [1, 2], "e": True}
        self.assertEqual(tomllib.loads(_toml.dumps(values)), expected)

    def test_refuse_what_toml_has_not(self):
        for values, where in (({"a": {"b": None}}, "a.b"), ({"a": [1, object()]}, "a.1"), ({"a": {1: 2}}, "a")):
            with self.assertRaisesRegex(TypeError, re.escape(where)):
                _toml.dumps(values)


class Made(support.WithFolder):
    def test_of_a_text_are_those_of_the_file(self):
        text = TASK.read_text()
        task = tumbler.Task.from_toml(text, name=str(TASK))
        self.assertEqual(task, tumbler.Task.load(TASK))
        self.assertEqual(task.robot_file, tumbler.Task.load(TASK).robot_file)

    def test_of_a_text_with_its_robot_need_no_file(self):
        loaded = tumbler.Task.load(TASK)
        task = tumbler.Task.from_toml(loaded.text, robot_text=loaded.robot_text)
        self.assertEqual(task, loaded)
        self.assertEqual((task.file, task.robot_file), ("task.toml", "robot_text"))

    def test_of_values_find_the_motion_of_the_file(self):
        loaded = tumbler.Task.load(TASK)
        made = tumbler.Task.from_values(loaded.values, robot_text=loaded.robot_text)
        self.assertEqual(made.values, loaded.values)
        guess = tumbler.Primitive.load(NOMINAL / "handstand.toml")
        found = [tumbler.optimise(task, guess=guess).primitive for task in (made, loaded)]
        self.assertEqual(found[0].joints, found[1].joints)

    def test_of_robots_in_space_are_tasks(self):
        task = tumbler.Task.load(support.PRIMITIVES / "solo8/tasks/walk.toml")
        self.assertEqual((task.name, len(task.joints)), ("walk", 8))
        self.assertEqual(task.replace(duration_s=1.0).duration_s, 1.0)
        self.assertEqual(pickle.loads(pickle.dumps(task)), task)
        self.assertEqual(tumbler.check(support.PRIMITIVES / "solo8/tasks/walk.toml"), "task")

    def test_have_errors_that_say_line_and_key_of_the_text(self):
        text = TASK.read_text().replace("duration_s = 0.65", "duration_s = -1")
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.Task.from_toml(text, name=str(TASK))
        line = next(i for i, l in enumerate(text.splitlines(), 1) if l.startswith("duration_s"))
        self.assertEqual((caught.exception.file, caught.exception.line), (str(TASK), line))
        self.assertEqual(caught.exception.key, "duration_s")

    def test_whose_robot_is_missing_say_where_it_was_looked_for(self):
        with self.assertRaisesRegex(tumbler.FileError, "task.toml:.*robot: .*does not exist"):
            tumbler.Task.from_toml(TASK.read_text())


class Replaced(support.WithFolder):
    def setUp(self):
        super().setUp()
        self.task = tumbler.Task.load(TASK)

    def test_numbers_leave_all_else_of_the_text_as_it_is(self):
        task = self.task.replace({"contact.mu": 0.45, "cost.1.weight": 2}, duration_s=0.7)
        expected = self.task.text.replace("mu = 0.3", "mu = 0.45").replace("weight = 0.01", "weight = 2.0")
        self.assertEqual(task.text, expected.replace("duration_s = 0.65", "duration_s = 0.7"))
        self.assertEqual(task.duration_s, 0.7)
        self.assertEqual((self.task.duration_s, self.task.values["contact"]["mu"]), (0.65, 0.3))

    def test_other_values_and_keys_change_nothing_but_themselves(self):
        weights = [{"term": "effort", "weight": 1.0}]
        task = self.task.replace({"limits.leg1.torque_max_nm": 2.0, "search.promising": None}, cost=weights, name="other")
        expected = self.task.values
        expected["limits"]["leg1"] = {"torque_max_nm": 2.0}
        del expected["search"]["promising"]
        expected["cost"] = weights
        expected["name"] = "other"
        self.assertEqual(task.values, expected)
        self.assertEqual(task.name, "other")
        self.assertEqual(task.robot_text, self.task.robot_text)

    def test_the_robot_by_its_text_or_by_the_name_of_another_file(self):
        heavier = re.sub(r'<mass value="([0-9.]+)"', lambda m: f'<mass value="{2 * float(m[1])}"', self.task.robot_text)
        self.assertNotEqual(heavier, self.task.robot_text)
        by_text = self.task.replace(robot_text=heavier)
        self.assertEqual((by_text.robot_text, by_text.text), (heavier, self.task.text))
        (self.folder / "heavier.urdf").write_text(heavier)
        by_name = self.task.replace(robot=str(self.folder / "heavier.urdf"))
        self.assertEqual(by_name.robot_text, heavier)
        self.assertEqual(pathlib.Path(by_name.robot_file), self.folder / "heavier.urdf")

    def test_values_that_the_task_cannot_have_are_errors_with_their_key(self):
        for changes, key in (
            ({"contact.mu": -1.0}, "contact.mu"),
            ({"contact.mue": 0.3}, "contact.mue"),
            ({"duration_s": float("nan")}, "duration_s"),
            ({"spline.degree": 3.5}, "spline.degree"),
        ):
            with self.assertRaises(tumbler.FileError) as caught:
                self.task.replace(changes)
            self.assertEqual(caught.exception.key, key)
            self.assertEqual(caught.exception.file, str(TASK))

    def test_what_is_not_there_cannot_be_taken_away_or_entered(self):
        for changes, message in (
            ({"contact.mue": None}, "contact.mue: is not there"),
            ({"cost.7.weight": 1.0}, "cost.7.weight: '7' is no entry of 3"),
            ({"duration_s.x": 1.0}, "duration_s.x: is below a value that is no table"),
        ):
            with self.assertRaisesRegex(ValueError, message):
                self.task.replace(changes)
        with self.assertRaisesRegex(ValueError, "leave one out"):
            self.task.replace({"duration_s": 1.0}, duration_s=1.0)

    def test_the_task_that_goes_on_from_another_motion_is_the_changed_one(self):
        roll = tumbler.Task.load(support.PRIMITIVES / "tasks/nominal/roll.toml").replace(name="changed")
        guess = tumbler.Primitive.load(NOMINAL / "roll.toml")
        outcome = tumbler.optimise(roll, start_from=NOMINAL / "handstand.toml", guess=guess)
        self.assertEqual((outcome.status, outcome.primitive.name), ("found", "changed"))


if __name__ == "__main__":
    support.main(sys.argv)
