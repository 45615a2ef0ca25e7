# Debian packages by CPack: libdiracstep0.1 (the C interface, shared), libdiracstep-dev (headers, the C++ libraries,
# static, CMake and pkg-config files, examples), diracstep (the command) and python3-diracstep. `./dev package` builds them.
# The environment variables DEBFULLNAME and DEBEMAIL name the maintainer, as they do for Debian's own tools.
set(maintainer "The DiracStep authors <diracstep@localhost>")
if(DEFINED ENV{DEBFULLNAME} AND DEFINED ENV{DEBEMAIL})
  set(maintainer "$ENV{DEBFULLNAME} <$ENV{DEBEMAIL}>")
endif()
set(version ${PROJECT_VERSION}-1)
set(library libdiracstep${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "${maintainer}")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # every package has its own
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL library development command python)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_LIST_DIR}/triggers)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(about "Discrete Dirac mechanics after Leok and Ohsawa: structure-preserving
time stepping for mechanical and electrical systems with nonholonomic,
holonomic, degenerate and interconnection constraints.")
# debian_package(<component> <package> <section> <one line> <what this one holds>)
macro(debian_package component package section line holds)
  string(TOUPPER ${component} COMPONENT)
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_NAME ${package})
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_SECTION ${section})
  set(CPACK_COMPONENT_${COMPONENT}_DESCRIPTION "${line}\n${about}\n\n${holds}")
  set(documents ${CMAKE_INSTALL_DATADIR}/doc/${package})
  install(FILES ${CMAKE_CURRENT_LIST_DIR}/copyright DESTINATION ${documents} COMPONENT ${component})
  install(FILES ${debian_changelog} DESTINATION ${documents} COMPONENT ${component})
endmacro()

string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH, where it is set
set(debian_changelog ${PROJECT_BINARY_DIR}/changelog.Debian.gz)
file(WRITE ${PROJECT_BINARY_DIR}/changelog.Debian "diracstep (${version}) unstable; urgency=medium

  * Release ${PROJECT_VERSION}; CHANGELOG.md of the project says what is in it.

 -- ${maintainer}  ${date}
")
execute_process(COMMAND gzip -9nc ${PROJECT_BINARY_DIR}/changelog.Debian OUTPUT_FILE ${debian_changelog}
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND gzip -9nc ${PROJECT_SOURCE_DIR}/CHANGELOG.md OUTPUT_FILE ${PROJECT_BINARY_DIR}/changelog.gz
                COMMAND_ERROR_IS_FATAL ANY)

debian_package(library ${library} libs "discrete Dirac mechanics, C interface"
  "This is libdiracstep, for programs in C and languages that can call C.")
debian_package(development libdiracstep-dev libdevel "discrete Dirac mechanics, development files"
  "These are the headers, the C++ libraries, CMake and pkg-config files,\nand examples.")
set(ipopt "")
if(DIRACSTEP_WITH_IPOPT)
  set(ipopt ", coinor-libipopt-dev")
endif()
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${library} (= ${version}), libeigen3-dev (>= 3.4), \
libsundials-dev (>= 6.4), libsuitesparse-dev, libfmt-dev, libtomlplusplus-dev${ipopt}")
debian_package(command diracstep math "discrete Dirac mechanics, the command"
  "This is the command diracstep: scenes, runs, convergence and stability\nstudies.")
set(CPACK_DEBIAN_COMMAND_PACKAGE_RECOMMENDS "gcc, libc6-dev, gnuplot-nox")  # scene files are compiled, studies plotted
set(CPACK_DEBIAN_COMMAND_PACKAGE_SUGGESTS "libdiracstep-dev")

debian_package(python python3-diracstep python "discrete Dirac mechanics, Python 3"
  "This is the Python package: scenes from functions that are traced, runs as\nNumPy arrays, studies.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3:any (>= 3.9), python3-numpy (>= 1:1.22), ${library} (>= ${version})")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "gcc, libc6-dev, python3-matplotlib")  # scenes are compiled, runs drawn
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "diracstep, python3-pandas, python3-tqdm")  # the command makes studies
foreach(script postinst prerm)  # byte code, as Debian's packages of Python have it
  configure_file(${CMAKE_CURRENT_LIST_DIR}/python.${script} ${PROJECT_BINARY_DIR}/python/${script} COPYONLY)
  list(APPEND CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${PROJECT_BINARY_DIR}/python/${script})
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/python/diracstep DESTINATION lib/python3/dist-packages COMPONENT python
        FILES_MATCHING PATTERN "*.py" PATTERN "py.typed" PATTERN "__pycache__" EXCLUDE)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples/notebooks ${PROJECT_SOURCE_DIR}/examples/differentiation
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-diracstep COMPONENT python
        FILES_MATCHING PATTERN "*.ipynb" PATTERN "*.py")
install(FILES ${PROJECT_BINARY_DIR}/changelog.gz DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/diracstep COMPONENT command)
include(CPack)
