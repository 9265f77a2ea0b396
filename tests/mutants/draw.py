# SPDX-License-Identifier: MIT
"""Draws mutants from a seed: a line, then an operator that fits it, then a place in the line.

An operator yields new texts of a line. It is given the line, and a copy with comments and strings blanked out, so that places
are the same in both. A mutant is {"operator", "file", "line", "old", "edits"}, the edits by the number of their line.
"""
import random
import re

RELATIONS = {"<": ["<=", ">"], "<=": ["<"], ">": [">=", "<"], ">=": [">"], "==": ["!="], "!=": ["=="]}
TOKEN = re.compile(r"[A-Za-z_]\w*|0[xX][0-9a-fA-F]+[uUlL]*|(?:\d+\.\d*|\.\d+|\d+)(?:[eE][-+]?\d+)?[uUlLfF]*|<<=|>>=|->|\+\+|--|"
                   r"<<|>>|[-+*/%&|^<>=!]=|&&|\|\||[^\sA-Za-z_0-9]")
ENOUGH_IN_VAIN = 1000  # ends after so many draws one after the other that brought nothing new
KEYWORDS = {"return", "if", "else", "for", "while", "do", "switch", "case", "default", "break", "continue", "goto", "sizeof", "typedef"}


def blank_out(text):
    """Blanks out comments, strings and characters. The length is the same, so that places stay."""
    pattern = re.compile(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'", re.S)
    return pattern.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)


def tokens(code):
    """Splits a line into (token, from, to)."""
    return [(found.group(), found.start(), found.end()) for found in TOKEN.finditer(code)]


def is_operand(token):
    return bool(re.match(r"[\w)\]]", token)) and token not in KEYWORDS


def replaced(line, at, to, new):
    return line[:at] + new + line[to:]


def relation(line, code):
    for token, at, to in tokens(code):
        if token in RELATIONS and not code.lstrip().startswith("#"):
            for new in RELATIONS[token]:
                yield replaced(line, at, to, new)


def connective(line, code):
    for token, at, to in tokens(code):
        if token in ("&&", "||"):
            yield replaced(line, at, to, "||" if token == "&&" else "&&")


def sign(line, code):
    found = tokens(code)
    for i, (token, at, to) in enumerate(found):
        before = found[i - 1][0] if i > 0 else ""
        if token in ("+=", "-="):
            yield replaced(line, at, to, "-=" if token == "+=" else "+=")
        elif token in ("+", "-") and is_operand(before):
            yield replaced(line, at, to, "-" if token == "+" else "+")
        elif token == "-":
            yield replaced(line, at, to, "")


def bound(line, code):
    """Changes a whole number, or the right side of a relation, by one."""
    found = tokens(code)
    for i, (token, at, to) in enumerate(found):
        if re.fullmatch(r"\d+[uUlL]*", token):
            number, suffix = re.fullmatch(r"(\d+)([uUlL]*)", token).groups()
            yield replaced(line, at, to, str(int(number) + 1) + suffix)
            if int(number) > 0:
                yield replaced(line, at, to, str(int(number) - 1) + suffix)
        elif token in ("<", "<=", ">", ">=") and i + 2 < len(found) and found[i + 2][0] in (";", ")", "&&", "||"):
            if re.match(r"[A-Za-z_]", found[i + 1][0]):
                yield replaced(line, found[i + 1][1], found[i + 1][2], found[i + 1][0] + " - 1")
                yield replaced(line, found[i + 1][1], found[i + 1][2], found[i + 1][0] + " + 1")


def constant(line, code):
    for token, at, to in tokens(code):
        if re.fullmatch(r"(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][-+]?\d+)?[fF]?", token):
            yield replaced(line, at, to, "1.0" if float(token.rstrip("fF")) == 0.0 else f"(1.5 * {token})")
        elif token in ("true", "false"):
            yield replaced(line, at, to, "false" if token == "true" else "true")


def condition(line, code):
    found = re.match(r"\s*(?:\} else )?if \(", code)
    cuts = parts_of(code, found.end()) if found is not None else []
    if cuts:
        yield line[:cuts[0]] + "!(" + line[cuts[0]:cuts[-1]] + ")" + line[cuts[-1]:]


