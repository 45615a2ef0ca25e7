# Compiles '#include <HEADER>' with DIRECTORIES; EXPECTED is allowed or forbidden.
file(WRITE ${SOURCE} "#include <${HEADER}>\n")
string(REPLACE "|" ";" directories "${DIRECTORIES}")
list(TRANSFORM directories PREPEND -I)
set(ENV{LC_ALL} C)
execute_process(COMMAND ${COMPILER} -std=c++20 -fsyntax-only ${directories} ${SOURCE}
                RESULT_VARIABLE status ERROR_VARIABLE messages)

if(EXPECTED STREQUAL allowed AND NOT status EQUAL 0)
  message(FATAL_ERROR "${HEADER} should compile here, but:\n${messages}")
endif()
if(EXPECTED STREQUAL forbidden AND status EQUAL 0)
  message(FATAL_ERROR "${HEADER} is visible where it must not be (directories: ${directories})")
endif()
if(EXPECTED STREQUAL forbidden AND NOT messages MATCHES "${HEADER}(: No such file|' file not found)")
  message(FATAL_ERROR "expected '${HEADER}: No such file', but:\n${messages}")
endif()
