#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace diracstep {

struct CodePoint {
  std::uint32_t value;
  std::size_t bytes;  ///< 0: no UTF-8
};

/// The code point at the beginning of a text that is not empty; overlong forms and surrogates are no UTF-8.
CodePoint first_code_point(std::string_view text);

}  // namespace diracstep
