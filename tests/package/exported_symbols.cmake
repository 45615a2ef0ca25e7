# LIBRARY exports exactly the functions that HEADER declares, all under one version.
file(READ ${HEADER} header)
string(REGEX MATCHALL "DIRACSTEP_API [^;(]*[ *]diracstep_[a-z_]+\\(" declarations "${header}")
list(TRANSFORM declarations REPLACE ".*[ *](diracstep_[a-z_]+)\\($" "\\1")
list(LENGTH declarations count)
list(SORT declarations)

execute_process(COMMAND ${NM} -D --defined-only ${LIBRARY} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX REPLACE "[0-9a-f]+ A DIRACSTEP_[^\n]*\n" "" symbols "${symbols}")  # the version itself
string(REGEX MATCHALL "[^\n]+" symbols "${symbols}")
list(TRANSFORM symbols REPLACE "^[0-9a-f]+ [A-Za-z] " "")
list(SORT symbols)

list(TRANSFORM declarations APPEND "@@${VERSION}")
if(count LESS 6 OR NOT symbols STREQUAL declarations)
  message(FATAL_ERROR "declared in ${HEADER}:\n  ${declarations}\nexported by ${LIBRARY}:\n  ${symbols}")
endif()
