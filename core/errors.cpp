#include <diracstep/core/errors.hpp>

namespace diracstep {

void require_size(const std::string& what, long size, long expected) {
  if (size == expected) return;
  throw Misuse(what + " has " + std::to_string(size) + " entries; expected " + std::to_string(expected));
}

}  // namespace diracstep
