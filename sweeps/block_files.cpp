#include <fmt/format.h>

#include <algorithm>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/sha256.hpp>
#include <diracstep/sweeps/block_files.hpp>
#include <filesystem>
#include <limits>

namespace diracstep {

BlockFiles::BlockFiles(std::string folder, std::string identity, long members, long block)
    : folder_(std::move(folder)), identity_(std::move(identity)), members_(members), block_(block) {}

long BlockFiles::size(long number) const { return std::min(block_, members_ - first(number)); }

std::string BlockFiles::path(long number) const {
  return (std::filesystem::path(folder_) / "blocks" / fmt::format("{:012}.csv", first(number))).string();
}

bool BlockFiles::finished(long number) const { return std::filesystem::exists(path(number)); }

std::string BlockFiles::head(long number) const {
  return fmt::format("# sweep {}, {} members from {}", identity_, size(number), first(number));
}

void BlockFiles::write(long number, const std::vector<std::string>& rows) const {
  std::string text;
  for (const std::string& row : rows) text += row + '\n';
  replace_file(path(number), fmt::format("{}, SHA-256 {}\n{}", head(number), sha256(text), text));
}

std::vector<std::string> BlockFiles::read(long number) const {
  const std::string text = read_file(path(number), "the block", std::numeric_limits<std::size_t>::max() / 2);
  const std::size_t end = text.find('\n');
  if (end == std::string::npos) return {};
  const std::string rows = text.substr(end + 1);
  if (text.substr(0, end) != fmt::format("{}, SHA-256 {}", head(number), sha256(rows))) return {};
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < rows.size();) {
    const std::size_t next = rows.find('\n', at);
    lines.push_back(rows.substr(at, next - at));
    at = next + 1;
  }
  return lines;
}

}  // namespace diracstep
