# A program that links core and solvers must not load anything of validation.
execute_process(COMMAND ldd ${BUILD}/${NAME} OUTPUT_VARIABLE libraries COMMAND_ERROR_IS_FATAL ANY)
message("${libraries}")
if(libraries MATCHES "lib(sundials_(ida|cvode|arkode)|diracstep_(validation|plugins)|fmt|tomlplusplus)[^ ]*")
  message(FATAL_ERROR "${NAME} loads ${CMAKE_MATCH_0}, which only validation needs")
endif()
