#!/bin/sh
# build.sh OUT: the site of the documentation in OUT, from the Markdown pages and the public headers. Any warning fails.
# Needs doxygen, sphinx with myst-parser, breathe and furo, and KaTeX (Debian: libjs-katex) in /usr/share/javascript.
set -eu
site="$(cd "$(dirname "$0")" && pwd)"
SOURCES="$(cd "$site/../.." && pwd)"
mkdir -p "$1"
out="$(cd "$1" && pwd)"
work="$out.work"
katex="${DIRACSTEP_KATEX:-/usr/share/javascript/katex}"
rm -rf "$out" "$work"
mkdir -p "$work/source" "$work/static"

# The pages and what they link to, under the names they have in the repository.
for entry in "$SOURCES"/*; do
  case "$(basename "$entry")" in build) ;; *) ln -s "$entry" "$work/source" ;; esac
done
ln -s "$katex/katex.min.css" "$katex/katex.min.js" "$katex/contrib/auto-render.js" "$katex/fonts" \
  "$site/site.css" "$work/static"

# The headers that are installed; formula_system.hpp is a part of plugin.hpp.
HEADERS="$SOURCES/library/diracstep.hpp $SOURCES/c_interface/diracstep.h"
for list in "$SOURCES"/*/public_headers.txt; do
  HEADERS="$HEADERS $(sed "/^#/d; /^formula_system/d; s|^|$(dirname "$list")/|" "$list" | tr '\n' ' ')"
done
READABLE_HEADER="$site/readable_header.py" OUTPUT="$work"
export SOURCES HEADERS READABLE_HEADER OUTPUT
doxygen "$site/Doxyfile"
python3 "$site/public_members.py" "$work/xml"
mkdir "$work/source/api"
python3 "$site/reference_pages.py" "$work/xml" "$work/source/api"
python3 "$site/python_pages.py" "$SOURCES/python/diracstep" "$work/source/api/python.rst"

DIRACSTEP_XML="$work/xml" DIRACSTEP_STATIC="$work/static" \
  sphinx-build -q -W -n --keep-going -c "$site" -d "$work/doctrees" "$work/source" "$out"
rm -rf "$work"

# Debian's Furo takes the rules of normalize.css from the web server's root: here they stand in its own style sheet.
normalize="${DIRACSTEP_NORMALIZE:-/usr/share/javascript/normalize.css/normalize.css}"
furo="$out/_static/styles/furo.css"
if grep -q '^@import url(/javascript/normalize' "$furo"; then
  { cat "$normalize" && sed 's|^@import url(/javascript/normalize[^;]*;||' "$furo"; } >"$furo.new"
  mv "$furo.new" "$furo"
fi
python3 "$site/excerpts.py" "$out"

# Debian's furo.js imports its second script as a module does, but no page loads it as one: both as one file.
scripts="$out/_static/scripts"
if grep -q '^import Gumshoe' "$scripts/furo.js"; then
  sed '/^import Gumshoe/d' "$scripts/furo.js" >>"$scripts/gumshoe-patched.js"
  mv "$scripts/gumshoe-patched.js" "$scripts/furo.js"
fi
echo "$out/index.html"
