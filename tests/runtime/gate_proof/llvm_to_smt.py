"""Translates a function of LLVM's intermediate representation, as clang prints it, to SMT-LIB.

Only what a function on floats without loops is made of is known; anything else is refused by name, so that nothing is
assumed about it. The meaning of each instruction is that of LLVM's language reference:

- Floats are IEEE 754 binary32, rounded to the nearest even. SMT-LIB knows one NaN; where the bits of a float are
  looked at, those of a NaN are any that a NaN may have, as in LLVM.
- A value that the language leaves undefined ("poison") is kept as None for each element of a vector. It may be moved
  about, but neither decide about a branch nor end up in a result.
- Promises of the compiler about its own values (nuw, nsw, disjoint, nneg) become `obligations`, to be proved.
- Flags that allow other results than IEEE's (fast, nnan, contract ...) are refused.
"""

import re
import struct


class Refused(Exception):
    """An instruction, type or flag that is not known here."""


FAST_MATH = {"fast", "nnan", "ninf", "nsz", "arcp", "contract", "afn", "reassoc"}
FLAGS = FAST_MATH | {"nuw", "nsw", "disjoint", "nneg", "exact", "inbounds", "nusw", "samesign"}

# What else stands behind an instruction and says nothing about its value: aliasing, which is known here, and the like.
HARMLESS = re.compile(r", !(tbaa|tbaa\.struct|noalias|alias\.scope|prof) !\d+|, align \d+")

FLOAT_COMPARISONS = {
    "oeq": "(fp.eq {a} {b})", "une": "(not (fp.eq {a} {b}))",
    "olt": "(fp.lt {a} {b})", "uge": "(not (fp.lt {a} {b}))",
    "ogt": "(fp.gt {a} {b})", "ule": "(not (fp.gt {a} {b}))",
    "ole": "(fp.leq {a} {b})", "ugt": "(not (fp.leq {a} {b}))",
    "oge": "(fp.geq {a} {b})", "ult": "(not (fp.geq {a} {b}))",
    "one": "(or (fp.lt {a} {b}) (fp.gt {a} {b}))", "ueq": "(not (or (fp.lt {a} {b}) (fp.gt {a} {b})))",
    "ord": "(not (or (fp.isNaN {a}) (fp.isNaN {b})))", "uno": "(or (fp.isNaN {a}) (fp.isNaN {b}))",
    "true": "true", "false": "false",
}
INTEGER_COMPARISONS = {
    "eq": "(= {a} {b})", "ne": "(not (= {a} {b}))",
    "slt": "(bvslt {a} {b})", "sle": "(bvsle {a} {b})", "sgt": "(bvsgt {a} {b})", "sge": "(bvsge {a} {b})",
    "ult": "(bvult {a} {b})", "ule": "(bvule {a} {b})", "ugt": "(bvugt {a} {b})", "uge": "(bvuge {a} {b})",
}
FLOAT_ARITHMETIC = {"fadd": "fp.add", "fsub": "fp.sub", "fmul": "fp.mul", "fdiv": "fp.div"}
INTEGER_ARITHMETIC = {"add": "bvadd", "sub": "bvsub", "mul": "bvmul", "and": "bvand", "or": "bvor", "xor": "bvxor",
                      "shl": "bvshl", "lshr": "bvlshr", "ashr": "bvashr"}
BOOLEAN_ARITHMETIC = {"and": "and", "or": "or", "xor": "xor"}


def sort_of(kind):
    """The SMT-LIB sort of a scalar type."""
    if kind == "float":
        return "Float32"
    if kind == "i1":
        return "Bool"
    if re.fullmatch(r"i\d+", kind):
        return f"(_ BitVec {kind[1:]})"
    raise Refused(f"type {kind}")


def bits_of(kind):
    return 32 if kind == "float" else int(kind[1:])


def float_constant(bits):
    """The SMT-LIB constant of a binary32 given by its bits."""
    text = f"{bits:032b}"
    return f"(fp #b{text[0]} #b{text[1:9]} #b{text[9:]})"


def float_from_text(text):
    """LLVM prints a float as a decimal number, or exactly as the bits of a double."""
    value = struct.unpack(">d", bytes.fromhex(text[2:]))[0] if text.startswith("0x") else float(text)
    single = struct.pack(">f", value)
    if value == value and struct.unpack(">f", single)[0] != value:
        raise Refused(f"constant {text}, which is no float")
    return float_constant(int.from_bytes(single, "big"))


