"""The JSON that programs write is what docs/schemas says, with nothing besides."""

import copy
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import jsonschema

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(sys.argv.pop(1)).resolve()
MOTIONS = ROOT / "primitives"

# Program, its arguments, and the status with which it ends.
RUNS = [
    ("tumbler run", f"sim {MOTIONS}/nominal/handstand.toml --hold-s 0", 0),
    ("tumbler run", f"sim {MOTIONS}/nominal/gait.toml --cycles 1 --branch roll --record RECORD", 0),
    ("tumbler run", f"sim {MOTIONS}/nominal/handstand.toml --bus-faults {ROOT}/tests/data/bus_faults.toml", 3),
    ("tumbler run", f"sim {MOTIONS}/nominal/handstand.toml --twin WEAK", 3),
    ("tumbler run", f"sim {MOTIONS}/handstand.toml --drives {MOTIONS}/robots/tumbler_drives_sensor.toml", 0),
    ("tumbler run", f"sim {MOTIONS}/hopper/hopper.toml --hold-s 0", 4),
    ("tumbler chain", f"simulate {MOTIONS}/nominal/gait.toml --cycles 1", 0),
    ("tumbler chain", f"simulate {MOTIONS}/nominal/gait.toml --cycles 1 --hold-s 0", 4),
    ("tumbler robustness", f"{MOTIONS}/handstand.toml --robots 400 --lanes --scale 2.5", 0),
    ("tumbler robustness", f"{MOTIONS}/handstand.toml --robots 4 --compare-lanes", 0),
    ("tumbler robustness", f"{MOTIONS}/nominal/gait.toml --cycles 1 --robots 2", 0),
    ("tumbler robustness", f"{MOTIONS}/handstand.toml --robots 8 --lanes --friction 0.15..1 --stiffness x10", 0),
    ("tumbler robustness", f"{MOTIONS}/handstand.toml --window", 0),
    ("tumbler abort", f"{MOTIONS}/handstand.toml --robots 2 --step 0.4", 0),
    ("tumbler abort", f"{MOTIONS}/handstand.toml --check 4", 0),
    ("tumbler optimize", f"{MOTIONS}/tasks/nominal/downstand.toml --start-from {MOTIONS}/nominal/handstand.toml", 0),
    ("tumbler optimize", "QUICK OTHER --minima 1", None),
    ("tumbler sweep", "QUICK --over contact.mu=0.3,0.31 --over mass=1,30 --out LIBRARY --guess "
        f"{MOTIONS}/nominal/handstand.toml", 0),
] + [
    ("tumbler bench", f"sim {command} --drives {MOTIONS}/robots/{drives}.toml --motion {MOTIONS}/nominal/handstand.toml", 0)
    for drives, commands in {
        "tumbler_drives": ["scan", "dbc --out DRIVES --overwrite", "read", "identify", "jog leg1", "zero", "check", "step leg1", "watchdog"],
        "tumbler_drives_cansimple": ["read", "latency --seconds 1", "commission --seconds 1 --out DRIVES --overwrite"],
        "tumbler_drives_akv3": ["read", "watchdog", "commission --seconds 1 --out DRIVES --overwrite"],
    }.items()
    for command in commands
]


def validator(program):
    name = program.replace(" ", "-")
    schema = json.loads((ROOT / f"docs/schemas/{name}.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


class Schemas(unittest.TestCase):
    def test_hold_what_programs_write_and_nothing_else(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "weak.toml").write_text(
                'format = "tumbler-twin"\nversion = 1\n[motor]\ntorque_max_nm = 4.0\n'
            )
            task = (MOTIONS / "tasks/nominal/handstand.toml").read_text()
            task = task.replace('"../../robots/', f'"{MOTIONS}/robots/')
            for name in ("handstand", "other"):
                quick = task.replace('name = "handstand"', f'name = "{name}"')
                # So few evaluations that hardly any motion is found.
                quick = quick.replace("[search]", "[search]\nmax_samples = 40\nbatch = 40")
                (folder / f"{name}.toml").write_text(quick)
            words = {
                "RECORD": folder / "run.rec",
                "WEAK": folder / "weak.toml",
                "QUICK": folder / "handstand.toml",
                "OTHER": folder / "other.toml",
                "DRIVES": folder / "drives.toml",
                "LIBRARY": folder / "library",
            }
            for program, arguments, status in RUNS:
                words_of_it = [str(words.get(word, word)) for word in arguments.split()]
                out = folder / "out.json"
                done = subprocess.run(
                    [BIN / "tumbler", *program.split()[1:], *words_of_it, "--json", out], capture_output=True, text=True
                )
                if status is not None:
                    self.assertEqual(done.returncode, status, arguments + done.stdout + done.stderr)
                written = json.loads(out.read_text())
                out.unlink()
                valid = validator(program)
                errors = [
                    f"{'/'.join(map(str, e.absolute_path))}: {e.message[:300]}"
                    for e in valid.iter_errors(written)
                ]
                self.assertEqual(errors, [], f"{program} {arguments}")
                # The schema notices what is missing, and what it does not know.
                for key in list(written)[:3]:
                    without = copy.copy(written)
                    del without[key]
                    self.assertFalse(valid.is_valid(without), key)
                self.assertFalse(valid.is_valid({**written, "unheard_of": 1}))


if __name__ == "__main__":
    unittest.main()
