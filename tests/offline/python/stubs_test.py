"""The names of the module and of its stubs are the same."""

import ast
import inspect
import pathlib
import sys

import support
import tumbler

PACKAGE = pathlib.Path(tumbler.__file__).parent


def stub():
    return ast.parse((PACKAGE / "__init__.pyi").read_text())


def names_of(body):
    """The public names that statements of a stub define."""
    names = set()
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.AnnAssign):
            names.add(node.target.id)
    return {name for name in names if not name.startswith("_") or name == "__version__"}


def members_of(cls):
    """The public names of a class that are not those of its bases outside the module."""
    inherited = {name for base in cls.__mro__[1:] for name in vars(base)}
    return {name for name in vars(cls) if not name.startswith("_")} - inherited


def parameters_of(node):
    """Names, kinds and defaults of the parameters of a function of a stub."""
    kind = inspect.Parameter
    given = node.args.args
    defaults = [None] * (len(given) - len(node.args.defaults)) + node.args.defaults
    found = [(a.arg, kind.POSITIONAL_OR_KEYWORD, d) for a, d in zip(given, defaults)]
    found += [(a.arg, kind.KEYWORD_ONLY, d) for a, d in zip(node.args.kwonlyargs, node.args.kw_defaults)]
    if node.args.kwarg:
        found.append((node.args.kwarg.arg, kind.VAR_KEYWORD, None))
    return [(name, of, kind.empty if d is None else ast.literal_eval(d)) for name, of, d in found]


def signature_of(function):
    return [(p.name, p.kind, p.default) for p in inspect.signature(function).parameters.values()]


class Stubs(support.WithFolder):
    def test_name_everything_that_the_module_has_and_nothing_else(self):
        self.assertEqual(names_of(stub().body), set(tumbler.__all__))

    def test_name_every_member_of_every_class_and_nothing_else(self):
        classes = {node.name: node for node in stub().body if isinstance(node, ast.ClassDef)}
        for name, node in classes.items():
            cls = getattr(tumbler, name)
            if issubclass(cls, Exception):
                continue  # Attributes of exceptions are those of objects, which other tests look at.
            members = members_of(cls)
            if issubclass(cls, tuple):
                members = set(cls._fields)
            self.assertEqual(names_of(node.body), members, name)

    def test_give_functions_the_parameters_that_they_have(self):
        classes = {node.name: node for node in stub().body if isinstance(node, ast.ClassDef)}
        functions = [(getattr(tumbler, n.name), n) for n in stub().body if isinstance(n, ast.FunctionDef)]
        for name, node in classes.items():
            for member in node.body:
                decorators = {d.id for d in getattr(member, "decorator_list", []) if isinstance(d, ast.Name)}
                if isinstance(member, ast.FunctionDef) and "property" not in decorators:
                    if not member.name.startswith("_"):
                        functions.append((getattr(getattr(tumbler, name), member.name), member))
        self.assertGreater(len(functions), 15)
        for function, node in functions:
            self.assertEqual(parameters_of(node), signature_of(function), node.name)
            self.assertTrue(inspect.getdoc(function), node.name)
            self.assertNotIn("--\n", inspect.getdoc(function))

    def test_are_marked_for_checkers_of_types(self):
        self.assertTrue((PACKAGE / "py.typed").is_file())


if __name__ == "__main__":
    support.main(sys.argv)
