# DIRACSTEP_SUNDIALS_SOURCE: a folder with the source of SUNDIALS 6.4 or newer. The parts that DiracStep uses are built
# from it with -O3, at configure time and once, and take the place of the system's library, which a
# distribution may have compiled without optimisation.
if(NOT EXISTS ${DIRACSTEP_SUNDIALS_SOURCE}/include/kinsol/kinsol.h)
  message(FATAL_ERROR "DIRACSTEP_SUNDIALS_SOURCE = '${DIRACSTEP_SUNDIALS_SOURCE}' is not a source folder of SUNDIALS: "
                      "it has no include/kinsol/kinsol.h.")
endif()
enable_language(C)
set(sundials_build ${PROJECT_BINARY_DIR}/sundials)
set(sundials_flags "-O3 -DNDEBUG")
set(sundials_stamp "${DIRACSTEP_SUNDIALS_SOURCE}\n${sundials_flags}\n${CMAKE_C_COMPILER}\n")
set(sundials_built "")
if(EXISTS ${sundials_build}/stamp)
  file(READ ${sundials_build}/stamp sundials_built)
endif()
if(NOT sundials_built STREQUAL sundials_stamp)
  message(STATUS "Building SUNDIALS from ${DIRACSTEP_SUNDIALS_SOURCE} (${sundials_flags})")
  file(REMOVE_RECURSE ${sundials_build})
  set(options -DCMAKE_BUILD_TYPE=Release "-DCMAKE_C_FLAGS_RELEASE=${sundials_flags}"
    -DCMAKE_C_COMPILER=${CMAKE_C_COMPILER} -DCMAKE_INSTALL_PREFIX=${sundials_build}/install
    -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_POSITION_INDEPENDENT_CODE=ON
    -DBUILD_SHARED_LIBS=OFF -DBUILD_STATIC_LIBS=ON -DBUILD_CVODE=OFF -DBUILD_CVODES=OFF -DBUILD_IDAS=OFF
    -DENABLE_MPI=OFF -DSUNDIALS_ENABLE_ERROR_CHECKS=OFF -DEXAMPLES_ENABLE_C=OFF -DEXAMPLES_INSTALL=OFF
    -DSUNDIALS_LOGGING_LEVEL=0)
  foreach(command "-S;${DIRACSTEP_SUNDIALS_SOURCE};-B;${sundials_build}/objects;${options}"
                  "--build;${sundials_build}/objects;--parallel;--target;install")
    execute_process(COMMAND ${CMAKE_COMMAND} ${command} RESULT_VARIABLE failed
      OUTPUT_FILE ${sundials_build}.log ERROR_FILE ${sundials_build}.log)
    if(failed)
      message(FATAL_ERROR "SUNDIALS could not be built; see ${sundials_build}.log")
    endif()
  endforeach()
  file(WRITE ${sundials_build}/stamp "${sundials_stamp}")
endif()
set(SUNDIALS_DIR ${sundials_build}/install/lib/cmake/sundials CACHE PATH "SUNDIALS as built from source" FORCE)
