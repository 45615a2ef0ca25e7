# From the results of ctest --output-junit: one line for each test that was skipped, with its reason.
/<testcase / {
  name = $0
  sub(/.*<testcase name="/, "", name)
  sub(/".*/, "", name)
  skipped = $0 ~ /status="disabled"/
  reason = skipped ? "disabled" : ""
}
/<skipped / { skipped = 1 }
after_skip { reason = $0; after_skip = 0 }
/: Skipped$/ { after_skip = 1 }
/not checked: / { reason = $0; sub(/.*not checked: /, "", reason) }
/<\/testcase>/ {
  gsub(/&lt;/, "<", reason); gsub(/&gt;/, ">", reason); gsub(/&quot;/, "\"", reason); gsub(/&amp;/, "\\&", reason)
  if (skipped) print "not checked: " name ": " (reason == "" ? "no reason given" : reason)
  skipped = 0
}
