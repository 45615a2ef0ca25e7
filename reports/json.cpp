#include <diracstep/reports/json.hpp>
#include <utility>

namespace diracstep {

std::string to_text(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

void add_member(Json& object, std::string name, Json value) {
  if (object.is_null()) object = Json::object();
  std::vector<std::pair<const std::string, Json>>& members = object.get_ref<Json::object_t&>();
  members.emplace_back(std::move(name), std::move(value));
}

}  // namespace diracstep
