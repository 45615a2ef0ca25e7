#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/session.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <optional>

namespace diracstep::command {

namespace {

bool is_loaded(const Session& session, const std::filesystem::path& file) {
  std::error_code ignored;
  return std::ranges::any_of(session.plugins, [&](const Plugin& plugin) {
    return std::filesystem::equivalent(plugin.path(), file, ignored);
  });
}

/// Throws Misuse where a scene of the plugin has the name of another.
void require_new_scenes(const Session& session, const Plugin& plugin) {
  const std::vector<std::string> known = scene_names(session);
  for (const std::string& scene : plugin.scenes())
    if (std::ranges::find(known, scene) != known.end())
      throw Misuse(fmt::format("plugin '{}' ({}): there is already a scene '{}'", plugin.name(),
                               plugin.path(), scene));
}

void load(Session& session, const std::filesystem::path& file) {
  if (is_loaded(session, file)) return;
  Plugin plugin = load_plugin(file);
  require_new_scenes(session, plugin);
  plugin.add_to(session.registry);
  session.plugins.push_back(std::move(plugin));
}

/// The one that brings a scene; null where it is of the catalogue or a file.
const Plugin* plugin_with(const Session& session, const std::string& scene) {
  const auto has = [&](const Plugin& plugin) {
    return std::ranges::find(plugin.scenes(), scene) != plugin.scenes().end();
  };
  const auto found = std::ranges::find_if(session.plugins, has);
  return found == session.plugins.end() ? nullptr : &*found;
}

CatalogueScene scene_of(const Plugin& plugin, const std::string& name, const Parameters& changes) {
  if (!changes.empty())
    throw Misuse(fmt::format("scene '{}' of plugin '{}' has no parameter '{}'; it has none", name,
                             plugin.name(), changes.begin()->first));
  const PluginScene brought = plugin.scene(name);
  CatalogueScene scene;
  scene.scene = brought.scene;
  scene.kind = "plugin";
  scene.description = brought.description;
  scene.source = "plugin " + plugin.name();
  scene.t_end = brought.end_time;
  scene.natural_step = brought.step;
  scene.recommended.step = brought.step;
  scene.recommended.end = brought.end_time;
  scene.code = "callbacks of the plugin";
  return scene;
}

}  // namespace

void load_plugins(Session& session) {
  const char* const path = std::getenv("DIRACSTEP_PLUGIN_PATH");
  const PluginSearch search = find_plugins(path != nullptr ? path : "");
  for (const std::string& complaint : search.complaints) say("DIRACSTEP_PLUGIN_PATH: " + complaint);
  for (const auto& file : search.files) {
    try {
      load(session, file);
    } catch (const Misuse& misuse) {
      say(fmt::format("DIRACSTEP_PLUGIN_PATH: {}; left out", misuse.what()));
    }
  }
  for (const std::string& file : session.plugin_files) load(session, file);
}

std::vector<std::string> scene_names(const Session& session) {
  std::vector<std::string> names = ::diracstep::scene_names();
  for (const Plugin& plugin : session.plugins)
    names.insert(names.end(), plugin.scenes().begin(), plugin.scenes().end());
  return names;
}

std::function<CatalogueScene(const Parameters&)> scene_maker(const Session& session,
                                                             const std::string& name) {
  std::optional<SceneFile> file;
  const Plugin* const plugin = plugin_with(session, name);
  if (plugin == nullptr) file.emplace(scene_source(name));
  return [&session, name, plugin, file](const Parameters& changes) {
    CatalogueScene entry = file ? file->load(changes) : scene_of(*plugin, name, changes);
    const bool refused = entry.scene->refuse_redundant_rows;
    if (refused ? session.drop_redundant_rows : plugin != nullptr) drop_redundant_rows(entry);
    set_tolerances(entry, parameters(session.tolerances, "--tolerance"));
    return entry;
  };
}

std::string acting_events(const CatalogueScene& entry) {
  std::string names;
  for (const Event& event : entry.events)
    if (event.acts() || event.stop) names += (names.empty() ? "" : ", ") + event.name;
  return names;
}

void tell_events_left_out(const CatalogueScene& entry) {
  if (const std::string names = acting_events(entry); !names.empty())
    say(fmt::format("the events of scene '{}' ({}) are not looked for: this is its motion without them",
                    entry.scene->name, names));
}

CatalogueScene make_scene(const Session& session, const std::string& name, const Parameters& changes) {
  CatalogueScene entry = scene_maker(session, name)(changes);
  for (const std::string& change : entry.changes) say(entry.scene->name + ": " + change);
  return entry;
}

}  // namespace diracstep::command
