# Splits a Markdown page into its fenced code blocks, for run_page.sh.  Block N of language L goes to OUT/N.L, and
# the line "N L MARK ARGUMENT" to standard output.  MARK is the comment on the line above the block:
#   (none)                   run: it is compiled, run or loaded, as its language says
#   <!-- slow -->            slow: run with the slow tests only
#   <!-- file: NAME -->      file: saved as NAME for the blocks that follow
#   <!-- added to: SCENE --> added: more of the scene of that name, which an earlier block holds
#   <!-- not run: WHY -->    not-run: for a reason that the page's source states
# Blocks without a language, or of language "text", are no code.
function refuse(why) {
  print FILENAME ":" FNR ": " why > "/dev/stderr"
  failed = 1
}

!open && /^<!-- (slow|added to:.*|file:.*|not run:.*) -->$/ {
  mark = $2; argument = ""
  if ($2 == "not") { mark = "not-run"; argument = $4 }
  if ($2 == "file:") { mark = "file"; argument = $3 }
  if ($2 == "added") argument = $4
  if (mark != "slow" && argument == "-->") refuse("'" $0 "' lacks its reason or name")
  marked = FNR
  next
}

!open && /^ *```+/ {
  open = 1
  language = $0
  sub(/^ *```+ */, "", language)
  if (mark != "" && marked != FNR - 1) refuse("the comment '" mark "' must stand right above its block")
  if (mark == "") mark = "run"
  code = language != "" && language != "text"
  if (code) {
    name = sprintf("%s/%02d.%s", OUT, ++blocks, language)
    printf "" > name
    print blocks, language, mark, argument
  }
  next
}

open && /^ *```+ *$/ {
  if (code) close(name)
  open = 0; mark = ""
  next
}

open { if (code) print > name; next }

/^ *~~~/ { refuse("fence blocks with ```") }

/^    ( *)(\.\/dev |diracstep |cmake |#include|\[\[?[a-z_]+\]\]? *$|[a-z_]+ = ")/ {
  refuse("code in an indented block, which no test sees: fence it")
}

END {
  if (open) refuse("a block is not closed")
  exit failed
}
