#!/usr/bin/env python3
"""site_links.py SITE: every local link and picture of the built site exists, with its anchor, and nothing is fetched from a network."""
import html.parser
import pathlib
import re
import sys
import urllib.parse


class Page(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.anchors, self.targets, self.fetched = {""}, [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.anchors.update(value for key in ("id", "name") if (value := values.get(key)))
        target = values.get("href" if tag in ("a", "link") else "src")
        if not target:
            return
        if urllib.parse.urlparse(target).scheme == "":
            self.targets.append(target)
        elif tag != "a":
            self.fetched.append(target)


site = pathlib.Path(sys.argv[1]).resolve()
pages = {path: Page(path) for path in site.rglob("*.html")}
faults, count = [], 0
for path, page in pages.items():
    faults += [f"{path}: fetches {target}" for target in page.fetched]
    for target in page.targets:
        place = urllib.parse.urlparse(target)
        file = (path.parent / urllib.parse.unquote(place.path)).resolve() if place.path else path
        count += 1
        if not file.exists():
            faults.append(f"{path}: dead link {target}")
        elif file in pages and urllib.parse.unquote(place.fragment) not in pages[file].anchors:
            faults.append(f"{path}: no such place {target}")
for sheet in site.rglob("*.css"):  # what a style sheet takes in beside the pages: fonts, other sheets
    for target in re.findall(r"""url\(\s*["']?([^"')]+)""", sheet.read_text(encoding="utf-8")):
        place = urllib.parse.urlparse(target)
        if place.scheme == "data":
            continue
        if place.scheme or target.startswith("/"):
            faults.append(f"{sheet}: fetches {target}")
        elif not (sheet.parent / urllib.parse.unquote(place.path)).exists():
            faults.append(f"{sheet}: lacks {target}")
print(f"{len(pages)} pages, {count} links")
sys.exit("\n".join(faults) or (0 if count > 1000 else "hardly any links: is this the site?"))
