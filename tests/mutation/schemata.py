"""One source for many changes (a mutant schema; Untch, Offutt and Harrold, "Mutation analysis using mutant schemata", ISSTA 1993):
compiled once, it does what the source does, or what it does with the one of the changes that CAIRN_CHANGE names (chosen.h)."""

import dataclasses
import re

INFIX = {"<": "Less", "<=": "LessEqual", ">": "Greater", ">=": "GreaterEqual", "==": "Equal", "!=": "NotEqual", "+": "Plus", "-": "Minus",
         "*": "Times", "/": "Over"}
FIRST = {"<": "<=", ">": ">="}  # of the operators that have two changes
ASSIGNMENT = {"+=": "Add", "-=": "Subtract"}
WORDS_BEFORE_AN_EXPRESSION = ("return", "co_return", "co_yield", "throw", "else", "do", "case")


@dataclasses.dataclass
class Edit:
    begin: int
    end: int
    text: str
    changes: list  # (number, position, old, new) inside of a condition, whose text is written again for each


def code_of(text):
    """The text with its strings, characters and comments blank, of the same length and with the same lines."""
    def blank(match):
        found = match.group()
        return re.sub(r"[^\n]", " ", found) if found.startswith("/") else found[0] + re.sub(r"[^\n]", "_", found[1:-1]) + found[-1]

    return re.sub(r'R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])+\'|//[^\n]*|/\*.*?\*/', blank, text,
                  flags=re.DOTALL)


def condition_around(code, place):
    """Where the expression of && and || begins and ends that has an operator at `place`."""
    depth, begin = 0, place
    while begin > 0:
        before = code[begin - 1]
        if before in ")]}":
            depth += 1
        elif before in "([{":
            if depth == 0:
                break
            depth -= 1
        elif depth == 0:
            if before in ";,?" or (before == ":" and code[begin - 2] != ":" and code[begin] != ":"):
                break
            if before == "=" and code[begin - 2] not in "=!<>" and code[begin] != "=":
                break
            word = re.search(r"\b(\w+)$", code[max(0, begin - 12) : begin]) if not re.match(r"\w", code[begin]) else None
            if word and word.group(1) in WORDS_BEFORE_AN_EXPRESSION:
                break
        begin -= 1
    depth, end = 0, place
    while end < len(code):
        after = code[end]
        if after in "([{":
            depth += 1
        elif after in ")]}":
            if depth == 0:
                break
            depth -= 1
        elif depth == 0 and (after in ";,?" or (after == ":" and code[end + 1] != ":" and code[end - 1] != ":")):
            break
        end += 1
    while begin < end and code[begin].isspace():
        begin += 1
    return begin, end


def edit_of(code, place, changes):
    """What stands for the changes, (number, old, new), at a place; None where only a compilation of its own can tell."""
    number, old, new = changes[0]
    end = place + len(old)
    if old in INFIX:
        numbers = [0, 0]
        for each, _, replacement in changes:
            numbers[old in FIRST and replacement != FIRST[old]] = each
        return Edit(place, end, f"{old} mutation::{INFIX[old]}{{{numbers[0]}, {numbers[1]}}} {old}", [])
    if old in ASSIGNMENT:
        return Edit(place, end, f"{old} mutation::{ASSIGNMENT[old]}{{{number}}} {old}", [])
    if old in ("&&", "||"):
        begin, end = condition_around(code, place)
        return Edit(begin, end, "", [(number, place, old, new)])
    if old in ("true", "false"):
        return Edit(place, end, f"(mutation::Is({number}) ? {new} : {old})", [])
    if old in ("std::min", "std::max"):
        of = ".Of" if code[end] == "<" else ""
        return Edit(place, end, f"mutation::{old[5:].capitalize()}({number}){of}", []) if code[end] in "(<" else None
    if old in ("continue;", "break;"):
        return Edit(place, end, f"{{ if (mutation::Is({number})) {new} else {old} }}", [])
    if old == "++":
        return Edit(place, end, f"mutation::Up{{{number}}}->*", []) if re.match(r"[\w(*]", code[end]) else None
    if old[0].isdigit():
        begin = place
        while re.match(r"[\w.']", code[begin - 1]) or (code[begin - 1] in "+-" and re.search(r"\d\.?e[+-]$", code[:begin][-8:])):
            begin -= 1
        rest = re.match(r"[\w.']*", code[end:]).group()
        before = code[begin:place]
        return Edit(begin, end + len(rest), f"(mutation::Is({number}) ? {before}{new}{rest} : {before}{old}{rest})", [])
    return None


def schema_of(text, changes):
    """`changes`: number -> Change, numbers from 1.  Returns the source with all of them, and the numbers of those that it lacks."""
    code = code_of(text)
    starts = [0]
    for line in text.split("\n"):
        starts.append(starts[-1] + len(line) + 1)
    places, alone = {}, []
    for number, change in changes.items():
        places.setdefault(starts[change.line] + change.column, []).append((number, change.old, change.new))
    edits = {}
    for place, at in sorted(places.items()):
        edit = edit_of(code, place, at)
        if edit is None:
            alone += [number for number, _, _ in at]
        elif (edit.begin, edit.end) in edits and edit.changes:
            edits[edit.begin, edit.end].changes += edit.changes
        elif (edit.begin, edit.end) in edits:
            alone += [number for number, _, _ in at]
        else:
            edits[edit.begin, edit.end] = edit
    # Those around others first.
    ordered = sorted(edits.values(), key=lambda edit: (edit.begin, -edit.end))

    def written(begin, end, inside):
        out, at, rest = [], begin, list(inside)
        while rest:
            edit = rest.pop(0)
            out.append(text[at : edit.begin])
            within = []
            while rest and rest[0].begin < edit.end:
                within.append(rest.pop(0))
            if edit.changes:
                copies = [f"mutation::Is({number}) ? ({plain(edit.begin, place)}{new}{plain(place + len(old), edit.end)}) : "
                          for number, place, old, new in edit.changes]
                out.append("(" + "".join(copies) + "(" + written(edit.begin, edit.end, within) + "))")
            else:
                out.append(edit.text)
            at = edit.end
        return "".join(out) + text[at:end]

    def plain(begin, end):
        """Without comments and in one line: the lines of what follows stay those of the source."""
        kept = [" " if code[place].isspace() else text[place] for place in range(begin, end)]
        return "".join(kept)

    changed_lines = {change.line for change in changes.values()}
    lines = written(0, len(text), ordered).split("\n")
    for number in changed_lines:
        if "constexpr" in lines[number] and "if constexpr" not in lines[number]:
            member = re.match(r"  +static constexpr", lines[number]) and not is_in_function(code, starts[number])
            lines[number] = lines[number].replace("static constexpr", "static inline const" if member else "static const").replace("constexpr", "const")
    return "\n".join(lines), sorted(alone)


def is_in_function(code, place):
    """Whether the block around `place` is one of statements; those of classes follow a name."""
    depth = 0
    for at in range(place - 1, -1, -1):
        if code[at] == "}":
            depth += 1
        elif code[at] == "{":
            if depth == 0:
                head = re.split(r"[;{}]", code[:at])[-1]
                return not re.search(r"\b(class|struct|union|namespace)\b", head)
            depth -= 1
    return False
