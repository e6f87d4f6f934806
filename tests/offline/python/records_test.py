"""Flight records and simulated runs in Python, against what the programs write."""

import csv
import json
import sys

import numpy as np
import support
import tumbler

HANDSTAND = support.PRIMITIVES / "nominal/handstand.toml"
TWIN = support.PRIMITIVES / "robots/tumbler_twin.toml"


class Records(support.WithFolder):
    def test_have_the_columns_and_values_of_the_csv(self):
        record, trace = self.folder / "run.rec", self.folder / "run.csv"
        self.run_program("tumbler run", "sim", HANDSTAND, "--record", record)
        self.run_program("tumbler record", record, "--csv", trace)
        loaded = tumbler.Record.load(record)
        with open(trace, newline="") as file:
            rows = list(csv.reader(file))
        names, rows = rows[0], rows[1:]
        columns = loaded.columns
        self.assertEqual(list(columns), names)
        self.assertGreater(len(rows), 1000)
        for place, name in enumerate(names):
            column, texts = columns[name], [row[place] for row in rows]
            self.assertEqual(len(column), len(rows), name)
            self.assertFalse(column.flags.writeable, name)
            if column.dtype.kind == "U":
                self.assertEqual(column.tolist(), texts, name)
                continue
            expected = np.array([text or "nan" for text in texts], dtype=np.float64)
            if name == "time_s":  # which the CSV rounds to microseconds
                np.testing.assert_allclose(column, expected, rtol=0, atol=5.1e-7)
            else:
                np.testing.assert_array_equal(column, expected.astype(column.dtype), name)
        self.assertTrue(loaded.complete)
        self.assertEqual(loaded.joints, ("leg1", "leg2"))

    def test_columns_are_views_that_outlive_the_record(self):
        run = tumbler.simulate(HANDSTAND)
        column = run.record["leg1_measured_position_rad"]
        self.assertFalse(column.flags.owndata)
        expected = column.copy()
        del run
        tumbler.simulate(HANDSTAND)
        np.testing.assert_array_equal(column, expected)

    def test_what_is_no_record_is_an_error_of_its_own(self):
        with self.assertRaisesRegex(tumbler.RecordError, "handstand.toml"):
            tumbler.Record.load(HANDSTAND)
        with self.assertRaisesRegex(tumbler.RecordError, "No such file"):
            tumbler.Record.load(self.folder / "nothing.rec")

    def test_a_record_that_was_cut_off_is_not_complete(self):
        path, cut = self.folder / "run.rec", self.folder / "cut.rec"
        whole = tumbler.simulate(HANDSTAND, record=path).record
        cut.write_bytes(path.read_bytes()[:-5000])
        loaded = tumbler.Record.load(cut)
        self.assertFalse(loaded.complete)
        self.assertLess(len(loaded["tick"]), len(whole["tick"]))
        np.testing.assert_array_equal(loaded["tick"], whole["tick"][: len(loaded["tick"])])

    def test_a_column_that_is_not_there_is_a_key_error(self):
        with self.assertRaises(KeyError):
            tumbler.simulate(HANDSTAND).record["leg3_measured_position_rad"]


