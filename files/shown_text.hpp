#pragma once

#include <string>
#include <string_view>

namespace diracstep {

/// Text of unknown origin as it may be shown on a terminal or written into a page or a script: control
/// characters, C1 controls, marks that reorder text (U+202A to U+202E, U+2066 to U+2069) and line separators
/// stand as \uXXXX, bytes that are no UTF-8 as \xXX.  Tabs and printable text pass unchanged; line ends pass
/// in shown_lines and are escaped in shown_line.
std::string shown_line(std::string_view text);
std::string shown_lines(std::string_view text);

}  // namespace diracstep
