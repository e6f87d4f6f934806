"""No two sources define a type of the same name in the same namespace. A program that holds both has two constructors,
vectors and so on under one name, of which the linker silently takes one.

usage: names_test.py ROOT    the project's folder
"""

import pathlib
import re
import sys
import tempfile
import unittest

FOLDERS = ("common", "firmware_interface", "runtime", "offline", "tests")
# Where a name may be read that is none.
NOT_CODE = re.compile(r'R"(?P<mark>\w*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
# What a brace opens: a namespace, a type (and not X::Impl, which is declared in X), or anything else.
BRACES = re.compile(r"\bnamespace\s*(?P<space>[\w:]*)\s*\{"
                    r"|\b(?:struct|class|enum|enum class)\s+(?P<type>\w+)\s*(?:final\s*)?(?::(?!:)[^;{}]*)?\{"
                    r"|\{|\}")


def types_of(text):
    """Names of the types that a source defines outside of anonymous namespaces and other types."""
    open_braces = []  # The namespace that each opens; "": an anonymous one, None: no namespace.
    for brace in BRACES.finditer(NOT_CODE.sub('""', text)):
        if brace[0] == "}":
            if open_braces:
                open_braces.pop()
        elif brace["space"] is not None:
            open_braces.append(brace["space"])
        else:
            if brace["type"] and all(open_braces):
                yield "::".join([*open_braces, brace["type"]])
            open_braces.append(None)


def defined_twice(root):
    where = {}
    for folder in FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix in (".h", ".cc"):
                for name in types_of(file.read_text()):
                    where.setdefault(name, []).append(str(file.relative_to(root)))
    return {name: files for name, files in where.items() if len(files) > 1}


class Names(unittest.TestCase):
    root = pathlib.Path()

    def test_of_types_are_defined_once(self):
        self.assertEqual(defined_twice(self.root), {})

    def test_are_found_wherever_types_are_defined(self):
        text = """
            // struct InAComment {
            namespace a::b {
            namespace { struct Hidden { int x; }; }
            enum class Way : int { kOne };
            class Deep final : public Base<int> { struct Inner {}; void f() { struct Local {}; } };
            struct Deep::Impl {};
            struct Declared;
            const char* text = "struct InAString {";
            }  // namespace a::b
            struct Outside {};
            """
        self.assertEqual(list(types_of(text)), ["a::b::Way", "a::b::Deep", "Outside"])

    def test_that_are_there_twice_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {"common/a.h": "namespace t { struct A {}; struct B {}; }",
                               "offline/a.h": "namespace t { struct A {}; }\nnamespace u { struct B {}; }"}.items():
                (root / path).parent.mkdir()
                (root / path).write_text(text)
            self.assertEqual(defined_twice(root), {"t::A": ["common/a.h", "offline/a.h"]})


if __name__ == "__main__":
    Names.root = pathlib.Path(sys.argv.pop(1))
    unittest.main()
