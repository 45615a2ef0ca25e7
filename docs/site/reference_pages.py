"""reference_pages.py XML OUT: a page of the reference for each public header Doxygen has read, and their contents.

Breathe fills in the declarations. What is written here is where they stand: one page for each header, in OUT/FOLDER,
with the label under which other comments mention the header.
"""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

FOLDERS = {
    "core": "The mathematics of one step. Sees Eigen only.",
    "constraints": "Rows from formulas, circuits, and systems joined by rows.",
    "solvers": "SUNDIALS KINSOL behind the interface of a nonlinear solver.",
    "eigenvalues": "A few eigenvalues of large matrices.",
    "sensitivities": "Derivatives of a motion by its start and by parameters, and fits.",
    "boundary_values": "Motions between two ends, and periodic orbits.",
    "plugins": "The interface of plugins in C and C++, and what loads them.",
    "c_interface": "DiracStep for other languages.",
    "scene_format": "Scenes from text files, and the catalogue.",
    "validation": "Reference solutions, studies, and checks of methods and scenes.",
    "reports": "Studies as tables, pictures and pages.",
    "sweeps": "One scene for many parameters and starts.",
    "files": "Files that are written whole or not at all.",
}
INTRODUCTION = """\
Every header that is installed, by folder, with what is public in it. Names are in the namespace ``diracstep``. Most programs
include ``<diracstep/diracstep.hpp>`` and link ``DiracStep::diracstep``: core, constraints and solvers. Any header may be included
by its own name, as ``<diracstep/core/runs/run.hpp>``, with the library of its folder, ``DiracStep::core``. Misuse throws
``Misuse``, and every exception of the library is an ``Error``; a numerical failure is a report.

Start with :ref:`Scene <scene_8hpp>`, :ref:`Integrator <integrator_8hpp>` and :ref:`kinsol() <kinsol__solver_8hpp>`.
"""


def heading(text, mark="="):
    return f"{text}\n{mark * len(text)}\n\n"


def contents(pages, options=""):
    return ".. toctree::\n   :maxdepth: 1\n" + options + "\n" + "".join(f"   {page}\n" for page in pages) + "\n"


def names(file):
    """What a header declares, in its order: types first, then functions, each once."""
    found = [inner.text for inner in file.findall("innerclass") if "<" not in inner.text]
    found += [inner.text for inner in file.findall("innernamespace")]
    for kind in ("enum", "typedef", "function", "var", "define"):
        found += [m.findtext("name") for m in file.findall(f"sectiondef/memberdef[@kind='{kind}']")]
    return [name for name in dict.fromkeys(found) if name and not name.startswith("@")]


xml, out = map(pathlib.Path, sys.argv[1:])
headers = {folder: [] for folder in FOLDERS}
for path in sorted(xml.glob("*_8h*.xml")):
    file = ElementTree.parse(path).getroot().find("compounddef")
    location = file.find("location").get("file")
    declared = names(file)
    if not declared:
        continue
    folder = location.split("/")[0]
    page = out / pathlib.Path(location).with_suffix("")
    page.parent.mkdir(parents=True, exist_ok=True)
    page.with_suffix(".rst").write_text(
        f".. _{file.get('id')}:\n\n{heading(location)}"
        f".. code-block:: cpp\n\n   #include <diracstep/{location}>\n\n.. doxygenfile:: {location}\n", encoding="utf-8")
    shown = ", ".join(f"``{name}``" for name in declared[:6]) + (", …" if len(declared) > 6 else "")
    headers[folder].append((location, str(page.relative_to(out / folder)), file.get("id"), shown))

for folder, pages in headers.items():
    pages.sort()
    rows = "".join(f"   * - :ref:`{location} <{label}>`\n     - {shown}\n" for location, _, label, shown in pages)
    entries = [f"{location.split('/', 1)[1]} <{page}>" for location, page, *_ in pages]
    (out / folder / "index.rst").write_text(
        heading(folder) + FOLDERS[folder] + "\n\n.. list-table::\n   :widths: 40 60\n\n" + rows + "\n" +
        contents(entries, "   :hidden:\n"), encoding="utf-8")
(out / "index.rst").write_text(
    heading("Reference of the headers") + INTRODUCTION + "\n" +
    "".join(f"* :doc:`{folder}/index`: {what}\n" for folder, what in FOLDERS.items()) + "\n" +
    contents([f"{folder}/index" for folder in FOLDERS], "   :hidden:\n"),
    encoding="utf-8")
