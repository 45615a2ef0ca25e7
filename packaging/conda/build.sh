#!/bin/bash
# The conda build: CMAKE_ARGS, PREFIX and CPU_COUNT come from the build tool.
set -eux
# shellcheck disable=SC2086
cmake ${CMAKE_ARGS:-} -G Ninja -S . -B build/conda \
  -D CMAKE_BUILD_TYPE=Release \
  -D CMAKE_INSTALL_PREFIX="$PREFIX" \
  -D CMAKE_INSTALL_LIBDIR=lib \
  -D BUILD_SHARED_LIBS=ON \
  -D DIRACSTEP_BUILD_TESTS=OFF \
  -D DIRACSTEP_BUILD_BENCHMARKS=OFF
cmake --build build/conda --parallel "${CPU_COUNT:-1}"
cmake --install build/conda
