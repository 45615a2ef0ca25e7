#pragma once

#include <string>
#include <vector>

namespace diracstep {

/// A file and what it is for: "--out", "the scene".
struct NamedPath {
  std::string what;
  std::string path;
};

/// The path that a chain of links ends at; one that leads nowhere yet names the file that will be made.
std::string behind_links(std::string path);

/// Whether both name one file: the same inode where both exist, else the same name in the same folder,
/// whatever the spelling.  Devices and pipes are never the same: they are written to, not replaced.
bool same_file(const std::string& a, const std::string& b);

/// Throws Misuse where an output is an input or another output, or could not be made or written: its folder
/// is missing or closed, it is a folder, or it is there and may not be written.
void require_outputs(const std::vector<NamedPath>& outputs, const std::vector<NamedPath>& inputs);

}  // namespace diracstep
