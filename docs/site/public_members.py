"""public_members.py XML: takes what is private out of Doxygen's XML, so that no page shows it.

A class is documented by what its users may call; EXTRACT_ALL, without which structures that have no comment of their own
would be missing, lets private members in.
"""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree




def is_private(element):
    anonymous = element.tag == "innerclass" and "@" in (element.text or "")
    return anonymous or element.get("prot") == "private" or element.get("kind", "").startswith("private-")


def remove_private(parent, removed):
    """Takes out what is private below `parent`; its identifiers are added to `removed`."""
    for child in list(parent):
        if is_private(child):
            removed.update(element.get("id") for element in child.iter() if element.get("id"))
            parent.remove(child)
        else:
            remove_private(child, removed)


trees = {path: ElementTree.parse(path) for path in pathlib.Path(sys.argv[1]).glob("*.xml")}
removed = set()
for tree in trees.values():
    compound = tree.getroot().find("compounddef")
    if compound is not None:  # the index has none
        remove_private(compound, removed)
for path, tree in trees.items():
    for reference in tree.getroot().iter("ref"):
        if reference.get("refid") in removed:  # a comment may name it still
            reference.tag = "computeroutput"
            reference.attrib.clear()
    tree.write(path, encoding="utf-8", xml_declaration=True)
