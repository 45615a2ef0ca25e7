#include <algorithm>
#include <diracstep/c_interface/handles.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/scene_format/scene_file.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

void require_version(unsigned version) {
  if (version == DIRACSTEP_VERSION_OF_C_INTERFACE) return;
  throw Misuse("the program was built for version " + std::to_string(version) +
               " of the C interface, this library has " + std::to_string(DIRACSTEP_VERSION_OF_C_INTERFACE));
}

/// Entry k of a list; throws Misuse where the list or the entry is NULL.
template <class Entry>
const Entry& entry_at(const Entry* const* list, int k, const char* what) {
  if (list == nullptr || list[k] == nullptr) throw Misuse(what + (" " + std::to_string(k + 1)) + " is NULL");
  return *list[k];
}

void add_plugin(diracstep_model& model, Plugin plugin) {
  plugin.add_to(model.registry);
  model.plugins.push_back(std::move(plugin));
}

void add_plugins(diracstep_model& model, const diracstep_source& source) {
  for (int k = 0; k < source.plugins; ++k)
    add_plugin(model, load_plugin(&entry_at(source.plugin, k, "plugin")));
  for (int k = 0; k < source.linked; ++k)
    add_plugin(model, Plugin(&entry_at(source.linked_plugin, k, "linked plugin")));
}

/// What is known of a scene that no file describes.
CatalogueScene described(std::shared_ptr<const Scene> scene, std::string description, std::string source,
                         double end, double step) {
  CatalogueScene entry;
  entry.scene = std::move(scene);
  entry.kind = "callbacks";
  entry.description = std::move(description);
  entry.source = std::move(source);
  entry.t_end = end;
  entry.natural_step = step;
  entry.recommended.step = step;
  entry.recommended.end = end;
  entry.code = "callbacks";
  return entry;
}

CatalogueScene scene_of_callbacks(const diracstep_scene& given) {
  const std::string name = given.name != nullptr ? given.name : "scene";
  auto scene = std::make_shared<const Scene>(scene_from(given, "scene '" + name + "'"));
  return described(std::move(scene), given.description != nullptr ? given.description : "",
                   "callbacks of the program", given.end_time, given.step);
}

CatalogueScene scene_by_name(const diracstep_model& model, const std::string& name,
                             const Parameters& changes) {
  for (const Plugin& plugin : model.plugins) {
    if (std::ranges::find(plugin.scenes(), name) == plugin.scenes().end()) continue;
    if (!changes.empty())
      throw Misuse("scene '" + name + "' of plugin '" + plugin.name() + "' has no parameter '" +
                   changes.begin()->first + "'; it has none");
    const PluginScene brought = plugin.scene(name);
    return described(brought.scene, brought.description, "plugin " + plugin.name(), brought.end_time,
                     brought.step);
  }
  return make_scene(name, changes);
}

CatalogueScene scene_of(const diracstep_model& model, const diracstep_source& source) {
  const Parameters changes = named_values(source.parameters, source.parameter, "parameter");
  const char* const name = source.name;
  if (source.callbacks != nullptr) {
    if (name != nullptr || source.text != nullptr || !changes.empty())
      throw Misuse("callbacks go with no name, text or parameter");
    return scene_of_callbacks(*source.callbacks);
  }
  if (source.text != nullptr) return scene_from_text(name != nullptr ? name : "text", source.text, changes);
  return scene_by_name(model, name, changes);
}

bool has_scene(const diracstep_source& source) {
  return source.name != nullptr || source.text != nullptr || source.callbacks != nullptr;
}

}  // namespace

const CatalogueScene& c_interface::entry_of(const diracstep_model& model) {
  if (!model.scene) throw Misuse("the model was opened without a scene");
  return model.entry;
}

int diracstep_open(unsigned version, const diracstep_source* source, diracstep_model** model) {
  return guarded([&] {
    given(model, "where the model goes") = nullptr;
    require_version(version);
    auto made = std::make_unique<diracstep_model>();
    const diracstep_source& from = given(source, "the source");
    add_plugins(*made, from);
    if (has_scene(from)) {
      made->entry = scene_of(*made, from);
      made->name = from.name != nullptr ? from.name : "text";
      if (from.text != nullptr) made->text = from.text;
      made->changes = named_values(from.parameters, from.parameter, "parameter");
      made->drop_redundant = from.drop_redundant != 0;
      const bool refused = made->entry.scene->refuse_redundant_rows;
      const bool of_a_file = made->entry.stated_start.has_value();  // which has left them out
      if (refused ? from.drop_redundant != 0 : !of_a_file) drop_redundant_rows(made->entry);
      set_tolerances(made->entry, named_values(from.tolerances, from.tolerance, "tolerance"));
      made->scene = completed(made->entry.scene);
    }
    *model = made.release();
  });
}

void diracstep_close(diracstep_model* model) { delete model; }

int diracstep_read_facts(const diracstep_model* model, diracstep_facts* facts) {
  return guarded([&] {
    const diracstep_model& from = given(model, "the model");
    const CatalogueScene& entry = entry_of(from);
    const Start& start = from.scene->start;
    given(facts, "where the facts go") = {from.scene->dimension(),
                                          from.scene->storage_size(),
                                          entry.shown().rows(),
                                          static_cast<int>(entry.invariants.size()),
                                          static_cast<int>(entry.outputs.size()),
                                          start.time,
                                          start.q.data(),
                                          start.v.data(),
                                          entry.t_end,
                                          entry.natural_step};
  });
}
