# How every target of the project is compiled.
# A second argument PRIVATE keeps the language standard from those that link it.
function(diracstep_compile_options target)
  set(scope PUBLIC)
  if(ARGC GREATER 1)
    set(scope ${ARGV1})
  endif()
  target_compile_features(${target} ${scope} cxx_std_20)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic
    # Clang takes a local name for one that hides another source's where folders are compiled whole
    $<$<NOT:$<AND:$<CXX_COMPILER_ID:Clang>,$<BOOL:${DIRACSTEP_UNITY_BUILD}>>>:-Wshadow>
    $<$<BOOL:${DIRACSTEP_WARNINGS_AS_ERRORS}>:-Werror>
    # GCC 12 warns of overlapping and endless copies in the concatenation of std::string where there are none, and of
    # parts of an empty std::function that nobody reads
    "$<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-restrict;-Wno-stringop-overflow;-Wno-array-bounds;-Wno-maybe-uninitialized>"
    # a*b+c is never fused: machines with and without FMA give the same bits
    -ffp-contract=off)
endfunction()

# The headers that nearly every source reads, compiled once for each of the kinds library, command and test: they take
# half of the time of a build.  Sources include what they use all the same: the preset tidy compiles without them, so
# ./dev tidy shows it.
set(diracstep_headers_library <Eigen/Core> <algorithm> <array> <cmath> <functional> <limits> <map> <memory> <optional>
  <span> <sstream> <string> <utility> <vector>)
set(diracstep_headers_command ${diracstep_headers_library} <CLI/App.hpp> <CLI/Config.hpp> <CLI/Formatter.hpp>
  <fmt/format.h>)
set(diracstep_headers_test ${diracstep_headers_library} <gtest/gtest.h>)
# They are read with the flags of their sources.
set(diracstep_headers_unoptimised_command ${diracstep_headers_command})
set(diracstep_headers_unoptimised_test ${diracstep_headers_test})

# Where DIRACSTEP_UNOPTIMISED_TESTS says so, the target is compiled without optimisation, which takes half the time.
function(diracstep_leave_unoptimised target)
  if(DIRACSTEP_UNOPTIMISED_TESTS)
    target_compile_options(${target} PRIVATE -O0)
  endif()
endfunction()

# diracstep_precompile(<target> <kind> [<libraries>...]); the libraries are those of the kind's headers.
function(diracstep_precompile target kind)
  if(NOT DIRACSTEP_PRECOMPILED_HEADERS)
    return()
  endif()
  set(common diracstep_headers_of_${kind})
  if(NOT TARGET ${common})
    set(source ${PROJECT_BINARY_DIR}/${common}.cpp)
    if(kind MATCHES test)  # position independent as programs are
      file(CONFIGURE OUTPUT ${source} CONTENT "int main() {}\n")
      add_executable(${common} EXCLUDE_FROM_ALL ${source})
    else()
      file(CONFIGURE OUTPUT ${source} CONTENT "")
      add_library(${common} OBJECT EXCLUDE_FROM_ALL ${source})
    endif()
    target_link_libraries(${common} PRIVATE Eigen3::Eigen ${ARGN})
    diracstep_compile_options(${common})
    if(kind MATCHES unoptimised)
      diracstep_leave_unoptimised(${common})
    endif()
    target_precompile_headers(${common} PRIVATE ${diracstep_headers_${kind}})
  endif()
  target_precompile_headers(${target} REUSE_FROM ${common})
endfunction()

# The sources of a folder are compiled as one, which instantiates what they share once: half the compiler's time.
# Names in unnamed namespaces are therefore unique within a folder.
function(diracstep_compile_folders_whole target)
  if(NOT DIRACSTEP_UNITY_BUILD)
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_filename_component(folder ${source} DIRECTORY)
    file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${folder})
    string(MAKE_C_IDENTIFIER "${folder}" group)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()

# Installs a library and its targets file: shared objects belong to the component library, all else to development.
function(diracstep_install_library target component)
  install(TARGETS ${target} EXPORT diracstep_${component} ARCHIVE COMPONENT development
    LIBRARY COMPONENT library NAMELINK_COMPONENT development)
  install(EXPORT diracstep_${component} NAMESPACE DiracStep:: FILE DiracStep-${component}.cmake
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/DiracStep)
endfunction()

# Installs the headers that <folder>/public_headers.txt lists; the others are of use to the library only.
function(diracstep_install_headers folder)
  set(list ${CMAKE_CURRENT_SOURCE_DIR}/public_headers.txt)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${list})
  file(STRINGS ${list} headers REGEX "^[^#]")
  foreach(header IN LISTS headers)
    get_filename_component(directory ${header} DIRECTORY)
    install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/diracstep/${folder}/${directory})
  endforeach()
endfunction()

# diracstep_library(<folder> SOURCES ... PUBLIC ... PRIVATE ...)
# Makes diracstep_<folder>, alias DiracStep::<folder>, and installs it with its public headers.
# A folder without sources becomes a header-only library.
function(diracstep_library folder)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;PUBLIC;PRIVATE")
  set(target diracstep_${folder})
  if(arg_SOURCES)
    set(scope PUBLIC)
    add_library(${target} ${arg_SOURCES})
    target_link_libraries(${target} PRIVATE ${arg_PRIVATE})
    diracstep_compile_options(${target})
    diracstep_precompile(${target} library)
    diracstep_compile_folders_whole(${target})
    set_target_properties(${target} PROPERTIES VERSION ${PROJECT_VERSION} INSTALL_RPATH $ORIGIN
      SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  else()
    set(scope INTERFACE)
    add_library(${target} INTERFACE)
    target_compile_features(${target} INTERFACE cxx_std_20)
  endif()
  add_library(DiracStep::${folder} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${folder})
  target_link_libraries(${target} ${scope} ${arg_PUBLIC})

  # Each library has an include root of its own, which holds only diracstep/<folder>. A file that includes
  # a folder its library does not link therefore fails to compile.
  set(include_root ${PROJECT_BINARY_DIR}/include/${folder})
  file(MAKE_DIRECTORY ${include_root}/diracstep)
  file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR} ${include_root}/diracstep/${folder} SYMBOLIC)
  target_include_directories(${target} ${scope}
    $<BUILD_INTERFACE:${include_root}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)

  diracstep_install_library(${target} ${folder})
  diracstep_install_headers(${folder})
endfunction()
