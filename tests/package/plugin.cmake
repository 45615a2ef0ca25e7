# Builds SOURCE, the example plugins, against PREFIX, and has the installed command and their own test check them.
file(REMOVE_RECURSE ${BUILD})
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${BUILD} -G ${GENERATOR}
  -D CMAKE_PREFIX_PATH=${PREFIX} -D CMAKE_BUILD_TYPE=${CONFIG}
  -D CMAKE_CXX_COMPILER=${COMPILER} -D "CMAKE_CXX_FLAGS=${FLAGS}"
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${BUILD} COMMAND_ERROR_IS_FATAL ANY)
set(plugins ${BUILD}/harmonic.so ${BUILD}/galerkin.so)
execute_process(COMMAND ${BUILD}/plugin_test ${plugins} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PREFIX}/bin/diracstep check --plugin ${BUILD}/harmonic.so --plugin ${BUILD}/galerkin.so
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PREFIX}/bin/diracstep run two_springs --plugin ${BUILD}/harmonic.so --method type1/harmonic
                COMMAND_ERROR_IS_FATAL ANY)
