"""Primitives and sequences in Python, against the executor, SciPy and the programs."""

import csv
import gc
import os
import sys

import numpy as np
import scipy.interpolate
import support
import tumbler


def load(name):
    return tumbler.Primitive.load(support.PRIMITIVES / name)


def some_times(primitive):
    return np.random.default_rng(1).uniform(0, primitive.duration_s, 200)


class Primitives(support.WithFolder):
    def test_have_name_duration_joints_and_limits(self):
        primitive = load("handstand.toml")
        self.assertEqual((primitive.name, primitive.duration_s), ("handstand", 0.723))
        self.assertEqual([joint.name for joint in primitive.joints], ["leg1", "leg2"])
        for joint in primitive.joints:
            points = joint.position.control_points
            self.assertTrue(np.all(points >= joint.position_min_rad))
            self.assertTrue(np.all(points <= joint.position_max_rad))
            self.assertTrue(np.all(abs(joint.position.derivative_control_points(1)) <= joint.velocity_max_rad_s))

    def test_arrays_are_read_only_views_of_one_object(self):
        joint = load("handstand.toml").joints[0]
        first, second = joint.position.control_points, joint.position.control_points
        self.assertEqual(first.ctypes.data, second.ctypes.data)
        self.assertFalse(first.flags.owndata)
        for attempt in (lambda: first.__setitem__(0, 1.0), lambda: first.setflags(write=True)):
            with self.assertRaises(ValueError):
                attempt()

    def test_an_array_outlives_the_names_of_its_primitive(self):
        points = load("handstand.toml").joints[1].torque.control_points
        expected = points.copy()
        gc.collect()
        for _ in range(20):  # What was freed would be used again.
            load("handstand.toml")
        np.testing.assert_array_equal(points, expected)

    def test_evaluate_agrees_with_scipy_to_rounding(self):
        primitive = load("handstand.toml")
        times = some_times(primitive)
        got = primitive.evaluate(times)
        for j, joint in enumerate(primitive.joints):
            path = joint.position
            oracle = scipy.interpolate.BSpline(path.knots_s.copy(), path.control_points.copy(), path.degree)
            torque = joint.torque
            feed_forward = scipy.interpolate.BSpline(torque.knots_s.copy(), torque.control_points.copy(), torque.degree)
            for values, expected in (
                (got.position_rad, oracle(times)),
                (got.velocity_rad_s, oracle(times, 1)),
                (got.acceleration_rad_s2, oracle(times, 2)),
                (got.torque_nm, feed_forward(times)),
            ):
                scale = np.max(abs(expected))
                self.assertGreater(scale, 0)
                np.testing.assert_allclose(values[:, j], expected, rtol=0, atol=1e-12 * scale)

    def test_evaluate_in_single_precision_is_what_the_executor_plans_bit_for_bit(self):
        trace = self.folder / "trace.csv"
        path = support.PRIMITIVES / "handstand.toml"
        self.run_program("tumbler run", "sim", path, "--csv", trace)
        with open(trace, newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["state"] == "running"]
        primitive = tumbler.Primitive.load(path)
        self.assertGreater(len(rows), 1000 * primitive.duration_s - 2)
        times = np.array([row["primitive_time_s"] for row in rows], dtype=np.float32)
        got = primitive.evaluate(times, dtype=np.float32)
        for column, values in (
            ("planned_position_rad", got.position_rad),
            ("planned_velocity_rad_s", got.velocity_rad_s),
            ("planned_torque_nm", got.torque_nm),
            ("planned_acceleration_rad_s2", got.acceleration_rad_s2),
        ):
            for j, joint in enumerate(primitive.joints):
                planned = np.array([row[f"{joint.name}_{column}"] for row in rows], dtype=np.float32)
                self.assertEqual(values.dtype, np.float32)
                np.testing.assert_array_equal(values[:, j].view(np.uint32), planned.view(np.uint32), column)

    def test_evaluate_has_the_shape_of_the_times_and_one_more_for_the_joints(self):
        primitive = load("handstand.toml")
        self.assertEqual(primitive.evaluate(0.5).position_rad.shape, (2,))
        self.assertEqual(primitive.evaluate(np.zeros((3, 4))).torque_nm.shape, (3, 4, 2))
        self.assertEqual(primitive.evaluate([]).velocity_rad_s.shape, (0, 2))
        table = primitive.evaluate(np.linspace(0, 0.7, 12).reshape(3, 4).T)
        self.assertEqual(table.position_rad[1, 2, 0], primitive.evaluate(np.linspace(0, 0.7, 12)[9]).position_rad[0])

    def test_times_that_are_not_in_the_motion_are_refused_with_their_number(self):
        primitive = load("handstand.toml")
        for times, message in (
            ([0.1, 0.8], r"times_s: number 1 is 0.8 s; allowed: from 0 ... 0.723 s"),
            (-1e-6, "number 0 is -1e-06 s"),
            ([[0.0, np.nan]], "number 1 is nan s"),
            ([np.inf], "number 0 is inf s"),
        ):
            for dtype in ("float64", "float32"):
                with self.assertRaisesRegex(ValueError, message):
                    primitive.evaluate(times, dtype=dtype)

    def test_ends_that_were_rounded_to_single_precision_are_in_the_motion(self):
        primitive = load("handstand.toml")
        rounded = np.float32(primitive.duration_s)
        self.assertNotEqual(rounded, primitive.duration_s)
        for dtype in ("float64", "float32"):
            got = primitive.evaluate([rounded, primitive.duration_s], dtype=dtype).position_rad
            np.testing.assert_allclose(got[0], got[1], rtol=0, atol=1e-6)

    def test_other_types_of_numbers_are_refused(self):
        with self.assertRaisesRegex(ValueError, "float32"):
            load("handstand.toml").evaluate(0.0, dtype=np.int32)

    def test_what_is_saved_is_the_same_primitive(self):
        primitive = load("handstand.toml")
        path = self.folder / "copy.toml"
        primitive.save(path)
        self.assertEqual(tumbler.Primitive.load(path).content_hash, primitive.content_hash)
        self.assertEqual(path.read_text(), primitive.text)

    def test_a_file_of_any_name_can_be_written(self):
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        load("handstand.toml").save("-")
        self.assertEqual(tumbler.check("./-"), "primitive")


