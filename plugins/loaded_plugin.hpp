#pragma once

#include <diracstep/plugins/diracstep_plugin.h>

#include <diracstep/core/methods/registry.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// A scene that a plugin brings, with the end and the step it suggests.
struct PluginScene {
  std::shared_ptr<const Scene> scene;
  std::string description;
  double end_time = 0.0;
  double step = 0.0;
};

/// A plugin, from a shared object or linked in.  A value; the shared object stays loaded as long as any copy,
/// any registry it was added to, and anything these made.
class Plugin {
 public:
  /// From a description.  Throws Misuse where the version or the size differ from this library's, saying
  /// both, and where a part is missing or has a value that is not allowed, naming the part.
  explicit Plugin(const diracstep_plugin* description, std::string path = {},
                  std::shared_ptr<const void> library = {});

  const std::string& name() const { return name_; }
  const std::string& description() const { return description_; }
  /// Of the shared object; empty for a plugin that was linked in.
  const std::string& path() const { return path_; }

  const std::vector<std::string>& methods() const { return method_names_; }
  const std::vector<std::string>& rules() const { return rule_names_; }
  const std::vector<std::string>& scenes() const { return scene_names_; }

  /// Adds the methods and rules.  Throws Misuse for a name that is taken and for a method whose rule is
  /// unknown; the registry is then as it was.
  void add_to(Registry& registry) const;

  /// Throws Misuse for a name that is not in scenes().
  PluginScene scene(const std::string& name) const;

 private:
  void take_methods();
  void take_rules();
  void take_scenes();
  MethodInfo info_of(const diracstep_method& method, const Registry& registry) const;
  std::string owner() const { return "plugin '" + name_ + "'" + (path_.empty() ? "" : " (" + path_ + ")"); }

  const diracstep_plugin* plugin_;
  std::string path_;
  std::shared_ptr<const void> library_;
  std::string name_, description_;
  std::vector<std::string> method_names_, rule_names_, scene_names_;
};

/// Opens a shared object.  Throws Misuse, naming the file, where it does not exist, cannot be loaded, does
/// not export diracstep_plugin_entry, or holds a plugin that the constructor above refuses.
Plugin load_plugin(const std::filesystem::path& file);

/// Every *.so in the directories of a search path "A:B:…", in the order of the directories and then of the
/// names.
struct PluginSearch {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> complaints;  ///< directories that cannot be read
};
PluginSearch find_plugins(const std::string& search_path);

}  // namespace diracstep
