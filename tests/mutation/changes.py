"""The changes of a source: one operator, word or number at a time."""

import dataclasses
import re

OPERATORS = (("<", "<="), ("<=", "<"), (">", ">="), (">=", ">"), ("==", "!="), ("!=", "=="), ("<", ">"), (">", "<"), ("+", "-"), ("-", "+"),
             ("*", "/"), ("/", "*"), ("&&", "||"), ("||", "&&"), ("+=", "-="), ("-=", "+="))
WORDS = (("true", "false"), ("false", "true"), ("std::min", "std::max"), ("std::max", "std::min"), ("continue;", "break;"),
         ("break;", "continue;"), ("std::less", "std::greater"), ("std::greater", "std::less"), ("++", "--"))


@dataclasses.dataclass(frozen=True)
class Change:
    file: str
    line: int  # from 0
    column: int
    old: str
    new: str

    def applied(self, text):
        lines = text.split("\n")
        line = lines[self.line]
        lines[self.line] = line[: self.column] + self.new + line[self.column + len(self.old) :]
        return "\n".join(lines)

    def said(self, text):
        return f"{self.file}:{self.line + 1}  {self.old} -> {self.new}   {text.split(chr(10))[self.line].strip()}"


def changes_of(file, text):
    """All changes of a source, in the order of its lines."""
    found, in_comment = [], False
    # Raw strings, of several lines, first.
    text = re.sub(r'R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"', lambda match: '"' + re.sub(r"[^\n]", "_", match.group()[1:-1]) + '"', text, flags=re.DOTALL)
    for number, line in enumerate(text.split("\n")):
        stripped = line.strip()
        if in_comment or stripped.startswith("/*"):
            in_comment = "*/" not in stripped
            continue
        # Of the same length, and nothing inside strings, characters and comments.
        code = re.sub(r'"(\\.|[^"\\])*"' + r"|'(\\.|[^'\\])'", lambda match: '"' + "_" * (len(match.group()) - 2) + '"', line).split("//")[0]
        if not code.strip() or stripped.startswith(("#", "template", "using ", "static_assert", "namespace")):
            continue
        for old, new in OPERATORS:
            found += [Change(file, number, match.start(), old, new) for match in re.finditer(rf"(?<=\s){re.escape(old)}(?=\s|$)", code)]
        for old, new in WORDS:
            end = r"(?!\w)" if old[-1].isalpha() else ""
            found += [Change(file, number, match.start(), old, new) for match in re.finditer(rf"(?<![\w:]){re.escape(old)}{end}", code)]
        for match in re.finditer(r"(?<![\w.])(\d+\.\d+|\d+)(?![\w.])", code):
            value = match.group()
            new = repr(float(value) * 1.5 + 0.1) if "." in value else str(int(value) + 1)
            found.append(Change(file, number, match.start(), value, new))
    return found


def is_listed(change, text, same):
    """Whether rooms.toml lists it as a change that means the same."""
    line = text.split("\n")[change.line].strip()
    return any(change.file.endswith("/" + entry["file"]) and line == entry["line"] and f"{change.old} -> {change.new}" == entry["change"]
               and entry.get("column") in (None, change.column) for entry in same)
