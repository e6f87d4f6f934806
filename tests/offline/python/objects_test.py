"""What all objects of the module have in common: they are pickled, copied, compared and shown in notebooks."""

import collections.abc
import concurrent.futures
import copy
import html.parser
import inspect
import multiprocessing
import pickle
import re
import sys

import numpy as np
import pandas
import support
import tumbler

NOMINAL = support.PRIMITIVES / "nominal"
HANDSTAND = NOMINAL / "handstand.toml"
TASK = support.PRIMITIVES / "tasks/nominal/handstand.toml"


def check_in_other_process(path):
    return tumbler.check(path)


class Balanced(html.parser.HTMLParser):
    """Finds whether all elements are closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.texts = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


class Objects(support.WithFolder):
    @classmethod
    def setUpClass(cls):
        primitive = tumbler.Primitive.load(HANDSTAND)
        task = tumbler.Task.load(TASK)
        run = tumbler.simulate(primitive)
        cls.objects = [
            primitive,
            primitive.joints[1],
            primitive.joints[0].position,
            primitive.joints[1].torque,
            tumbler.Sequence.load(NOMINAL / "gait.toml"),
            task,
            task.model,
            tumbler.optimise(TASK, guess=primitive, threads=1),
            run,
            run.record,
            tumbler.robustness(HANDSTAND, robots=4, lanes=True),
            tumbler.Task.load(support.PRIMITIVES / "solo8/tasks/walk.toml").model,
        ]

    def test_are_of_every_class(self):
        tuples = {"Contacts", "Derivatives", "Evaluation", "Kinematics", "Progress", "SpaceKinematics"}
        classes = {name for name in tumbler.__all__ if inspect.isclass(getattr(tumbler, name))}
        errors = {name for name in classes if issubclass(getattr(tumbler, name), Exception)}
        self.assertEqual({type(o).__name__ for o in self.objects}, classes - errors - tuples)

    def test_are_equal_after_pickling_and_copying_and_to_nothing_else(self):
        for one in self.objects:
            self.assertEqual(type(one).__module__, "tumbler")
            for protocol in (2, pickle.HIGHEST_PROTOCOL):
                self.assertEqual(pickle.loads(pickle.dumps(one, protocol)), one)
            for copied in (copy.copy(one), copy.deepcopy(one)):
                self.assertIs(type(copied), type(one))
                self.assertTrue(copied == one and not copied != one, one)
            for other in self.objects:
                if other is not one:
                    self.assertFalse(one == other, (one, other))
            self.assertNotEqual(one, "text")

    def test_have_hashes_that_agree_with_equality_where_they_have_any(self):
        for one in self.objects:
            try:
                number = hash(one)
            except TypeError:
                continue
            self.assertEqual(hash(pickle.loads(pickle.dumps(one))), number)
        self.assertEqual(len({tumbler.Task.load(TASK), tumbler.Task.load(TASK)}), 1)
        self.assertEqual(len({tumbler.Primitive.load(HANDSTAND), tumbler.Primitive.load(HANDSTAND)}), 1)

    def test_differ_when_a_number_does(self):
        task = tumbler.Task.load(TASK)
        self.assertNotEqual(task, task.replace(duration_s=0.66))
        self.assertNotEqual(task.model, task.replace(duration_s=0.66).model)
        first = tumbler.Primitive.load(HANDSTAND)
        second = tumbler.Primitive.load(NOMINAL / "roll.toml")
        self.assertNotEqual(first, second)
        self.assertNotEqual(first.joints[0], second.joints[0])
        self.assertNotEqual(first.joints[0].position, first.joints[1].position)
        maps = [tumbler.robustness(HANDSTAND, robots=4, lanes=True, seed=seed) for seed in (1, 2)]
        self.assertNotEqual(*maps)

    def test_keep_all_their_numbers_in_a_pickle(self):
        for one in self.objects:
            other = pickle.loads(pickle.dumps(one))
            for name, member in inspect.getmembers(type(one)):
                if name.startswith("_") or not inspect.isdatadescriptor(member):
                    continue
                ours, theirs = getattr(one, name), getattr(other, name)
                if name == "truth" or name == "columns":
                    self.assertEqual(list(ours), list(theirs))
                elif isinstance(ours, np.ndarray):
                    np.testing.assert_array_equal(ours, theirs, name)
                    self.assertEqual((ours.dtype, ours.flags.writeable), (theirs.dtype, theirs.flags.writeable), name)
                else:
                    self.assertEqual(ours, theirs, name)

    def test_show_themselves_in_notebooks_as_closed_elements(self):
        for one in self.objects:
            shown = Balanced(one._repr_html_())
            self.assertEqual(shown.open, [], one)
            self.assertTrue(any(text.strip() for text in shown.texts), one)
            self.assertNotRegex(one._repr_html_(), "object at")

    def test_names_of_files_are_text_in_notebooks(self):
        loaded = tumbler.Task.load(TASK)
        folder = self.folder / "<script>"
        folder.mkdir()
        (folder / "robot.urdf").write_text(loaded.robot_text)
        shown = loaded.replace(robot=str(folder / "robot.urdf"))._repr_html_()
        self.assertNotIn("<script>", shown)
        self.assertIn("&lt;script&gt;", shown)

    def test_pass_to_other_processes_with_the_functions_and_their_errors(self):
        bad = self.folder / "bad.toml"
        bad.write_text(TASK.read_text())  # From here its robot is not found.
        with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            self.assertEqual(pool.submit(tumbler.check, str(HANDSTAND)).result(), "primitive")
            self.assertEqual(pool.submit(tumbler.simulate, self.objects[0]).result(), self.objects[8])
            with self.assertRaises(tumbler.FileError) as caught:
                pool.submit(tumbler.check, str(bad)).result()
        self.assertEqual((caught.exception.file, caught.exception.key), (str(bad), "robot"))
        self.assertGreater(caught.exception.line, 1)


class Records(support.WithFolder):
    @classmethod
    def setUpClass(cls):
        cls.record = tumbler.simulate(HANDSTAND).record

    def test_are_mappings_that_pandas_takes(self):
        record = self.record
        self.assertIsInstance(record, collections.abc.Mapping)
        frame = pandas.DataFrame(record)
        self.assertEqual(list(frame.columns), list(record))
        self.assertEqual(len(frame), len(record["tick"]))
        for name in record:
            np.testing.assert_array_equal(frame[name].to_numpy(), record[name], name)
        self.assertEqual(len(pandas.DataFrame(record.truth)), len(record.truth["time_s"]))

    def test_cannot_be_changed(self):
        record = tumbler.simulate(HANDSTAND).record
        for change in (
            lambda: record.__setitem__("tick", 1),
            lambda: record.__delitem__("tick"),
            lambda: record.update(tick=1),
            lambda: record.pop("tick"),
            lambda: record.popitem(),
            lambda: record.setdefault("new", 1),
            lambda: record.clear(),
            lambda: record.__ior__({"tick": 1}),
        ):
            with self.assertRaisesRegex(TypeError, "read-only"):
                change()
        with self.assertRaises(ValueError):
            record["tick"][0] = 1
        with self.assertRaises(ValueError):
            pickle.loads(pickle.dumps(record)).truth["time_s"][0] = 1
        record.truth.clear()  # of a dictionary of one's own
        self.assertEqual(record, self.record)

    def test_differ_when_one_number_does(self):
        columns = dict(self.record)
        columns["tick"] = columns["tick"].copy()
        same = tumbler.Record(dict(columns), self.record.truth, {"name": "same"})
        self.assertEqual(same, self.record)
        columns["tick"] = columns["tick"].copy()
        columns["tick"][5] += 1
        self.assertNotEqual(tumbler.Record(columns, self.record.truth, {"name": "other"}), self.record)


class Package(support.WithFolder):
    def test_says_its_version(self):
        said = self.run_program("tumbler run", "--version")
        self.assertRegex(said, rf"\b{re.escape(tumbler.__version__)}\b")


if __name__ == "__main__":
    support.main(sys.argv)
