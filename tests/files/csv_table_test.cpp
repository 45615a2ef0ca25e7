#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>

#include "temporary_folder.hpp"

namespace diracstep {
namespace {

/// A file with this text, and what is read of it.
CsvTable csv_of(const std::string& text, EmptyFields empty) {
  const testing::TemporaryFolder folder;
  return read_csv(folder.write("data.csv", text), "the data", 10'000, 2, empty);
}

TEST(CsvTable, FieldsMayStandInQuotes) {
  const CsvTable table = csv_of("\"t\", \"x\"\r\n# a note\n0, \"1.5\"\n\n1,2\n", EmptyFields::refused);
  EXPECT_EQ(table.names, (std::vector<std::string>{"t", "x"}));
  EXPECT_EQ(table.lines, (std::vector<std::vector<double>>{{0.0, 1.5}, {1.0, 2.0}}));
}

TEST(CsvTable, EmptyFieldsAreMissingWhereTheyMayBe) {
  const std::string text = "t,x,y\n0,,2\n1,3,\n";
  const CsvTable table = csv_of(text, EmptyFields::missing);
  ASSERT_EQ(table.lines.size(), 2u);
  EXPECT_TRUE(std::isnan(table.lines[0][1]) && std::isnan(table.lines[1][2]));
  EXPECT_EQ(table.lines[1][1], 3.0);
  EXPECT_THROW((void)csv_of(text, EmptyFields::refused), Misuse);
}

TEST(CsvTable, TellsTheLineOfWhatIsNoNumber) {
  try {
    (void)csv_of("t,x\n0,1\n1,two\n", EmptyFields::missing);
    FAIL() << "'two' is read";
  } catch (const Misuse& misuse) {
    EXPECT_NE(std::string(misuse.what()).find("line 3"), std::string::npos) << misuse.what();
  }
}

}  // namespace
}  // namespace diracstep
