#!/bin/sh
# in_a_bare_root.sh PROJECT FOLDER: the Debian packages of PROJECT, tried in a bare Debian in FOLDER.
set -eu
[ "$(id -u)" -eq 0 ] || { echo "not checked: the packages in a bare root: this is not root"; exit 0; }
mkdir -p "$2"
# shellcheck disable=SC2046  # one path a line, without blanks
"$1/packaging/debian/try_packages" "$2" $("$1/dev" package)
