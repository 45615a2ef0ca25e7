#include <fmt/format.h>

#include <cstdint>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/files/utf8.hpp>
#include <iterator>

namespace diracstep {

namespace {

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
