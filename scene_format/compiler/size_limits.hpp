#pragma once

#include <cstddef>

namespace diracstep::scene_compiler {

/// How large a scene file and what is made of it may be: a small file can describe a system that no machine
/// holds.  More is refused with a SceneError before memory is taken for it.
struct SizeLimits {
  std::size_t file_bytes = 16'000'000;
  std::size_t key_parts = 16;         ///< of a dotted key, a.b.c
  std::size_t graph_nodes = 300'000;  ///< of all formulas and their derivatives; one more for each byte read
  std::size_t graph_visits =
      300'000'000;                  ///< of their nodes, in searches and differentiation: the time it takes
  std::size_t sum_terms = 100'000;  ///< addends that one function is taken apart into
  std::size_t derivatives = 4'000'000;  ///< of one piece: outputs times coordinates
  std::size_t repeated = 20'000'000;    ///< turns of the loops of one piece
  std::size_t entries = 200'000'000;  ///< of the tables of one piece: turns times coordinates and derivatives
  std::size_t coordinates = 2'000'000;
  std::size_t source_bytes = 4'000'000;  ///< of C code that is handed to a compiler; more is interpreted
};

/// The limits above, with those changed that $DIRACSTEP_LIMITS names: "sum_terms=1000000,file_bytes=1e8".
/// Throws Misuse, with the names allowed, for any other.
SizeLimits size_limits();

}  // namespace diracstep::scene_compiler
