#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace diracstep {

/// Text as it may stand in HTML, in attributes too.
std::string html(std::string_view text);

/// A cell of an HTML table: what is shown, as HTML, and the number it is sorted by, if it is one.
struct HtmlCell {
  std::string content;
  std::optional<double> value = {};
  bool number = false;
  std::string look = {};  ///< further classes
};

HtmlCell words(std::string_view text, std::string look = {});
/// A dash where there is no value or it is not finite.
HtmlCell number_cell(std::optional<double> value, const std::string& text);

struct HtmlTable {
  std::vector<std::pair<std::string, int>> groups;  ///< heads over so many columns each; may be empty
  std::vector<std::string> header;                  ///< each a button that the page sorts by
  std::vector<std::vector<HtmlCell>> rows;
  std::vector<bool> best = {};  ///< rows that are set off; may be shorter

  std::string text() const;
};

}  // namespace diracstep
