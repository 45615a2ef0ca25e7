#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace diracstep {

/// SHA-256 (FIPS 180-4, sections 5 and 6.2) of bytes that come in pieces of any size.
class Sha256 {
 public:
  Sha256& add(std::string_view bytes);
  /// 64 hexadecimal digits; ends the sum.
  std::string hex();

 private:
  void take_block(const unsigned char* block);

  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> block_{};
  std::uint64_t size_ = 0;  ///< bytes so far
};

/// Of one text.
std::string sha256(std::string_view bytes);

}  // namespace diracstep
