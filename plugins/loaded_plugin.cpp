#include <dlfcn.h>

#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/plugins/callback_function.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/plugins/shared_object.hpp>

namespace diracstep {

namespace {

namespace fs = std::filesystem;

constexpr int max_inner_columns = 1000;

std::string text_or(const char* text, const char* otherwise) { return text != nullptr ? text : otherwise; }

void require_version(const diracstep_plugin& plugin, const std::string& owner) {
  const auto differ = [&](const char* what, unsigned theirs, unsigned ours) {
    require(theirs == ours, owner,
            std::string("it was built with ") + what + " " + std::to_string(theirs) +
                ", this DiracStep has " + std::to_string(ours) + "; rebuild it with this version's headers");
  };
  differ("plugin interface version", plugin.version, DIRACSTEP_PLUGIN_VERSION);
  differ("a description of size", plugin.size, sizeof(diracstep_plugin));
}

/// The names of `count` parts, each of which must be there, have a name, and differ from the others.
template <class Part>
std::vector<std::string> names_of(const Part* const* parts, int count, const char* what,
                                  const std::string& owner) {
  require(count >= 0 && (count == 0 || parts != nullptr), owner,
          "its number of " + std::string(what) + "s is " + std::to_string(count) + " and does not fit them");
  std::vector<std::string> names;
  for (int k = 0; k < count; ++k) {
    require(parts[k] != nullptr && parts[k]->name != nullptr, owner,
            std::string(what) + " " + std::to_string(k + 1) + " is NULL or has no name");
    const std::string name = parts[k]->name;
    require(std::ranges::find(names, name) == names.end(), owner,
            "it brings the " + std::string(what) + " '" + name + "' twice");
    names.push_back(name);
  }
  return names;
}

void require_usable(const diracstep_method& method, const std::string& owner) {
  require(method.type >= 1 && method.type <= 4, owner,
          "its type is " + std::to_string(method.type) + "; 1 to 4 are allowed");
  require(method.order >= 1 && method.constrained_order >= 0, owner,
          "it claims order " + std::to_string(method.order) + " and constrained order " +
              std::to_string(method.constrained_order) + "; 1 or more, and 0 or more, are allowed");
  require(method.inner_columns >= 0 && method.inner_columns <= max_inner_columns, owner,
          "it has " + std::to_string(method.inner_columns) + " inner columns; 0 to " +
              std::to_string(max_inner_columns) + " are allowed");
  require(method.value != nullptr || method.gradient != nullptr, owner,
          "value and gradient are NULL; one of them is the least to give");
  require((method.create == nullptr) == (method.destroy == nullptr), owner,
          "it has only one of create and destroy; both or none are needed");
}

StepRule rule_from(const diracstep_rule& rule, const std::string& owner) {
  require(rule.nodes >= 0 && (rule.nodes == 0 || (rule.c != nullptr && rule.weights != nullptr)), owner,
          "its rule '" + std::string(rule.name) + "' has no nodes or no weights");
  std::vector<StepNode> nodes;
  for (int k = 0; k < rule.nodes; ++k) nodes.push_back({rule.c[k], rule.weights[k]});
  try {
    return step_rule(rule.name, nodes);
  } catch (const Misuse& misuse) {
    throw Misuse(owner + ": " + misuse.what());
  }
}

std::shared_ptr<const void> open(const fs::path& file, const std::string& owner) {
  std::error_code ignored;
  require(fs::exists(file, ignored), owner, "there is no such file");
  const std::string damage = damage_of(file);
  require(damage.empty(), owner, "it cannot be loaded: " + damage);
  void* const handle = dlopen(fs::absolute(file).c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr)
    throw Misuse(owner + ": it cannot be loaded: " + text_or(dlerror(), "no reason given"));
  return {handle, [](void* opened) { dlclose(opened); }};
}

}  // namespace

Plugin::Plugin(const diracstep_plugin* description, std::string path, std::shared_ptr<const void> library)
    : plugin_(description), path_(std::move(path)), library_(std::move(library)) {
  const std::string file = path_.empty() ? "plugin" : "plugin '" + path_ + "'";
  require(plugin_ != nullptr, file, "diracstep_plugin_entry returned NULL");
  require_version(*plugin_, file);
  require(plugin_->name != nullptr, file, "it has no name");
  name_ = plugin_->name;
  description_ = text_or(plugin_->description, "");
  take_methods();
  take_rules();
  take_scenes();
}

void Plugin::take_methods() {
  method_names_ = names_of(plugin_->method, plugin_->methods, "method", owner());
  for (int k = 0; k < plugin_->methods; ++k)
    require_usable(*plugin_->method[k], owner() + ", method '" + plugin_->method[k]->name + "'");
}

void Plugin::take_rules() {
  rule_names_ = names_of(plugin_->rule, plugin_->rules, "constraint rule", owner());
  for (int k = 0; k < plugin_->rules; ++k) rule_from(*plugin_->rule[k], owner());
}

void Plugin::take_scenes() {
  scene_names_ = names_of(plugin_->scene, plugin_->scenes, "scene", owner());
  for (const std::string& name : scene_names_) scene(name);
}

MethodInfo Plugin::info_of(const diracstep_method& method, const Registry& registry) const {
  return {.name = method.name,
          .type = static_cast<GeneratingType>(method.type),
          .order = method.order,
          .self_adjoint = (method.flags & DIRACSTEP_SELF_ADJOINT) != 0,
          .constraint_rule = registry.rule(text_or(method.constraint_rule, "midpoint")),
          .summary = text_or(method.summary, "from a plugin"),
          .adjoint = text_or(method.adjoint, ""),
          .constrained_order = method.constrained_order,
          .allocation_free = (method.flags & DIRACSTEP_ALLOCATION_FREE) != 0};
}

void Plugin::add_to(Registry& registry) const {
  Registry extended = registry;
  try {
    for (int k = 0; k < plugin_->rules; ++k) extended.add_rule(rule_from(*plugin_->rule[k], owner()));
    for (int k = 0; k < plugin_->methods; ++k) {
      const diracstep_method& method = *plugin_->method[k];
      const std::string from = "plugin '" + name_ + "', method '" + method.name + "'";
      extended.add(info_of(method, extended), [&method, from, library = library_](const Scene& scene) {
        return callback_function(method, scene, from, library);
      });
    }
  } catch (const Misuse& misuse) {
    throw Misuse(owner() + ": " + misuse.what());
  }
  registry = std::move(extended);
}

PluginScene Plugin::scene(const std::string& name) const {
  const auto found = std::ranges::find(scene_names_, name);
  if (found == scene_names_.end()) {
    std::string known;
    for (const std::string& scene : scene_names_) known += " " + scene;
    throw Misuse(owner() + ": unknown scene '" + name + "'; its scenes are" + known);
  }
  const diracstep_scene& scene = *plugin_->scene[found - scene_names_.begin()];
  const std::string from = owner() + ", scene '" + name + "'";
  require(scene.step != 0.0 && (scene.end_time - scene.start_time) / scene.step > 0.0, from,
          "its step " + std::to_string(scene.step) + " does not lead from start_time to end_time");
  return {std::make_shared<const Scene>(scene_from(scene, from, library_)), text_or(scene.description, ""),
          scene.end_time, scene.step};
}

Plugin load_plugin(const fs::path& file) {
  const std::string owner = "plugin '" + file.string() + "'";
  std::shared_ptr<const void> library = open(file, owner);
  using Entry = const diracstep_plugin* (*)();
  const auto entry =
      reinterpret_cast<Entry>(dlsym(const_cast<void*>(library.get()), "diracstep_plugin_entry"));
  require(entry != nullptr, owner, "it does not export diracstep_plugin_entry");
  const diracstep_plugin* description = nullptr;
  try {
    call(owner, "diracstep_plugin_entry", [&] { return description = entry(), 0; });
  } catch (const CallbackError& error) {
    throw Misuse(error.what());
  }
  return Plugin(description, file.string(), std::move(library));
}

PluginSearch find_plugins(const std::string& search_path) {
  PluginSearch search;
  std::size_t begin = 0;
  while (begin <= search_path.size()) {
    const std::size_t end = std::min(search_path.find(':', begin), search_path.size());
    const fs::path directory = search_path.substr(begin, end - begin);
    begin = end + 1;
    if (directory.empty()) continue;
    std::error_code error;
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(directory, error))
      if (entry.path().extension() == ".so") found.push_back(entry.path());
    if (error) search.complaints.push_back("'" + directory.string() + "': " + error.message());
    std::ranges::sort(found);
    search.files.insert(search.files.end(), found.begin(), found.end());
  }
  return search;
}

}  // namespace diracstep