class Simulations(support.WithFolder):
    def run_of_program(self, motion, *options):
        """The record and the summary of tumbler run."""
        record, summary = self.folder / "program.rec", self.folder / "program.json"
        self.run_program("tumbler run", "sim", motion, "--record", record, "--json", summary, *options)
        return tumbler.Record.load(record), json.loads(summary.read_text())

    def assert_same_ticks(self, first, second):
        self.assertEqual(list(first), list(second))
        for name in first:
            np.testing.assert_array_equal(first[name], second[name], name)

    def test_play_what_the_program_plays_bit_for_bit(self):
        gait = support.PRIMITIVES / "nominal/gait.toml"
        run = tumbler.simulate(gait, cycles=1, twin=TWIN)
        record, summary = self.run_of_program(gait, "--cycles", 1, "--twin", TWIN)
        self.assert_same_ticks(run.record.columns, record.columns)
        self.assert_same_ticks(run.record.truth, record.truth)
        self.assertEqual(run.outcome, "completed")
        for key in ("outcome", "passages", "cycles", "falls", "after_torque_off", "exit_code"):
            self.assertEqual(run.summary[key], summary[key], key)

    def test_play_a_primitive_that_python_holds(self):
        run = tumbler.simulate(tumbler.Primitive.load(HANDSTAND))
        self.assertTrue(run.as_asked, run.summary)
        self.assertEqual(run.reason, "")
        self.assert_same_ticks(run.record.columns, self.run_of_program(HANDSTAND)[0].columns)
        self.assertGreater(run.record.truth["root_z_m"].size, 1000)

    def test_play_robots_in_space(self):
        solo8 = support.PRIMITIVES / "solo8"
        run = tumbler.simulate(solo8 / "walk.toml", drives=solo8 / "drives.toml", twin=solo8 / "twin.toml")
        self.assertTrue(run.as_asked, run.summary)
        truth = run.record.truth
        quaternion = np.stack([truth[f"root_quaternion_{part}"] for part in "wxyz"])
        np.testing.assert_allclose(np.linalg.norm(quaternion, axis=0), 1, rtol=1e-12)
        self.assertAlmostEqual(truth["root_x_m"][-1], 0.3, delta=0.03)
        self.assertEqual(truth["push_y_n"].min(), -6)

    def test_begin_where_the_program_begins(self):
        motion = support.PRIMITIVES / "get_up.toml"
        run = tumbler.simulate(motion, from_node="rise")
        record, summary = self.run_of_program(motion, "--from", "rise")
        self.assert_same_ticks(run.record.columns, record.columns)
        self.assert_same_ticks(run.record.truth, record.truth)
        self.assertEqual(run.summary["passages"][0]["node"], "rise")
        with self.assertRaisesRegex(ValueError, "from_node: .*get_up.toml: .*'nowhere'; allowed: .*rise"):
            tumbler.simulate(motion, from_node="nowhere")

    def test_what_was_not_judged_is_neither_as_asked_nor_amiss(self):
        run = tumbler.simulate(support.PRIMITIVES / "hopper/hopper.toml", hold_s=0.0)
        self.assertEqual(run.outcome, "completed")
        self.assertIsNone(run.summary["purpose_met"])
        self.assertIsNone(run.as_asked)
        self.assertIsNone(run.summary["as_asked"])
        self.assertEqual(run.summary["exit_code"], 4)

    def test_refuse_what_does_not_suit_the_motion(self):
        gait = support.PRIMITIVES / "nominal/gait.toml"
        for arguments in (
            {"motion": HANDSTAND, "cycles": 2},
            {"motion": gait},
            {"motion": gait, "cycles": 1, "branch": "nowhere"},
            {"motion": HANDSTAND, "speed": 2.0},
            {"motion": HANDSTAND, "speed": np.nan},
            {"motion": HANDSTAND, "hold_s": np.nan},
        ):
            with self.assertRaises(ValueError):
                tumbler.simulate(**arguments)

    def test_errors_in_any_of_their_files_say_which(self):
        twin = self.folder / "twin.toml"
        twin.write_text('format = "tumbler-twin"\nversion = 1\nnonsense = 1\n')
        with self.assertRaises(tumbler.FileError) as caught:
            tumbler.simulate(HANDSTAND, twin=twin)
        self.assertEqual(caught.exception.file, str(twin))
        self.assertEqual((caught.exception.line, caught.exception.key), (3, "nonsense"))

    def test_do_not_write_over_a_record(self):
        path = self.folder / "run.rec"
        path.write_text("mine")
        with self.assertRaisesRegex(RuntimeError, "run.rec"):
            tumbler.simulate(HANDSTAND, record=path)
        self.assertEqual(path.read_text(), "mine")


if __name__ == "__main__":
    support.main(sys.argv)
