# What makes the installed tree usable: find_package(DiracStep) and pkg-config.
include(CMakePackageConfigHelpers)
set(cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/DiracStep)

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/DiracStepConfig.cmake.in
  ${PROJECT_BINARY_DIR}/DiracStepConfig.cmake INSTALL_DESTINATION ${cmake_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/DiracStepConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)

# pkg-config: core, constraints and solvers, and what the solvers need
set(pc_libs -ldiracstep_solvers)
get_target_property(type diracstep_constraints TYPE)
if(NOT type STREQUAL INTERFACE_LIBRARY)
  list(APPEND pc_libs -ldiracstep_constraints)
endif()
list(APPEND pc_libs -ldiracstep_core)
foreach(component IN LISTS DIRACSTEP_SOLVERS_SUNDIALS)
  list(APPEND pc_libs -lsundials_${component})
endforeach()
if(DIRACSTEP_WITH_KLU)
  list(APPEND pc_libs -lklu)
endif()
list(JOIN pc_libs " " pc_libs)
file(RELATIVE_PATH pc_prefix /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
configure_file(${PROJECT_SOURCE_DIR}/cmake/diracstep.pc.in ${PROJECT_BINARY_DIR}/diracstep.pc @ONLY)

install(FILES ${PROJECT_BINARY_DIR}/DiracStepConfig.cmake ${PROJECT_BINARY_DIR}/DiracStepConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/DiracStepKLU.cmake DESTINATION ${cmake_dir})
install(FILES ${PROJECT_BINARY_DIR}/diracstep.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
