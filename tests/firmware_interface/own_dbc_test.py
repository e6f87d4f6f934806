"""The description that tumbler bench writes of a robot's own drives, read by canmatrix, decodes what was on the bus.

A run is recorded on the simulated bus with drives of other numbers and ranges than the examples'. Its setpoints and
replies, decoded from the log of frames, have to be the positions that the table of ticks has.
"""

import contextlib
import csv
import io
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest
import warnings

warnings.simplefilter("ignore")
with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
    import canmatrix.formats  # Says which formats it lacks.

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(sys.argv.pop(1)).resolve()
TURN = 2 * math.pi
MIT = [
    ("command_id = 1 ", "command_id = 5 "),
    ("command_id = 2", "command_id = 9"),
    ("reply_id = 17 ", "reply_id = 37 "),
    ("reply_id = 18", "reply_id = 41"),
    ("position_rad = [-12.5, 12.5]", "position_rad = [-7.0, 6.5]"),
    ("velocity_rad_s = [-50.0, 50.0]", "velocity_rad_s = [-61.0, 60.0]"),
    ("torque_nm = [-18.0, 18.0]", "torque_nm = [-15.0, 14.0]"),
]
# Example, changes, messages of setpoints and of replies, and the unit of their positions [rad].
CASES = {
    "mit": ("tumbler_drives", MIT, "MIT_COMMAND", "MIT_REPLY", 1),
    "damiao": (
        "tumbler_drives",
        MIT + [('protocol = "mit"', 'protocol = "mit"\ndialect = "damiao"'), ('"signed"', '"offset-40"')],
        "MIT_COMMAND",
        "MIT_REPLY",
        1,
    ),
    "cansimple": (
        "tumbler_drives_cansimple",
        [("node_id = 1", "node_id = 5"), ("node_id = 2", "node_id = 9")],
        "SET_INPUT_POS",
        "GET_ENCODER_ESTIMATES",
        TURN,
    ),
    "cia402": (
        "tumbler_drives_cia402",
        [("node_id = 1", "node_id = 5"), ("node_id = 2", "node_id = 9")],
        "RPDO1",
        "TPDO1",
        TURN / 65536,
    ),
    "akv3": (
        "tumbler_drives_akv3",
        [("drive_id = 1", "drive_id = 5"), ("drive_id = 2", "drive_id = 9")],
        "AKV3_SETPOINT",
        "AKV3_REPORT",
        None,
    ),
}


def frames(log):
    """(identifier as canmatrix has it, data) of a log of candump."""
    for line in log.read_text().splitlines():
        identifier, data = line.split()[2].split("#")
        yield canmatrix.ArbitrationId(int(identifier, 16), extended=len(identifier) == 8), bytes.fromhex(data)


def holds(part, whole, tolerance):
    """Whether the numbers of `part` follow each other somewhere in `whole`."""
    for begin in range(len(whole) - len(part) + 1):
        if all(abs(a - b) <= tolerance for a, b in zip(part, whole[begin : begin + len(part)])):
            return True
    return False


class OwnDbc(unittest.TestCase):
    def check(self, name):
        example, changes, setpoint, reply, unit = CASES[name]
        text = (ROOT / f"primitives/robots/{example}.toml").read_text()
        for before, after in changes:
            self.assertIn(before, text)
            text = text.replace(before, after)
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            drives = folder / "drives.toml"
            drives.write_text(text)

            def run(program, *arguments):
                done = subprocess.run([BIN / "tumbler", *program.split()[1:], *arguments], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

            run("tumbler bench", "sim", "dbc", "--drives", drives, "--out", folder / "own.dbc")
            run("tumbler run", "sim", ROOT / "primitives/nominal/handstand.toml", "--drives", drives, "--record", folder / "run.rec")
            run("tumbler record", folder / "run.rec", "--csv", folder / "run.csv", "--candump", folder / "run.log")
            own = canmatrix.formats.loadp_flat(str(folder / "own.dbc"))
            decoded = {}
            for identifier, data in frames(folder / "run.log"):
                frame = own.frame_by_id(identifier)
                self.assertIsNotNone(frame, f"{identifier}: is not described")
                self.assertEqual(frame.size, len(data), frame.name)
                if data[:7] != b"\xff" * 7:  # no setpoint, but a command by its value
                    values = frame.decode(bytearray(data)) if data else {}
                    decoded.setdefault(frame.name, []).append({k: float(v.phys_value) for k, v in values.items()})
            with (folder / "run.csv").open() as table:
                rows = [row for row in csv.DictReader(table) if row["state"] == "running"]
            self.assertGreater(len(rows), 300)
        for joint in ("leg1", "leg2"):
            field = "target" if name == "cia402" else "position"
            sent = [values[field] for values in decoded[f"{joint}_{setpoint}"]]
            asked = [float(row[f"{joint}_encoded_position_rad"]) for row in rows]
            scale = 1 if unit is None else unit
            self.assertTrue(holds(asked, [scale * value for value in sent], 2e-5), f"{name} {joint}")
            came = [values["position"] for values in decoded[f"{joint}_{reply}"]]
            scale = math.radians(1) if unit is None else unit
            known = sorted({round(scale * value, 4) for value in came})
            for row in rows:
                measured = float(row[f"{joint}_measured_position_rad"])
                nearest = min(abs(measured - value) for value in known)
                self.assertLess(nearest, 2e-4, f"{name} {joint}")
        return own, decoded

    def test_own_mit_drives(self):
        own, decoded = self.check("mit")
        self.assertEqual({row["sender"] for row in decoded["leg2_MIT_REPLY"]}, {9})
        self.assertEqual(own.frame_by_name("leg1_MIT_COMMAND").signal_by_name("velocity").min, -61)

    def test_own_drives_of_the_other_dialect(self):
        _, decoded = self.check("damiao")
        replies = decoded["leg1_MIT_REPLY"]
        self.assertEqual({row["sender"] for row in replies}, {5})
        self.assertEqual({row["status"] for row in replies}, {0, 1})
        self.assertTrue(all(15 <= row["transistors"] <= 60 for row in replies))

    def test_own_cansimple_drives(self):
        self.check("cansimple")

    def test_own_cia402_drives_with_shared_messages_once(self):
        own, _ = self.check("cia402")
        names = [frame.name for frame in own.frames]
        self.assertEqual([name for name in names if "SYNC" in name or "NMT" in name], ["NMT", "SYNC"])

    def test_own_akv3_drives(self):
        self.check("akv3")


if __name__ == "__main__":
    unittest.main()
