"""The schemas of files that people write take all that are shipped, and no misspelt key.

  input_schema_test.py            with jsonschema
  input_schema_test.py TAPLO      as an editor does, with .taplo.toml
"""

import copy
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TAPLO = pathlib.Path(sys.argv.pop(1)).absolute() if len(sys.argv) > 1 else None
SCHEMAS = {
    path.name.split(".")[0]: json.loads(path.read_text())
    for path in sorted((ROOT / "docs/schemas/input").glob("*.schema.json"))
}
# Tables whose keys are names: of joints, links and primitives.
NAMES = {"joints_rad", "joints_rad_s", "mass_factor", "primitives", "passive", "control_points", "tied", "locked"}


def shipped():
    """Every file of a kind that has a schema: path, format, content."""
    for path in sorted([*ROOT.glob("primitives/**/*.toml"), *ROOT.glob("tests/data/tasks/*.toml")]):
        content = tomllib.loads(path.read_text())
        kind = content["format"]
        if kind == "tumbler-task" and content.get("root") == "floating":
            kind = "tumbler-task-in-space"
        if kind == "tumbler-twin" and path.parent.name.startswith("solo"):
            kind = "tumbler-twin-in-space"
        if kind in SCHEMAS:
            yield path, kind, content


def keys(value, above=()):
    """The place of each key that is no name."""
    if isinstance(value, list):
        for i, element in enumerate(value):
            yield from keys(element, (*above, i))
    elif isinstance(value, dict):
        for key, inner in value.items():
            # In a twin's [motor] there are tables of joints beside keys.
            of_joint = above and above[-1] == "motor" and isinstance(inner, dict)
            if not of_joint and not (above and above[-1] in NAMES):
                yield (*above, key)
            yield from keys(inner, (*above, key))


def misspelt(content, place):
    content = copy.deepcopy(content)
    table = content
    for key in place[:-1]:
        table = table[key]
    table[place[-1] + "_"] = table.pop(place[-1])
    return content


class WithJsonschema(unittest.TestCase):
    def setUp(self):
        import jsonschema

        self.of = {}
        for name, schema in SCHEMAS.items():
            jsonschema.Draft7Validator.check_schema(schema)
            self.of[name] = jsonschema.Draft7Validator(schema)

    def test_take_every_file_that_is_shipped(self):
        seen = set()
        for path, kind, content in shipped():
            errors = [f"{list(e.absolute_path)}: {e.message[:300]}" for e in self.of[kind].iter_errors(content)]
            self.assertEqual(errors, [], path)
            seen.add(kind)
        self.assertEqual(seen, set(SCHEMAS))

    def test_take_no_misspelt_key(self):
        count = 0
        known = set()  # once for each key of each kind
        for path, kind, content in shipped():
            for place in keys(content):
                what = (kind, *(part for part in place if isinstance(part, str)))
                if what in known:
                    continue
                known.add(what)
                count += 1
                self.assertFalse(self.of[kind].is_valid(misspelt(content, place)), f"{path} {place}")
        self.assertGreater(count, 250)

    def test_take_no_value_of_another_type_or_beyond_its_range(self):
        for kind, path, was, becomes in [
            ("tumbler-task", "tasks/handstand.toml", "mu = ", "mu = -"),
            ("tumbler-task", "tasks/handstand.toml", 'term = "terminal"', 'term = "termnal"'),
            ("tumbler-task", "tasks/handstand.toml", 'root = "planar-xz"', "root = 2"),
            ("tumbler-task", "tasks/nominal/handstand.toml", "control_points = 9", "control_points = 5"),
            ("tumbler-drives", "robots/tumbler_drives.toml", 'protocol = "mit"', 'protocol = "mitt"'),
            ("tumbler-drives", "robots/tumbler_drives.toml", "reply_id = 17", "reply_id = 5000"),
            ("tumbler-sequence", "gait.toml", 'from = "', 'from = 1 # "'),
        ]:
            text = (ROOT / "primitives" / path).read_text()
            self.assertIn(was, text)
            self.assertTrue(self.of[kind].is_valid(tomllib.loads(text)))
            self.assertFalse(self.of[kind].is_valid(tomllib.loads(text.replace(was, becomes, 1))), becomes)


class WithTaplo(unittest.TestCase):
    def lint(self, folder):
        # A file for which .taplo.toml has no schema must not be looked up in a catalogue of the net.
        return subprocess.run(
            ["unshare", "-rn", TAPLO, "lint", "primitives/**/*.toml"], cwd=folder, capture_output=True, text=True
        )

    def test_an_editor_takes_what_is_shipped_and_shows_a_misspelt_key_of_each_kind(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            shutil.copytree(ROOT / "docs/schemas/input", folder / "docs/schemas/input")
            shutil.copy(ROOT / ".taplo.toml", folder)
            shutil.copytree(ROOT / "primitives", folder / "primitives", ignore=shutil.ignore_patterns("*.urdf"))
            done = self.lint(folder)
            self.assertEqual(done.returncode, 0, done.stderr[:3000])
            spoilt = {}  # a file of each kind
            for path, kind, _ in shipped():
                copied = folder / path.relative_to(ROOT)
                if kind not in spoilt and copied.exists():
                    copied.write_text(copied.read_text().replace("version = ", "versoin = ", 1))
                    spoilt[kind] = copied
            self.assertEqual(set(spoilt), set(SCHEMAS))
            done = self.lint(folder)
            self.assertNotEqual(done.returncode, 0)
            invalid = set(re.findall(r'invalid file .*path="([^"]*)"', done.stderr))
            self.assertEqual(invalid, {str(path) for path in spoilt.values()})


if __name__ == "__main__":
    unittest.main(defaultTest="WithTaplo" if TAPLO else "WithJsonschema")
