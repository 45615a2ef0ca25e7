#include <fmt/format.h>

#include <cstdint>
#include <diracstep/files/shown_text.hpp>
#include <iterator>

namespace diracstep {

namespace {

struct CodePoint {
  std::uint32_t value;
  std::size_t bytes;  ///< 0: no UTF-8
};

/// The code point at the beginning of `text`; overlong forms and surrogates are no UTF-8.
CodePoint first_code_point(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  constexpr std::uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
  if (lead < 0xc2 || lead > 0xf4 || text.size() < bytes) return {lead, 0};
  std::uint32_t value = lead & (0x7fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0u) != 0x80u) return {lead, 0};
    value = value << 6 | (byte(i) & 0x3fu);
  }
  const bool surrogate = value >= 0xd800 && value <= 0xdfff;
  if (value < least[bytes] || value > 0x10ffff || surrogate) return {lead, 0};
  return {value, bytes};
}

bool acts_on_terminals(std::uint32_t c) {
  return c < 0x20 || (c >= 0x7f && c <= 0x9f) || (c >= 0x2028 && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
}

std::string shown(std::string_view text, bool line_ends) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const CodePoint c = first_code_point(text);
    const bool kept = c.value == '\t' || (line_ends && c.value == '\n');
    if (c.bytes == 0)
      fmt::format_to(std::back_inserter(result), "\\x{:02x}", c.value);
    else if (acts_on_terminals(c.value) && !kept)
      fmt::format_to(std::back_inserter(result), "\\u{:04x}", c.value);
    else
      result += text.substr(0, c.bytes);
    text.remove_prefix(c.bytes == 0 ? 1 : c.bytes);
  }
  return result;
}

}  // namespace

std::string shown_line(std::string_view text) { return shown(text, false); }
std::string shown_lines(std::string_view text) { return shown(text, true); }

}  // namespace diracstep
