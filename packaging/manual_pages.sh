#!/bin/sh
# manual_pages.sh COMMAND FOLDER: makes diracstep.1.gz and a page for each verb from what --help says.
set -eu
trap '[ $? -eq 0 ] || rm -rf "$2"' EXIT
here="$(dirname "$0")" folder="$2"
PATH="$(dirname "$1"):$PATH"
export PATH
rm -rf "$folder"
mkdir -p "$folder"
version="$(diracstep --version)"
verbs="$(diracstep --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\{1,\}\) .*/\1/p')"

page() { # TITLE SUMMARY COMMAND...
  title="$1" summary="$2"
  shift 2
  help2man --no-info --locale=C.UTF-8 --version-string="$version" --name="$summary" \
    --include="$here/manual.h2m" "$*" |
    sed -e "s/^\.TH DIRACSTEP /.TH $(echo "$title" | tr a-z A-Z) /" -e "/^\.SH NAME/,/^\.SH/s/^diracstep /$title /"
}

page diracstep "discrete Dirac mechanics: scenes, runs and studies" diracstep >"$folder/diracstep.1.part"
for verb in $verbs; do
  # The first line of its help, in one piece
  summary="$(diracstep "$verb" --help | sed '/^Usage:/,$d' | tr '\n' ' ' | sed 's/[: ]*$//')"
  page "diracstep-$verb" "$summary" diracstep "$verb" >"$folder/diracstep-$verb.1"
  printf '.BR diracstep\\-%s (1),\n' "$verb"
done | sed '$s/,$//' >"$folder/others"
{ cat "$folder/diracstep.1.part" && echo '.SH "SEE ALSO"' && cat "$folder/others"; } >"$folder/diracstep.1"
rm "$folder/diracstep.1.part" "$folder/others"
gzip -9n "$folder"/*.1
