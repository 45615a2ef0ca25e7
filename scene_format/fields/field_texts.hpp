#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep::scene_compiler {

/// Names and the texts that stand for them.
using NameTexts = std::map<std::string, std::string, std::less<>>;

/// Calls found(offset, name, end) for each name in a formula; where it returns a position, goes on there.
void for_each_name(std::string_view formula,
                   const std::function<std::size_t(std::size_t offset, std::string_view name)>& found);

/// The formula with these names replaced, but for those with an index, "u[3]".
std::string with_names_replaced(std::string_view formula, const NameTexts& texts);

bool mentions(std::string_view formula, const std::function<bool(std::string_view)>& name_is);

/// The formula with each integral(f) replaced by text_of(f), in parentheses.  Parentheses that are not closed
/// are left to the reader of formulas.
std::string with_integrals_replaced(std::string_view formula,
                                    const std::function<std::string(const std::string&)>& text_of);

}  // namespace diracstep::scene_compiler
