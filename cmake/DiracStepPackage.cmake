# What makes the installed tree usable: find_package(DiracStep) and pkg-config. It may be moved as a whole.
include(CMakePackageConfigHelpers)
set(cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/DiracStep)

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/DiracStepConfig.cmake.in
  ${PROJECT_BINARY_DIR}/DiracStepConfig.cmake INSTALL_DESTINATION ${cmake_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/DiracStepConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/DiracStepConfig.cmake ${PROJECT_BINARY_DIR}/DiracStepConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/DiracStepKLU.cmake ${PROJECT_SOURCE_DIR}/cmake/DiracStepIpopt.cmake
        DESTINATION ${cmake_dir})

# pkg_config_file(<file> <description> LIBS <ours>... [REQUIRES <files>...]
#                 [PRIVATE_LIBS <theirs>...] [PRIVATE_REQUIRES <files>...])
# A static library of ours needs what it uses on the link line; a shared one brings it along.
function(pkg_config_file pc_name pc_description)
  cmake_parse_arguments(PARSE_ARGV 2 pc "" "" "LIBS;REQUIRES;PRIVATE_LIBS;PRIVATE_REQUIRES")
  foreach(kind LIBS REQUIRES)
    if(NOT BUILD_SHARED_LIBS)
      list(APPEND pc_${kind} ${pc_PRIVATE_${kind}})
      set(pc_PRIVATE_${kind} "")
    endif()
  endforeach()
  list(TRANSFORM pc_LIBS PREPEND -l)
  list(TRANSFORM pc_PRIVATE_LIBS PREPEND -l)
  foreach(list LIBS REQUIRES PRIVATE_LIBS PRIVATE_REQUIRES)
    list(JOIN pc_${list} " " pc_${list})
  endforeach()
  file(RELATIVE_PATH pc_prefix /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/diracstep.pc.in ${PROJECT_BINARY_DIR}/${pc_name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${pc_name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endfunction()

function(sundials_libraries variable)  # components in the order of linking, and what all of them need
  set(components ${ARGN})
  if(TARGET SUNDIALS::core)  # SUNDIALS 7 and newer
    list(APPEND components core)
  endif()
  list(TRANSFORM components PREPEND sundials_)
  set(${variable} ${components} PARENT_SCOPE)
endfunction()

sundials_libraries(solver_libraries ${DIRACSTEP_SOLVERS_SUNDIALS})
if(DIRACSTEP_WITH_KLU)
  list(APPEND solver_libraries klu)
endif()
if(DIRACSTEP_WITH_IPOPT)
  list(APPEND solver_libraries ipopt)
endif()
pkg_config_file(diracstep "${PROJECT_DESCRIPTION}" REQUIRES eigen3
  LIBS diracstep_boundary_values diracstep_sensitivities diracstep_eigenvalues diracstep_solvers diracstep_constraints diracstep_core PRIVATE_LIBS ${solver_libraries} pthread)
if(DIRACSTEP_BUILD_PLUGINS)
  pkg_config_file(diracstep-plugins "DiracStep: plugins, written and loaded" REQUIRES diracstep
    LIBS diracstep_plugins PRIVATE_LIBS ${CMAKE_DL_LIBS})
endif()
if(DIRACSTEP_BUILD_VALIDATION)
  sundials_libraries(validation_libraries ${DIRACSTEP_VALIDATION_SUNDIALS})
  pkg_config_file(diracstep-validation "DiracStep: scenes, references, studies and sweeps" REQUIRES diracstep-plugins
    LIBS diracstep_sweeps diracstep_reports diracstep_validation diracstep_scene_format diracstep_files
    PRIVATE_LIBS ${validation_libraries} PRIVATE_REQUIRES fmt tomlplusplus)
endif()
if(DIRACSTEP_BUILD_C_INTERFACE)
  pkg_config_file(libdiracstep "DiracStep for C and languages that can call C" LIBS diracstep)
endif()

# What explains it: pages and scenes with the command, examples with the headers.  A package may have folders of its own.
set(DIRACSTEP_EXAMPLES_DIR ${CMAKE_INSTALL_DATADIR}/doc/diracstep CACHE STRING "Where the folder examples/ is installed")
mark_as_advanced(DIRACSTEP_EXAMPLES_DIR)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples DESTINATION ${DIRACSTEP_EXAMPLES_DIR} COMPONENT development
        PATTERN notebooks EXCLUDE)
set(documents ${CMAKE_INSTALL_DATADIR}/doc/diracstep)
install(FILES ${PROJECT_SOURCE_DIR}/README.md DESTINATION ${documents} COMPONENT command)
if(NOT DIRACSTEP_DEBIAN_PACKAGES)  # they have a file copyright
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${documents} COMPONENT command)
endif()
install(FILES ${PROJECT_SOURCE_DIR}/core/README.md DESTINATION ${documents}/core COMPONENT command)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs ${PROJECT_SOURCE_DIR}/scenes DESTINATION ${documents} COMPONENT command
        PATTERN site EXCLUDE)
