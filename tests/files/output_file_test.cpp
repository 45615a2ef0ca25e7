#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace diracstep::testing {
namespace {

std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return (std::ostringstream() << file.rdbuf()).str();
}

TEST(OutputFile, ReplacesAFileAtOnceAndKeepsTheOldOneWhereItCannot) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / "diracstep_replace";
  std::filesystem::create_directories(folder / "c.new");  // in the way of the file that is written first
  std::ofstream(folder / "c") << "old";
  EXPECT_ANY_THROW(replace_file(folder / "c", "new"));
  EXPECT_EQ(contents(folder / "c"), "old");
  std::filesystem::remove(folder / "c.new");
  replace_file(folder / "c", "new");
  EXPECT_EQ(contents(folder / "c"), "new");
  EXPECT_FALSE(std::filesystem::exists(folder / "c.new"));
  std::filesystem::remove_all(folder);
}

TEST(OutputFile, AFullDeviceIsAnError) {
  OutputFile file("/dev/full", OutputFile::Mode::existing);
  EXPECT_THROW(file.write("x"), Error);
}

}  // namespace
}  // namespace diracstep::testing
