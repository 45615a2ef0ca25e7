#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cstdio>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/scene_format/loader/scene_template.hpp>
#include <memory>
#include <string>
#include <system_error>

namespace diracstep::command {

namespace {

struct NewArguments {
  std::string name;
  bool json = false;
};

void write_new(const std::string& path, const std::string& text) {
  std::FILE* const file = std::fopen(path.c_str(), "wx");  // x: never over a file or a link that is there
  if (file == nullptr && errno == EEXIST)
    throw Misuse(fmt::format("'{}' is there already; choose another name", path));
  if (file == nullptr) throw std::system_error(errno, std::generic_category(), path);
  const bool written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (std::fclose(file) == 0 && written) return;
  std::remove(path.c_str());
  throw Error(fmt::format("'{}' could not be written in full", path));
}

void make(const NewArguments& options) {
  const std::string path = options.name + ".toml";
  write_new(path, scene_template(options.name));
  if (options.json)
    print(to_text(Json{{"file", path}}, 2) + '\n');
  else
    print(fmt::format("{0} written; next: diracstep check {0}, diracstep run {0}\n", path));
}

}  // namespace

void add_new(CLI::App& app, Session&) {
  CLI::App* verb = app.add_subcommand("new", "A commented scene template, NAME.toml");
  const auto options = std::make_shared<NewArguments>();
  verb->add_option("NAME", options->name, "Name of the scene: letters, digits and _")->required();
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep new my_pendulum");
  verb->callback([options] { make(*options); });
}

}  // namespace diracstep::command
