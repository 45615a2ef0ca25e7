# Configures PROJECT with the options OFF (separated by |) switched off, builds all there is in BUILD, which goes
# afterwards, and runs the quick tests of the library.
cmake_policy(VERSION 3.22)
string(REPLACE "|" ";" OFF "${OFF}")
list(TRANSFORM OFF PREPEND -D OUTPUT_VARIABLE options)
list(TRANSFORM options APPEND =OFF)
file(REMOVE_RECURSE ${BUILD})
execute_process(COMMAND ${CMAKE_COMMAND} -S ${PROJECT} -B ${BUILD} -G ${GENERATOR} ${options}
  -D CMAKE_BUILD_TYPE=${CONFIG} -D CMAKE_CXX_COMPILER=${COMPILER} -D "CMAKE_CXX_FLAGS=${FLAGS}"
  -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} -D SUNDIALS_DIR=${SUNDIALS_DIR} -D DIRACSTEP_WARNINGS_AS_ERRORS=ON
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${BUILD} COMMAND_ERROR_IS_FATAL ANY)
if(NOT DIRACSTEP_BUILD_TESTS IN_LIST OFF)
  execute_process(COMMAND ${CMAKE_CTEST_COMMAND} --test-dir ${BUILD} --output-on-failure --no-tests=error
    -LE slow -R "^(core|constraints|solvers|eigenvalues|layering|package)[.]" COMMAND_ERROR_IS_FATAL ANY)
endif()
file(REMOVE_RECURSE ${BUILD})
