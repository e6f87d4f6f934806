"""Results do not come from functions of the C library whose bits depend on the machine (common/core).

usage: functions_test.py ROOT    the project's folder
"""

import pathlib
import re
import sys
import tempfile
import unittest

FOLDERS = ("common", "firmware_interface", "runtime", "offline")
# sqrt, fmod, remainder, fma and what rounds or moves a sign are exact everywhere.
INEXACT = ("sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 log log2 log10 log1p "
           "pow cbrt hypot erf erfc tgamma lgamma sincos").split()
# Without a namespace: after an operator or `return`. After a name it is a declaration of something else.
CALL = re.compile(r"(?:\bstd::|\b__builtin_|(?:[=+\-*/%(,{<>?:&|!]|^|\breturn)\s*(?<![:>.]))(" + "|".join(INEXACT) +
                  r")[fl]?\(")
TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')
OF_LIBRARY = re.compile(r"\bstd::(?:\w+_distribution|complex|polar)\b")

# What only people see, or what follows from measurements on real drives.
ALLOWED = {
    "common/files/file_keys.cc": {"log10"},  # how many digits a message shows
    "offline/pages/flight_report.cc": {"log10"},  # bins of a drawing
    "offline/pages/live_run.cc": {"std::uniform_int_distribution"},  # a request's number
    "runtime/record/trace_drawing.cc": {"log10", "pow"},  # an axis of a drawing
    "runtime/record/tumbler_ctl.cc": {"std::uniform_int_distribution"},
    "runtime/bench": set(INEXACT),
}


def is_allowed(file, function):
    return any((file == place or file.startswith(place + "/")) and function in functions
               for place, functions in ALLOWED.items())


def calls(root):
    """(file, line, function) of each use that is not allowed."""
    found = []
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in (".h", ".cc"):
                continue
            file = str(path.relative_to(root))
            for number, line in enumerate(path.read_text().splitlines(), 1):
                code = TEXT.sub('""', line).split("//")[0]
                names = [match[1] for match in CALL.finditer(code)]
                names += [match[0] for match in OF_LIBRARY.finditer(code)]
                found += [f"{file}:{number}: {name}" for name in names if not is_allowed(file, name)]
    return found


class Functions(unittest.TestCase):
    root = pathlib.Path()

    def of(self, text, file="offline/a.cc"):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = pathlib.Path(folder.name) / file
        path.parent.mkdir(parents=True)
        path.write_text(text)
        return calls(pathlib.Path(folder.name))

    def test_none_of_the_project_takes_one_for_a_result(self):
        self.assertEqual(calls(self.root), [])

    def test_each_way_of_calling_one_is_found(self):
        for text in ("std::sin(x)", "y = cosf(x)", "2*exp(x)", "__builtin_pow(x, y)", "::std::atan2(y, x)",
                     "std::normal_distribution<double> n;"):
            self.assertEqual(len(self.of(text + "\n")), 1, text)

    def test_what_only_looks_like_one_is_not(self):
        for text in ("portable::Sin(x)", "// std::sin(x)", "std::sqrt(x)", "a.log(x)", "q->exp(x)", "my_sin(x)",
                     "LcmLog::log(x)", "void log(int)", "File log(path);", '"|cos(roll)|"', "std::remainder(x, y)", "sinusoid(x)"):
            self.assertEqual(self.of(text + "\n"), [], text)

    def test_what_is_allowed_is_still_there(self):
        for file in ALLOWED:
            self.assertTrue((self.root / file).exists(), file)


if __name__ == "__main__":
    Functions.root = pathlib.Path(sys.argv.pop(1))
    unittest.main()
