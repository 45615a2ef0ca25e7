"""The site of the documentation. The pages are the Markdown files of the repository, where they are; build.sh stages them."""
import os
import pathlib
import re

import furo

project = "DiracStep"
html_title = "DiracStep"
copyright = "the DiracStep authors, BSD-3-Clause"
language = "en"

extensions = ["myst_parser", "breathe"]
root_doc = "docs/README"
# The folders' own READMEs are for those who read the code; core's belongs to the mathematics.
exclude_patterns = ["core/*/**"] + [f"{path.name}/**" for path in pathlib.Path(__file__).parents[2].iterdir()
                                    if path.is_dir() and path.name not in ("core", "docs")]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
breathe_projects = {"DiracStep": os.environ["DIRACSTEP_XML"]}
breathe_default_project = "DiracStep"
breathe_show_include = False

# What is declared elsewhere: the standard library, Eigen, GoogleTest.
nitpick_ignore_regex = [
    ("cpp:.*", r"(std|Eigen|testing)\b.*|size_t|Clock::.*"),
    ("cpp:.*", r"(detail|scene_compiler|System|PointwiseMotion)\b.*|Integrator::@.*|DIRACSTEP_COUNTS_ALLOCATIONS"),  # no interface
]



def dark_colors():
    """Furo's own. Debian's build of its style sheet has them for the dark theme, but lacks the rule for systems set to dark."""
    style = (pathlib.Path(furo.__file__).parent / "theme/furo/static/styles/furo.css").read_text(encoding="utf-8")
    rule = re.search(r'body\[data-theme="?dark"?\]\s*{([^}]*)}', style)
    return dict(re.findall(r"--([\w-]+):\s*([^;}]+)", rule[1]))


html_theme = "furo"
html_theme_options = {"dark_css_variables": dark_colors()}
html_static_path = [os.environ["DIRACSTEP_STATIC"]]
html_css_files = ["katex.min.css", "site.css"]
html_js_files = [("katex.min.js", {"defer": "defer", "priority": 100})]
mathjax_path = "auto-render.js"  # KaTeX renders what Sphinx marks for MathJax
mathjax_options = {"defer": "defer", "onload": "renderMathInElement(document.body)"}
myst_update_mathjax = False
html_additional_pages = {"index": "to_first_page.html"}
templates_path = ["templates"]
html_copy_source = False
html_show_sphinx = False

NAVIGATION = {
    "Use": ["getting_started", "choosing_a_method", "scene_format", "bodies", "inputs_and_states", "events", "circuits", "fields", "parts", "manifolds", "equilibria", "sensitivities", "boundary_values", "optimal_control", "python",
            "solver_backend", "plugins", "adaptive", "sweeps", "safety"],
    "Understand": ["mathematics", "measuring", "orders", "at_error", "stability"],
    "More": ["Front page </README>", "/api/index", "/api/python", "/core/README", "/CONTRIBUTING", "/SECURITY", "/CHANGELOG"],
}


def add_navigation(app, docname, source):
    """The first page lists the others in Markdown; a code host has no use for the tree that the site's menu needs."""
    if docname == root_doc:
        for caption, pages in NAVIGATION.items():
            source[0] += "\n```{toctree}\n:hidden:\n:caption: " + caption + "\n\n" + "\n".join(pages) + "\n```\n"


def link_to_folder(app, env, node, contnode):
    """A code host shows a folder; the site has none to show, so the link's text stands alone."""
    folder = os.path.join(env.srcdir, os.path.dirname(env.doc2path(node.get("refdoc"), base=False)), node["reftarget"])
    return contnode if os.path.isdir(folder) else None


def setup(app):
    app.connect("missing-reference", link_to_folder)
    app.connect("source-read", add_navigation)