class FileErrors(support.WithFolder):
    def test_say_file_line_and_key(self):
        text = (support.PRIMITIVES / "handstand.toml").read_text()
        path = self.folder / "bad.toml"
        lines = text.splitlines()
        line = next(i for i, l in enumerate(lines) if l.startswith("duration_s"))
        lines[line] = "duration_s = -1.0"
        path.write_text("\n".join(lines))
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.check(path)
        error = caught.exception
        self.assertEqual((error.file, error.line), (str(path), line + 1))
        self.assertEqual(error.key.split(".")[-1], "duration_s")
        self.assertTrue(str(error).startswith(f"{path}:{line + 1}: {error.key}: "))
        self.assertIn("allowed", str(error))
        self.assertIsInstance(error, ValueError)

    def test_of_a_missing_file_have_neither_line_nor_key(self):
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.Primitive.load("/nowhere/a: b.toml")
        self.assertEqual((caught.exception.line, caught.exception.key), (None, None))
        self.assertEqual(caught.exception.file, "/nowhere/a: b.toml")
        self.assertIn("No such file", str(caught.exception))

    def test_name_files_with_colons_whole(self):
        path = self.folder / "a: 1:2: b.toml"
        path.write_text("name = 1\n")
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.check(path)
        self.assertEqual(caught.exception.file, str(path))


class Sequences(support.WithFolder):
    def test_have_nodes_edges_and_primitives(self):
        gait = tumbler.Sequence.load(support.PRIMITIVES / "gait.toml")
        self.assertIn(gait.start, gait.nodes)
        self.assertEqual(set(gait.nodes.values()), set(gait.primitives))
        for start, end in gait.edges:
            self.assertIn(start, gait.nodes)
            self.assertIn(end, gait.nodes)
        for primitive in gait.primitives.values():
            self.assertGreater(primitive.evaluate(0).position_rad.size, 0)

    def test_check_says_what_a_file_is(self):
        for name, kind in (("gait.toml", "sequence"), ("handstand.toml", "primitive"), ("tasks/handstand.toml", "task")):
            self.assertEqual(tumbler.check(support.PRIMITIVES / name), kind)


if __name__ == "__main__":
    support.main(sys.argv)
