#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/detail/document_reader.hpp>
#include <diracstep/scene_format/compiler/netlist_reader.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <diracstep/scene_format/fields/field_expansion.hpp>

namespace diracstep::scene_compiler {

bool Limits::allow(double value) const {
  return std::isfinite(value) && (!min || value >= *min) && (!max || value <= *max) &&
         (!above || value > *above) && (!below || value < *below);
}

std::string Limits::text() const {
  const bool low = min || above, high = max || below;
  const double least = min ? *min : above.value_or(0.0), most = max ? *max : below.value_or(0.0);
  if (low && high) return fmt::format("in {}{:g}, {:g}{}", min ? '[' : '(', least, most, max ? ']' : ')');
  if (low) return fmt::format("{} {:g}", min ? "at least" : "above", least);
  if (high) return fmt::format("{} {:g}", max ? "at most" : "below", most);
  return "finite";
}

namespace {

/// The position after a quoted text that begins at `at`, or after three quotes and all up to the next three.
std::size_t after_quotes(const std::string& text, std::size_t at) {
  const char quote = text[at];
  const std::string three(3, quote);
  const bool long_text = text.compare(at, 3, three) == 0;
  std::size_t i = at + (long_text ? 3 : 1);
  for (; i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (long_text ? text.compare(i, 3, three) == 0 : text[i] == quote) {
      return i + (long_text ? 3 : 1);
    } else if (!long_text && text[i] == '\n') {
      return i;  // an error, which the reader of TOML will tell
    }
  }
  return text.size();
}

/// The line of a key a.b.c… of more than `most` parts, 0 where there is none: the reader of TOML follows
/// these keys by recursion, as deep as they are long.
int line_of_long_key(const std::string& text, std::size_t most) {
  std::size_t dots = 0;
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (c == '"' || c == '\'') {
      i = after_quotes(text, i);
      continue;
    }
    if (c == '#') i = std::min(text.find('\n', i), text.size());
    if (c == '.' && ++dots >= most)
      return static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n')) +
             1;
    if (c == '=' || c == ',' || c == '[' || c == ']' || c == '{' || c == '}' || c == '\n' || c == '#')
      dots = 0;
    if (i < text.size()) ++i;
  }
  return 0;
}

}  // namespace

SceneDocument read_document(const std::string& file, const std::string& text) {
  const SizeLimits limits = size_limits();
  if (text.size() > limits.file_bytes)
    throw SceneError(file, {}, fmt::format("{} bytes; the limit is {}", text.size(), limits.file_bytes));
  if (const int line = line_of_long_key(text, limits.key_parts); line > 0)
    throw SceneError(file, {line, 1},
                     fmt::format("nested too deep: a key of more than {} parts", limits.key_parts));
  if (file.ends_with(".cir")) {
    SceneDocument document = read_netlist(file, text);
    guess_starts(document);
    return document;
  }
  toml::table root;
  try {
    root = toml::parse(std::string_view(text), std::string_view(file));
    if (root.contains("field")) expand_field(root, is_reserved);
    return DocumentReader(file, text).read(root);
  } catch (const toml::parse_error& error) {
    throw SceneError(file, place_of(error.source()), std::string(error.description()));
  } catch (const FieldError& error) {
    const TableReader reader(file, text);
    throw SceneError(file,
                     error.node->is_string() ? reader.formula(*error.node, "").place(error.offset)
                                             : place_of(error.node->source()),
                     error.message);
  }
}

}  // namespace diracstep::scene_compiler
