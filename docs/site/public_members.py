"""public_members.py XML: takes what is private out of Doxygen's XML, so that no page shows it.

A class is documented by what its users may call; EXTRACT_ALL, without which structures that have no comment of their own
would be missing, lets private members in.
"""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def remove_private(parent):
    for child in list(parent):
        if child.get("prot") == "private" or child.get("kind", "").startswith("private-"):
            parent.remove(child)
        else:
            remove_private(child)


for path in pathlib.Path(sys.argv[1]).glob("*.xml"):
    tree = ElementTree.parse(path)
    compound = tree.getroot().find("compounddef")
    if compound is not None:  # the index has none
        remove_private(compound)
        tree.write(path, encoding="utf-8", xml_declaration=True)
