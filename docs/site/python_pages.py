"""python_pages.py PACKAGE OUT.rst: the reference of a Python package, from the text of its modules: nothing is imported.

What __init__.py has in __all__, each with its signature and docstring; of classes the public methods and fields as well.
"""
import ast
import inspect
import pathlib
import sys


def signature(function, skip):
    arguments = ast.parse("def f(): pass").body[0].args
    for name in ("posonlyargs", "args", "vararg", "kwonlyargs", "kw_defaults", "kwarg", "defaults"):
        setattr(arguments, name, getattr(function.args, name))
    everything = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    for argument in filter(None, everything):
        argument.annotation = None
    arguments.args = arguments.args[1:] if skip else arguments.args
    return f"({ast.unparse(arguments)})"


def indented(text, depth):
    return "".join(" " * depth + line + "\n" if line else "\n" for line in inspect.cleandoc(text or "").split("\n")) + "\n"


def entry(kind, name, arguments, node, depth=0):
    return f"{' ' * depth}.. py:{kind}:: {name}{arguments}\n\n" + indented(ast.get_docstring(node), depth + 3)


def is_property(node):
    return any(isinstance(mark, ast.Name) and mark.id == "property" for mark in node.decorator_list)


def class_entry(node):
    methods = [part for part in node.body if isinstance(part, ast.FunctionDef)]
    made = next((signature(part, True) for part in methods if part.name == "__init__"), "")
    text = entry("class", node.name, made, node)
    fields = [part.target.id for part in node.body if isinstance(part, ast.AnnAssign) and not part.target.id.startswith("_")]
    if fields:
        text += "   Fields: " + ", ".join(f"``{field}``" for field in fields) + "\n\n"
    for part in methods:
        if part.name.startswith("_") and part.name not in ("__getitem__", "__len__"):
            continue
        kind, arguments = ("property", "") if is_property(part) else ("method", signature(part, True))
        text += entry(kind, part.name, arguments, part, 3)
    return text


package, out = map(pathlib.Path, sys.argv[1:])
trees = {path.stem: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(package.glob("*.py"))}
first = trees.pop("__init__")
public = next(ast.literal_eval(node.value) for node in first.body
              if isinstance(node, ast.Assign) and node.targets[0].id == "__all__")
nodes = {node.name: node for tree in trees.values() for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
title = "Reference of the Python package"
text = f"{title}\n{'=' * len(title)}\n\n.. py:module:: diracstep\n\n" + indented(ast.get_docstring(first), 0)
for name in public:
    if isinstance(nodes.get(name), ast.ClassDef):
        text += class_entry(nodes[name])
    elif name in nodes:
        text += entry("function", name, signature(nodes[name], False), nodes[name])
formulas = [name for name in public if name not in nodes]
text += "Functions of formulas and of numbers, and values: " + ", ".join(f"``{name}``" for name in formulas) + ".\n"
out.write_text(text, encoding="utf-8")
