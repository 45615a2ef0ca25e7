"""excerpts.py SITE: the words of every page as a script, so that the search shows excerpts where pages are files.

Sphinx's search fetches each page it found, which a browser refuses where no server is.  The script answers instead.
"""
import html.parser
import json
import pathlib
import sys

SILENT = {"script", "style", "nav", "noscript"}  # and the marks of links to headings


class Words(html.parser.HTMLParser):
    """The text inside the element of the role main."""

    def __init__(self):
        super().__init__()
        self.depth, self.silent, self.words = 0, 0, []

    def handle_starttag(self, tag, attrs):
        if self.depth == 0:
            self.depth = 1 if dict(attrs).get("role") == "main" else 0
        elif tag not in {"br", "img", "hr", "input", "meta", "link", "wbr"}:
            self.depth += 1
            self.silent += self.silent > 0 or tag in SILENT or "headerlink" in (dict(attrs).get("class") or "")

    def handle_endtag(self, tag):
        if self.depth > 0:
            self.depth -= 1
            self.silent -= self.silent > 0

    def handle_data(self, data):
        if self.depth > 0 and self.silent == 0:
            self.words.append(data)


site = pathlib.Path(sys.argv[1])
texts = {}
for page in sorted(site.rglob("*.html")):
    words = Words()
    words.feed(page.read_text(encoding="utf-8"))
    texts[str(page.relative_to(site))] = " ".join("".join(words.words).split())
script = """(() => {
  const texts = %s, root = new URL('..', document.currentScript.src).href, fetched = window.fetch;
  const escaped = text => text.replace(/&/g, '&amp;').replace(/</g, '&lt;');
  window.fetch = (url, ...rest) => {
    const text = texts[decodeURI(new URL(url, location.href).href).replace(decodeURI(root), '').split(/[?#]/)[0]];
    return text === undefined ? fetched(url, ...rest)
      : Promise.resolve(new Response(`<div role="main">${escaped(text)}</div>`));
  };
})();
"""
(site / "_static" / "excerpts.js").write_text(script % json.dumps(texts), encoding="utf-8")
