"""Texts of tasks from values, and with other values."""

import json
import math
import numbers
import tomllib
from collections.abc import Mapping, Sequence

from tumbler import _native


def _key(name):
    bare = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if bare else _string(name)


def _string(text):
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _is_sequence(value):
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes)) or hasattr(value, "tolist")


def _plain(value, path):
    """The value in types that TOML has. NumPy's numbers and arrays become Python's."""
    if isinstance(value, (str, bool)):
        return value
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise TypeError(f"{path or 'the task'}: has the key {key!r}; allowed: texts")
        return {key: _plain(entry, f"{path}.{key}".lstrip(".")) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), path)
    if _is_sequence(value):
        return [_plain(entry, f"{path}.{i}") for i, entry in enumerate(value)]
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    allowed = "numbers, texts, booleans, and lists and dictionaries of them"
    raise TypeError(f"{path}: is a {type(value).__name__}; allowed: {allowed}")


def _inline(value):
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)  # The shortest text that reads back as the number; nan and inf are TOML's.
    if isinstance(value, int):
        return str(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return "{ " + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + " }" if value else "{}"


def dumps(values):
    """The TOML text of values as `Task.values` gives them: a table for each dictionary of the outermost ones."""
    values = _plain(values, "")
    top, tables = [], []
    for key, value in values.items():
        entries = value if isinstance(value, list) else [value]
        if not entries or not all(isinstance(entry, dict) for entry in entries):
            top.append(f"{_key(key)} = {_inline(value)}")
            continue
        head = f"[[{_key(key)}]]" if isinstance(value, list) else f"[{_key(key)}]"
        tables += ["\n".join([head, *(f"{_key(k)} = {_inline(v)}" for k, v in entry.items())]) for entry in entries]
    return "\n".join(top) + "\n" + "".join("\n" + table + "\n" for table in tables)


def _entry(node, part, path):
    """The key or index of an entry, which a list has to have."""
    if isinstance(node, dict):
        return part
    if not isinstance(node, list):
        raise ValueError(f"{path}: is below a value that is no table; allowed: the keys of Task.values")
    if not part.isdecimal() or int(part) >= len(node):
        raise ValueError(f"{path}: '{part}' is no entry of {len(node)}; allowed: numbers from 0")
    return int(part)


def _with_value(text, path, value):
    """The text of all values, one of which is another; None takes it away. Comments are lost."""
    values = node = tomllib.loads(text)
    *parts, last = path.split(".")
    for part in parts:
        entry = _entry(node, part, path)
        node = node.setdefault(entry, {}) if isinstance(node, dict) else node[entry]
    entry = _entry(node, last, path)
    if value is not None:
        node[entry] = value
    elif isinstance(node, dict) and entry not in node:
        raise ValueError(f"{path}: is not there, so it cannot be taken away")
    else:
        del node[entry]
    return dumps(values)


def _number_at(text, path):
    """Whether there is a number."""
    node = tomllib.loads(text)
    for part in path.split("."):
        if isinstance(node, list) and part.isdecimal() and int(part) < len(node):
            node = node[int(part)]
        elif isinstance(node, dict) and part in node:
            node = node[part]
        else:
            return False
    return isinstance(node, (int, float)) and not isinstance(node, bool)


def changed(text, name, changes):
    """A task's text with other values by their paths. Where numbers replace numbers, the rest stays as it is."""
    for path, value in changes.items():
        if value is not None:
            value = _plain(value, path)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        # Beyond 2^53 a whole number has no double of its own.
        if is_number and math.isfinite(value) and abs(value) <= 2**53 and _number_at(text, path):
            text = _native._with_number(text, name, path, value)
        else:
            text = _with_value(text, path, value)
    return text