def integer_constant(value, bits):
    return f"(_ bv{value % (1 << bits)} {bits})"


def negation(term):
    return f"(not {term})"


def conjunction(terms):
    terms = [term for term in terms if term != "true"]
    if "false" in terms:
        return "false"
    return "true" if not terms else terms[0] if len(terms) == 1 else f"(and {' '.join(terms)})"


def disjunction(terms):
    if "true" in terms:
        return "true"
    terms = [term for term in terms if term != "false"]
    return "false" if not terms else terms[0] if len(terms) == 1 else f"(or {' '.join(terms)})"


class Vector:
    """Of values of one scalar type; an element is an SMT-LIB term, or None where it is undefined."""

    def __init__(self, kind, elements):
        self.kind = kind
        self.elements = elements


class Pointer:
    def __init__(self, name, offset):
        self.name = name
        self.offset = offset


class Object:
    """Bytes in memory: at each offset a value and which byte of it, the lowest first."""

    def __init__(self, size, bytes_=None):
        self.size = size
        self.bytes = dict(bytes_ or {})

    def copy(self):
        return Object(self.size, self.bytes)


class Function:
    """One function, executed symbolically. Its arguments are given by name and layout.

    layouts: for each argument, in order: a name for a scalar, or (name, [(offset, scalar type, name), ...], size) for
    what a pointer points to; no two of these overlap.
    base: another function of the same arguments, where the two are compared. What both compute has one name then, and
    `declarations` has only what is not among the other's.
    After construction: `declarations` (SMT-LIB text), `obligations` (terms that must hold), `objects` (memory after the
    return), `instructions` (how many there were of each opcode).
    """

    def __init__(self, text, function, layouts, base=None):
        self.base = base
        self.declarations = []
        self.obligations = []
        self.instructions = {}
        self.values = {}
        self.names = dict(base.names) if base else {}
        self.count = base.count if base else 0
        header, body = self.find(text, function)
        self.check_attributes(text, header)
        memory = self.take_arguments(header, layouts)
        self.run(self.blocks_of(body), memory)

    # Text.

    def find(self, text, function):
        match = re.search(rf"^define ([^\n]*)@{function}\(([^\n]*)\)([^\n()]*)\{{\n(.*?)^\}}", text, re.M | re.S)
        if not match:
            raise Refused(f"no function {function}")
        return match, match.group(4)

    def check_attributes(self, text, header):
        """Refuses arithmetic that is not IEEE's for the whole function."""
        for number in re.findall(r"#(\d+)", header.group(3)):
            attributes = re.search(rf"^attributes #{number} = \{{(.*)\}}", text, re.M).group(1)
            for bad in ("denormal", "strictfp", "unsafe-fp-math", "no-nans-fp-math", "no-infs-fp-math",
                        "no-signed-zeros-fp-math", "approx-func-fp-math"):
                if bad in attributes:
                    raise Refused(f"attribute {bad}")

    def take_arguments(self, header, layouts):
        arguments = split_arguments(header.group(2))
        if len(arguments) != len(layouts):
            raise Refused(f"{len(arguments)} arguments, not {len(layouts)}")
        memory = {}
        for argument, layout in zip(arguments, layouts):
            if "range(" in argument or "nofpclass" in argument:
                raise Refused(f"argument {argument}")
            kind, name = argument.split()[0], argument.split()[-1]
            if isinstance(layout, str):
                self.input(layout, kind)
                self.values[name] = Vector(kind, [layout])
                continue
            if kind != "ptr":
                raise Refused(f"argument {argument}: not a pointer")
            object_name, fields, size = layout
            memory[object_name] = Object(size)
            for offset, field_kind, field in fields:
                self.input(field, field_kind)
                value = (field_kind, field)
                for i in range(bits_of(field_kind) // 8):
                    memory[object_name].bytes[offset + i] = (value, i)
            self.values[name] = Pointer(object_name, 0)
        return memory

    def blocks_of(self, body):
        """Blocks in the text's order, by name. The first has the number after the last argument's."""
        blocks = {}
        name = str(len(self.values))
        for line in body.splitlines():
            line = line.split(";")[0].rstrip()
            label = re.fullmatch(r"([\w.]+):\s*", line)
            if label:
                name = label.group(1)
            elif line.strip():
                blocks.setdefault(name, []).append(HARMLESS.sub("", line.strip()))
        return blocks

    # Values.

    def input(self, name, kind):
        if not self.base:
            self.declarations.append(f"(declare-const {name} {sort_of(kind)})")

    def all_declarations(self, unknown=()):
        """With those of the base. Of the terms in `unknown` the definition is left out, so that they may be anything."""
        declarations = (self.base.declarations if self.base else []) + self.declarations
        for line in declarations:
            match = re.match(r"\(define-fun (\w+) \(\) (\w+|\(_ BitVec \d+\)) ", line)
            yield f"(declare-const {match.group(1)} {match.group(2)})" if match and match.group(1) in unknown else line

    def define(self, sort, term):
        """A name for a term, which may stand in many others; equal terms have the same."""
        if term not in self.names:
            self.count += 1
            self.names[term] = f"t{self.count}"
            self.declarations.append(f"(define-fun {self.names[term]} () {sort} {term})")
        return self.names[term]

    def arithmetic(self, opcode, x, y):
        """A sum etc. of two floats. x + y and y + x are the same term, which spares the solver the proof that they are
        the same number."""
        if opcode in ("fadd", "fmul"):
            x, y = sorted((x, y))
        return self.define("Float32", f"({FLOAT_ARITHMETIC[opcode]} RNE {x} {y})")

    def unknown(self, sort):
        self.count += 1
        name = f"u{self.count}"
        self.declarations.append(f"(declare-const {name} {sort})")
        return name

    def parse_type(self, text):
        """A type at the beginning of a text: (scalar type, length or None, rest)."""
        match = re.match(r"<(\d+) x ([\w]+)>\s*|([\w]+)\s*", text)
        if not match:
            raise Refused(f"type in `{text}`")
        if match.group(1):
            return match.group(2), int(match.group(1)), text[match.end():]
        return match.group(3), None, text[match.end():]

    def operand(self, kind, length, text):
        text = text.strip()
        count = length or 1
        if text.startswith("%"):
            value = self.values.get(text)
            if value is None:
                raise Refused(f"value {text}, which is not known yet: a loop")
            return value
        if text in ("poison", "undef"):
            return Vector(kind, [None] * count)
        if text == "zeroinitializer":
            zero = "false" if kind == "i1" else float_constant(0) if kind == "float" else \
                integer_constant(0, bits_of(kind))
            return Vector(kind, [zero] * count)
        if text.startswith("splat ("):
            inner_kind, _, rest = self.parse_type(text[len("splat ("):-1])
            return Vector(kind, self.operand(inner_kind, None, rest).elements * count)
        if text.startswith("<"):
            elements = []
            for part in split_arguments(text[1:-1]):
                inner_kind, _, rest = self.parse_type(part)
                elements += self.operand(inner_kind, None, rest).elements
            return Vector(kind, elements)
        if kind == "i1" and text in ("true", "false"):
            return Vector(kind, [text])
        if kind == "float" and re.fullmatch(r"-?\d.*|0x[0-9A-F]{16}", text):
            return Vector(kind, [float_from_text(text)])
        if re.fullmatch(r"i\d+", kind) and re.fullmatch(r"-?\d+", text):
            return Vector(kind, [integer_constant(int(text), bits_of(kind))])
        raise Refused(f"operand {kind} {text}")

    def typed(self, text):
        """An operand with its type before it."""
        kind, length, rest = self.parse_type(text)
        if kind == "ptr":
            pointer = self.values.get(rest.strip())
            if not isinstance(pointer, Pointer):
                raise Refused(f"pointer {rest}")
            return pointer
        return self.operand(kind, length, rest)

    def each(self, kind, function, *vectors):
        """A vector of function(elements), where none of the elements is undefined."""
        elements = []
        for parts in zip(*(vector.elements for vector in vectors)):
            elements.append(None if None in parts else self.define(sort_of(kind), function(*parts)))
        return Vector(kind, elements)

    # Memory.

    def bits(self, value):
        """A bit vector of a value's bits."""
        kind, term = value
        if kind == "float":
            # Any bits that mean this float: several only of NaN.
            bits = self.unknown("(_ BitVec 32)")
            self.declarations.append(f"(assert (= ((_ to_fp 8 24) {bits}) {term}))")
            return bits
        if kind == "i1":
            return f"(ite {term} #b1 #b0)"
        return term

    def read(self, object_, offset, kind):
        size = (bits_of(kind) + 7) // 8
        if offset < 0 or offset + size > object_.size:
            raise Refused("a load outside of its object")
        places = [object_.bytes.get(offset + i) for i in range(size)]
        if None in places:
            return None
        value = places[0][0]
        whole = bits_of(value[0]) == bits_of(kind) and all(place == (value, i) for i, place in enumerate(places))
        if whole and value[0] == kind:
            return value[1]
        if whole:
            bits = self.bits(value)
        else:
            known = {}
            for value, _ in places:
                if id(value) not in known:
                    padded = self.bits(value)
                    width = bits_of(value[0])
                    if width % 8:
                        padded = f"((_ zero_extend {-width % 8}) {padded})"
                    known[id(value)] = self.define(f"(_ BitVec {width + -width % 8})", padded)
            parts = [f"((_ extract {8 * i + 7} {8 * i}) {known[id(value)]})" for value, i in reversed(places)]
            bits = self.define(f"(_ BitVec {8 * size})", parts[0] if size == 1 else f"(concat {' '.join(parts)})")
        if kind == "float":
            return self.define("Float32", f"((_ to_fp 8 24) {bits})")
        if 8 * size != bits_of(kind):
            bits = f"((_ extract {bits_of(kind) - 1} 0) {bits})"
        return self.define(sort_of(kind), f"(= {bits} #b1)" if kind == "i1" else bits)

    def write(self, object_, offset, kind, term):
        size = (bits_of(kind) + 7) // 8
        if offset < 0 or offset + size > object_.size:
            raise Refused("a store outside of its object")
        value = (kind, term)
        for i in range(size):
            if term is None:
                object_.bytes.pop(offset + i, None)
            else:
                object_.bytes[offset + i] = (value, i)

    def merge(self, states):
        """The memory after several ways, each with the condition of its having been taken."""
        if len(states) == 1:
            return {name: object_.copy() for name, object_ in states[0][1].items()}
        merged = {}
        for name in states[0][1]:
            objects = [state[name] for _, state in states]
            result = Object(objects[0].size)
            offset = 0
            while offset < result.size:
                places = [object_.bytes.get(offset) for object_ in objects]
                if all(place == places[0] for place in places):
                    if places[0] is not None:
                        result.bytes[offset] = places[0]
                    offset += 1
                    continue
                kind = places[0][0][0] if None not in places and places[0][1] == 0 else "i8"
                floats = offset % 4 == 0 and kind == "float" and all(
                    place[0][0] == "float" and all(object_.bytes.get(offset + i) == (place[0], i) for i in range(4))
                    for place, object_ in zip(places, objects))
                kind = "float" if floats else "i8"
                terms = [self.read(object_, offset, kind) for object_ in objects]
                chosen = None if None in terms else self.choose([c for c, _ in states], terms, sort_of(kind))
                self.write(result, offset, kind, chosen)
                offset += 4 if floats else 1
            merged[name] = result
        return merged

    def choose(self, conditions, terms, sort):
        """The term whose condition holds: one of them does."""
        chosen = terms[-1]
        for condition, term in zip(reversed(conditions[:-1]), reversed(terms[:-1])):
            chosen = f"(ite {condition} {term} {chosen})"
        return self.define(sort, chosen)

    # Execution.

    def run(self, blocks, memory):
        self.incoming = {next(iter(blocks)): [(None, "true", memory)]}
        self.objects = None
        pending = list(blocks)
        sources = {name: set(re.findall(r"label %([\w.]+)", lines[-1])) for name, lines in blocks.items()}
        while pending:
            ready = next((name for name in pending
                          if not any(name in sources[other] for other in pending)), None)
            if ready is None:
                raise Refused("a loop")
            pending.remove(ready)
            if ready in self.incoming:  # Otherwise nothing leads there.
                self.run_block(ready, blocks[ready])
        if self.objects is None:
            raise Refused("no return")

    def run_block(self, name, lines):
        ways = self.incoming[name]
        self.reached = disjunction([condition for _, condition, _ in ways])
        if self.reached not in ("true", "false"):
            self.reached = self.define("Bool", self.reached)
        self.memory = self.merge([(condition, memory) for _, condition, memory in ways])
        phis = {}
        for line in lines:
            result, opcode, rest, flags = parse_instruction(line)
            self.instructions[opcode] = self.instructions.get(opcode, 0) + 1
            if flags & FAST_MATH:
                raise Refused(f"{opcode} with {' '.join(sorted(flags & FAST_MATH))}")
            if opcode == "phi":
                phis[result] = self.phi(ways, rest)  # All at once: they are of the way, not of each other.
                continue
            self.values.update(phis)
            phis = {}
            if opcode == "br":
                self.branch(name, rest)
            elif opcode == "ret":
                if rest != "void" or self.objects is not None:
                    raise Refused(f"ret {rest}")
                self.objects = self.memory
            else:
                method = getattr(self, "do_" + opcode, None)
                if opcode in FLOAT_ARITHMETIC:
                    value = self.float_arithmetic(opcode, rest)
                elif opcode in INTEGER_ARITHMETIC:
                    value = self.integer_arithmetic(opcode, rest, flags)
                elif method:
                    value = method(rest, flags)
                else:
                    raise Refused(f"instruction {opcode}")
                if result:
                    self.values[result] = value

    def oblige(self, condition):
        """A promise of the compiler, where the block is executed at all."""
        self.obligations.append(f"(=> {self.reached} {condition})")

    def branch(self, name, rest):
        def go(target, condition):
            self.incoming.setdefault(target, []).append((name, condition, self.memory))

        always = re.fullmatch(r"label %([\w.]+)", rest)
        if always:
            return go(always.group(1), self.reached)
        match = re.fullmatch(r"i1 (\S+), label %([\w.]+), label %([\w.]+)", rest)
        if not match:
            raise Refused(f"br {rest}")
        condition = self.operand("i1", None, match.group(1)).elements[0]
        if condition is None:
            raise Refused("a branch on an undefined value")
        go(match.group(2), conjunction([self.reached, condition]))
        go(match.group(3), conjunction([self.reached, negation(condition)]))

    def phi(self, ways, rest):
        kind, length, rest = self.parse_type(rest)
        by_block = dict((block, self.operand(kind, length, value)) for value, block in
                        re.findall(r"\[ (.*?), %([\w.]+) \]", rest))
        vectors = [by_block[block] for block, _, _ in ways]
        conditions = [condition for _, condition, _ in ways]
        elements = []
        for terms in zip(*(vector.elements for vector in vectors)):
            elements.append(None if None in terms else self.choose(conditions, list(terms), sort_of(kind)))
        return Vector(kind, elements)

    def two(self, rest):
        kind, length, rest = self.parse_type(rest)
        a, b = split_arguments(rest)
        return kind, self.operand(kind, length, a), self.operand(kind, length, b)

    def float_arithmetic(self, opcode, rest):
        kind, a, b = self.two(rest)
        if kind != "float":
            raise Refused(f"{opcode} of {kind}")
        return Vector(kind, [None if None in parts else self.arithmetic(opcode, *parts)
                             for parts in zip(a.elements, b.elements)])

    def integer_arithmetic(self, opcode, rest, flags):
        kind, a, b = self.two(rest)
        if kind == "i1":
            if opcode not in BOOLEAN_ARITHMETIC:
                raise Refused(f"{opcode} of i1")
            if "disjoint" in flags:
                self.each("i1", lambda x, y: self.oblige(f"(not (and {x} {y}))") or "true", a, b)
            return self.each(kind, lambda x, y: f"({BOOLEAN_ARITHMETIC[opcode]} {x} {y})", a, b)
        if opcode in ("shl", "lshr", "ashr"):
            width = integer_constant(bits_of(kind), bits_of(kind))
            self.each("i1", lambda x, y: self.oblige(f"(bvult {y} {width})") or "true", a, b)
            if flags:
                raise Refused(f"{opcode} with {' '.join(sorted(flags))}")
        elif flags == {"disjoint"} and opcode == "or":
            zero = integer_constant(0, bits_of(kind))
            self.each("i1", lambda x, y: self.oblige(f"(= (bvand {x} {y}) {zero})") or "true", a, b)
        elif flags:
            raise Refused(f"{opcode} with {' '.join(sorted(flags))}")
        return self.each(kind, lambda x, y: f"({INTEGER_ARITHMETIC[opcode]} {x} {y})", a, b)

    def do_fneg(self, rest, flags):
        value = self.typed(rest)
        return self.each("float", lambda x: f"(fp.neg {x})", value)

    def do_fcmp(self, rest, flags):
        predicate, rest = rest.split(" ", 1)
        kind, a, b = self.two(rest)
        return self.each("i1", lambda x, y: FLOAT_COMPARISONS[predicate].format(a=x, b=y), a, b)

    def do_icmp(self, rest, flags):
        if flags:
            raise Refused(f"icmp with {' '.join(sorted(flags))}")
        predicate, rest = rest.split(" ", 1)
        kind, a, b = self.two(rest)
        if kind == "i1" and predicate not in ("eq", "ne"):
            raise Refused(f"icmp {predicate} of i1")
        return self.each("i1", lambda x, y: INTEGER_COMPARISONS[predicate].format(a=x, b=y), a, b)

    def do_select(self, rest, flags):
        condition, a, b = (self.typed(part) for part in split_arguments(rest))
        conditions = condition.elements * (len(a.elements) if len(condition.elements) == 1 else 1)
        return self.each(a.kind, lambda c, x, y: f"(ite {c} {x} {y})", Vector("i1", conditions), a, b)

    def do_freeze(self, rest, flags):
        value = self.typed(rest)
        return Vector(value.kind, [self.unknown(sort_of(value.kind)) if element is None else element
                                   for element in value.elements])

    def do_sitofp(self, rest, flags):
        return self.to_float(rest, "(_ to_fp 8 24)")

    def do_uitofp(self, rest, flags):
        value, _ = self.conversion(rest)
        if "nneg" in flags:
            zero = integer_constant(0, bits_of(value.kind))
            self.each("i1", lambda x: self.oblige(f"(bvsge {x} {zero})") or "true", value)
        return self.to_float(rest, "(_ to_fp_unsigned 8 24)")

    def conversion(self, rest):
        source, target = rest.rsplit(" to ", 1)
        kind, length, _ = self.parse_type(target)
        return self.typed(source), (kind, length)

    def to_float(self, rest, operation):
        value, (kind, _) = self.conversion(rest)
        if kind != "float" or value.kind == "i1":
            raise Refused(f"a conversion of {rest}")
        return self.each("float", lambda x: f"({operation} RNE {x})", value)

    def do_zext(self, rest, flags):
        value, (kind, _) = self.conversion(rest)
        more = bits_of(kind) - bits_of(value.kind)
        if "nneg" in flags and value.kind != "i1":
            zero = integer_constant(0, bits_of(value.kind))
            self.each("i1", lambda x: self.oblige(f"(bvsge {x} {zero})") or "true", value)
        return self.each(kind, lambda x: f"((_ zero_extend {more}) {self.bits((value.kind, x))})", value)

    def do_trunc(self, rest, flags):
        value, (kind, _) = self.conversion(rest)
        width, more = bits_of(kind), bits_of(value.kind) - bits_of(kind)
        extend = {"nuw": "zero_extend", "nsw": "sign_extend"}
        for flag in flags:
            self.each("i1", lambda x: self.oblige(
                f"(= ((_ {extend[flag]} {more}) ((_ extract {width - 1} 0) {x})) {x})") or "true", value)
        if kind == "i1":
            return self.each(kind, lambda x: f"(= ((_ extract 0 0) {x}) #b1)", value)
        return self.each(kind, lambda x: f"((_ extract {width - 1} 0) {x})", value)

    def do_bitcast(self, rest, flags):
        value, (kind, length) = self.conversion(rest)
        if bits_of(value.kind) != bits_of(kind):
            raise Refused(f"bitcast {rest}")
        if kind == value.kind:
            return value
        if kind == "float":
            return self.each(kind, lambda x: f"((_ to_fp 8 24) {x})", value)
        return Vector(kind, [None if x is None else self.bits((value.kind, x)) for x in value.elements])

    def do_insertelement(self, rest, flags):
        vector, element, index = split_arguments(rest)
        vector, element = self.typed(vector), self.typed(element)
        elements = list(vector.elements)
        elements[int(index.split()[1])] = element.elements[0]
        return Vector(vector.kind, elements)

    def do_extractelement(self, rest, flags):
        vector, index = split_arguments(rest)
        vector = self.typed(vector)
        return Vector(vector.kind, [vector.elements[int(index.split()[1])]])

    def do_shufflevector(self, rest, flags):
        a, b, mask = split_arguments(rest)
        a, b = self.typed(a), self.typed(b)
        both = a.elements + b.elements
        if "zeroinitializer" in mask:
            indices = [0] * self.parse_type(mask)[1]
        else:
            indices = [None if part.endswith(("poison", "undef")) else int(part.split()[1])
                       for part in split_arguments(mask[mask.index(">") + 1:].strip()[1:-1])]
        return Vector(a.kind, [None if i is None else both[i] for i in indices])

    def do_getelementptr(self, rest, flags):
        parts = split_arguments(rest)
        if parts[0] != "i8" or len(parts) != 3:
            raise Refused(f"getelementptr {rest}")
        pointer = self.typed(parts[1])
        offset = pointer.offset + int(parts[2].split()[1])
        if not 0 <= offset <= self.memory[pointer.name].size:
            raise Refused(f"getelementptr {rest}: outside of its object")
        return Pointer(pointer.name, offset)

    def do_load(self, rest, flags):
        target, pointer = split_arguments(rest)
        kind, length, _ = self.parse_type(target)
        pointer = self.typed(pointer)
        object_ = self.memory[pointer.name]
        size = bits_of(kind) // 8
        return Vector(kind, [self.read(object_, pointer.offset + i * size, kind) for i in range(length or 1)])

    def do_store(self, rest, flags):
        value, pointer = split_arguments(rest)
        value, pointer = self.typed(value), self.typed(pointer)
        size = (bits_of(value.kind) + 7) // 8
        for i, element in enumerate(value.elements):
            self.write(self.memory[pointer.name], pointer.offset + i * size, value.kind, element)

    def do_call(self, rest, flags):
        match = re.fullmatch(r"(?:\w+ )*?(\w+|<\d+ x \w+>) @([\w.]+)\((.*)\)(?: #\d+)?", rest)
        name = match.group(2) if match else rest
        if name.startswith("llvm.lifetime."):
            return None
        if name == "llvm.fabs.f32":
            return self.each("float", lambda x: f"(fp.abs {x})", self.typed(match.group(3)))
        if name == "llvm.copysign.f32":
            size, sign = (self.typed(part) for part in split_arguments(match.group(3)))
            return self.each("float", self.copy_sign, size, sign)
        raise Refused(f"call of {name}")

    def copy_sign(self, size, sign):
        negative = self.unknown("Bool")  # Of a NaN either.
        self.declarations.append(f"(assert (or (fp.isNaN {sign}) (= {negative} (fp.isNegative {sign}))))")
        return f"(ite {negative} (fp.neg (fp.abs {size})) (fp.abs {size}))"

    # Results.

    def result(self, object_name, offset, kind):
        """What lies in an object after the return."""
        term = self.read(self.objects[object_name], offset, kind)
        if term is None:
            raise Refused(f"{object_name}, byte {offset}: undefined after the return")
        return term


def split_arguments(text):
    """Splits at the commas that are in no brackets."""
    parts, depth, start = [], 0, 0
    for i, character in enumerate(text):
        if character in "([<{":
            depth += 1
        elif character in ")]>}":
            depth -= 1
        elif character == "," and depth == 0:
            parts.append(text[start:i].strip())
            start = i + 1
    parts.append(text[start:].strip())
    return parts


def parse_instruction(line):
    """(result or None, opcode, the rest, flags) of a line."""
    result = None
    match = re.match(r"(%[\w.]+) = ", line)
    if match:
        result, line = match.group(1), line[match.end():]
    line = re.sub(r"^(tail|musttail|notail) (?=call)", "", line)
    opcode, _, rest = line.partition(" ")
    if "!" in rest:
        raise Refused(f"{opcode} with metadata: {rest}")
    flags = set()
    while rest.split(" ", 1)[0] in FLAGS:
        flag, rest = rest.split(" ", 1)
        flags.add(flag)
    return result, opcode, rest, flags
