# Each of the COMPONENTS, with commas between, of the package in PREFIX, asked for alone, brings what a program that links it needs.
file(REMOVE_RECURSE ${BUILD})
string(REPLACE "," ";" components "${COMPONENTS}")
foreach(component ${components})
  file(WRITE ${BUILD}/${component}/main.cpp "int main() {}\n")
  file(WRITE ${BUILD}/${component}/CMakeLists.txt "
cmake_minimum_required(VERSION 3.22)
project(components LANGUAGES CXX)
find_package(DiracStep REQUIRED CONFIG COMPONENTS ${component})
add_executable(program main.cpp)
target_link_libraries(program PRIVATE DiracStep::${component})
")
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${BUILD}/${component} -B ${BUILD}/${component}/build -G ${GENERATOR}
    -D CMAKE_PREFIX_PATH=${PREFIX} -D CMAKE_CXX_COMPILER=${COMPILER} OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endforeach()