def parts_of(code, begin):
    """Finds where the list after an open bracket begins, its commas, and where it ends. The result is empty if the end is in another line."""
    depth, cuts = 1, [begin]
    for at in range(begin, len(code)):
        depth += code[at] in "([{"
        depth -= code[at] in ")]}"
        if depth == 0 or (depth == 1 and code[at] == ","):
            cuts.append(at)
        if depth == 0:
            return cuts
    return []


def is_declaration(code):
    """Tells whether the line begins a function: it begins in the first column, or with a type and a name."""
    return not code[:1].isspace() or bool(re.match(r"\s*(?!return\b|else\b|goto\b|case\b)[A-Za-z_]\w*( [A-Za-z_]\w*)*[ *]+(\w+|\(\*\w+\))\(", code))


def arguments(line, code):
    """Swaps two neighbours of a call."""
    for call in re.finditer(r"[A-Za-z_]\w*\(", code):
        if call.group()[:-1] in KEYWORDS or is_declaration(code):
            continue
        cuts = parts_of(code, call.end())
        parts = [line[a + (i > 0):b].strip() for i, (a, b) in enumerate(zip(cuts, cuts[1:]))]
        for i in range(len(parts) - 1):
            swapped = parts[:i] + [parts[i + 1], parts[i]] + parts[i + 2:]
            if parts[i] != parts[i + 1]:
                yield line[:cuts[0]] + ", ".join(swapped) + line[cuts[-1]:]


def is_statement(code):
    """Drops a statement that is whole in its line and declares nothing."""
    text = code.strip()
    if not text.endswith(";") or text.count("(") != text.count(")") or text.count(";") != 1:
        return False
    if text.split("(")[0].split(" ")[0].rstrip(";") in KEYWORDS or text.startswith(("}", "{", "#")) or is_declaration(code):
        return False
    return bool(re.match(r"\(?\*?[A-Za-z_][\w.\[\]>*+ -]*?(\(|(?<![<>=!])=(?!=)|[-+*/|&^]=|\+\+|--)", text)) and \
        not re.match(r"(const |static |struct |enum |unsigned |[a-z_]+\w* \*?\w+( =|;|\[))", text)


def dropped(line, code):
    if is_statement(code):
        indent = line[:len(line) - len(line.lstrip())]
        yield indent + "(void)0;"


OPERATORS = {f.__name__: f for f in (relation, connective, sign, bound, constant, condition, arguments, dropped)}


def drop_lock(lines, codes, number):
    """Drops the lock of a line, and its unlocks up to the function's end. Returns None if there is no lock."""
    found = re.search(r"pthread_mutex_lock\((.*)\);", codes[number])
    if found is None or not is_statement(codes[number]):
        return None
    mutex, edits = lines[number][found.start(1):found.end(1)], {number: "(void)0;"}
    for at in range(number + 1, len(lines)):
        if lines[at].startswith("}"):
            break
        if f"pthread_mutex_unlock({mutex});" in lines[at]:
            edits[at] = lines[at].replace(f"pthread_mutex_unlock({mutex});", "(void)0;")
    return edits if len(edits) > 1 else None


class Source:
    def __init__(self, name):
        with open(name, encoding="utf-8") as file:
            text = file.read()
        self.lines, self.codes = text.split("\n"), blank_out(text).split("\n")


def mutants_of(source, number):
    """Yields (operator, {line: new text}) of a line, each different from it."""
    line, code = source.lines[number], source.codes[number]
    for name, operator in OPERATORS.items():
        for new in operator(line, code):
            if new != line:
                yield name, {number: new}
    edits = drop_lock(source.lines, source.codes, number)
    if edits is not None:
        yield "lock", edits


def draw(places, seed):
    """Draws the line first, each with equal chance, then the operator, then the place. No mutant comes twice."""
    rng, sources, seen, in_vain = random.Random(seed), {}, set(), 0
    while in_vain < ENOUGH_IN_VAIN:
        in_vain += 1
        name, number = places[rng.randrange(len(places))]
        if name not in sources:
            sources[name] = Source(name)
        source = sources[name]
        found = list(mutants_of(source, number - 1))
        if not found:
            continue
        operator = rng.choice(sorted({name for name, _ in found}))
        edits = rng.choice([edits for name, edits in found if name == operator])
        if (name, str(edits)) not in seen:
            seen.add((name, str(edits)))
            in_vain = 0
            yield {"operator": operator, "file": name, "line": number, "old": source.lines[number - 1],
                   "edits": {str(at + 1): text for at, text in edits.items()}}
