/// diracstep-scene-compiler OUTPUT_DIRECTORY SCENE.toml…: the scenes that come with the library, as C++
/// sources. Writes NAME.cpp with the kernels of each, and shipped_scenes.cpp with a table of all kernels and
/// texts.
#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <diracstep/scene_format/compiler/stage_kernel.hpp>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>
#include <sstream>

namespace {

using namespace diracstep::scene_compiler;
namespace fs = std::filesystem;

std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  return (std::ostringstream() << file.rdbuf()).str();
}

/// Leaves a file alone that is the same already, so that nothing is compiled twice.
void write(const fs::path& path, const std::string& text) {
  if (fs::exists(path) && contents(path) == text) return;
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

/// A text as an array of bytes: a string literal has a limited length.
std::string as_bytes(const std::string& text) {
  std::string bytes;
  for (const char c : text) bytes += std::to_string(static_cast<unsigned char>(c)) + ',';
  return bytes + '0';
}

void compile(const fs::path& directory, const std::vector<fs::path>& scenes) {
  std::string declarations, texts, table;
  std::set<std::string> kernels;
  for (const fs::path& path : scenes) {
    const std::string text = contents(path), name = path.stem().string();
    const auto program = compile_scene(path.string(), text);
    if (program->document.name != name)
      throw std::runtime_error(path.string() + ": the scene is named '" + program->document.name + "'");
    const bool first = kernels.insert(program->name).second;  // two scenes may have the same formulas
    const StageKernels stages(*program);
    const std::string stage_table = "diracstep_stages_" + program->name;
    std::string source = "// The same formulas as another scene.\n";
    if (first) source = program->source + (stages.any() ? stages.appendix(stage_table) : "");
    write(directory / (name + ".cpp"), source);
    if (first)
      declarations +=
          fmt::format("extern \"C\" const CompiledKernel diracstep_kernels_{}[];\n", program->name);
    if (first && stages.any())
      declarations += fmt::format("extern \"C\" const CompiledStageKernel {}[];\n", stage_table);
    texts += fmt::format("const unsigned char text_{}[] = {{{}}};\n", name, as_bytes(text));
    table += "    {\"" + name + "\", text_" + name + ", sizeof text_" + name + " - 1, \"" + program->name +
             "\", diracstep_kernels_" + program->name + ", " + (stages.any() ? stage_table : "nullptr") +
             "},\n";
  }
  write(directory / "shipped_scenes.cpp",
        "#include <diracstep/scene_format/loader/shipped_scenes.hpp>\n\n"
        "using diracstep::scene_compiler::CompiledKernel;\n"
        "using diracstep::scene_compiler::CompiledStageKernel;\n" +
            declarations + "\nnamespace diracstep {\nnamespace {\n" + texts +
            "const ShippedScene scenes[] = {\n" + table +
            "};\n}  // namespace\nstd::span<const ShippedScene> shipped_scenes() { return scenes; }\n}  // "
            "namespace "
            "diracstep\n");
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 3) {
    std::cerr << "usage: diracstep-scene-compiler OUTPUT_DIRECTORY SCENE.toml...\n";
    return 2;
  }
  try {
    compile(arguments[1], {arguments + 2, arguments + count});
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
