#include <CLI/App.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <memory>
#include <string>

namespace diracstep::command {

void add_expand(CLI::App& app, Session&) {
  struct Arguments {
    std::string scene;
    bool json = false;
  };
  CLI::App* verb =
      app.add_subcommand("expand", "A scene with bodies as a plain one: coordinates, Lagrangian, rows");
  const auto options = std::make_shared<Arguments>();
  verb->add_option("SCENE", options->scene, "Name of a scene or path of a file NAME.toml")->required();
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep expand heavy_top > plain_top.toml");
  verb->callback([options] {
    const std::string text = expanded_scene(options->scene);
    print(options->json ? to_text(Json{{"scene", options->scene}, {"text", text}}, 2) + '\n' : text);
  });
}

}  // namespace diracstep::command
