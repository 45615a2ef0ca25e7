#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "temporary_folder.hpp"

namespace diracstep::testing {
namespace {

TEST(OutputFile, ReplacesAFileAtOnceAndKeepsTheOldOneWhereItCannot) {
  const TemporaryFolder temporary;
  const std::filesystem::path& folder = temporary.path();
  std::filesystem::create_directories(folder / "c.new");  // in the way of the file that is written first
  std::ofstream(folder / "c") << "old";
  EXPECT_ANY_THROW(replace_file(folder / "c", "new"));
  EXPECT_EQ(contents(folder / "c"), "old");
  std::filesystem::remove(folder / "c.new");
  replace_file(folder / "c", "new");
  EXPECT_EQ(contents(folder / "c"), "new");
  EXPECT_FALSE(std::filesystem::exists(folder / "c.new"));
}

TEST(OutputFile, AFullDeviceIsAnError) {
  OutputFile file("/dev/full", OutputFile::Mode::existing);
  EXPECT_THROW(file.write("x"), Error);
}

}  // namespace
}  // namespace diracstep::testing
