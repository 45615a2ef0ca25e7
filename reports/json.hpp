#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace diracstep {

/// Members in the order in which they were set.
using Json = nlohmann::ordered_json;

/// The text: in one line, or with each member on a line of its own, `indent` blanks further in.  A number
/// that is not finite becomes null, and bytes that are no UTF-8 the replacement character.
std::string to_text(const Json& json, int indent = -1);

/// Adds a member to an object or null without looking whether there is one of that name.
void add_member(Json& object, std::string name, Json value);

}  // namespace diracstep
