#!/usr/bin/env python3
"""Doxygen's input filter: one of our headers, as Doxygen and Breathe read it best.

The comments stay as they are written for those who read the code. Here
  * indented lines, which are formulas and tables, become fenced blocks,
  * the comment above the namespace, or at the top of a C header, becomes that of the file,
  * comments of C headers become comments of documentation,
  * the namespace that everything is in is left out, and so is what stands in a namespace `detail`.
"""
import re
import sys

FORMULA = re.compile(r"( *)///  ( +\S.*)$")


def keep_formulas(lines):
    """Indented lines of a /// comment, and blank ones between them, as fenced blocks."""
    result, formula = [], False
    for number, line in enumerate(lines):
        match = FORMULA.match(line)
        follows = number + 1 < len(lines) and FORMULA.match(lines[number + 1])
        if match and not formula:
            result.append(match[1] + "/// ~~~{.unparsed}")
            formula = True
        if formula and not match and not (line.strip() == "///" and follows):
            result.append(re.match(" *", result[-1])[0] + "/// ~~~")
            formula = False
        result.append(line)
    return result


def cpp(text):
    text = re.sub(r"^namespace detail {\n.*?^}  // namespace detail\n", "", text, flags=re.S | re.M)
    lines = text.split("\n")
    if "namespace diracstep {" in lines or "namespace diracstep::plugin {" in lines:
        at = next(i for i, line in enumerate(lines) if line.startswith("namespace diracstep"))
        first = at
        while lines[first - 1].startswith("///"):
            first -= 1
        if first < at:
            lines[first:at] = ["/// @file", "///"] + lines[first:at] + [""]
    lines = [line for line in lines if line not in ("namespace diracstep {", "}  // namespace diracstep")]
    lines = [line.replace("namespace diracstep::", "namespace ") for line in lines]
    return "\n".join(keep_formulas(lines))


def c_comment(match):
    """A comment of C as one of Doxygen's; its indented lines as fenced blocks."""
    after_code = match[1].strip() != ""
    body = [re.sub(r"^ ?\* ?", "", line.strip()) if i else line for i, line in enumerate(match[2].split("\n"))]
    if after_code:
        return match[1] + "/**< " + " ".join(line.strip() for line in body) + " */"
    lines = keep_formulas(["/// " + line if line.strip() else "///" for line in body])
    return "\n".join(match[1] + line.rstrip() for line in lines)


def c(text):
    text = re.sub(r"^/\*", "/* @file\n *\n *", text)
    return re.sub(r"^([^\n]*?)/\*(.*?)\s*\*/", c_comment, text, flags=re.S | re.M)


path = sys.argv[1]
with open(path, encoding="utf-8") as header:
    sys.stdout.write((c if path.endswith(".h") else cpp)(header.read()))
