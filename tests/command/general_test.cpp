#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class GeneralCommand : public Command {};

TEST_F(GeneralCommand, HelpAndVersionSucceed) {
  const Outcome version = run("--version");
  EXPECT_EQ(version.status, 0);
  EXPECT_EQ(version.out.rfind("diracstep ", 0), 0u);
  for (const char* verb : {"", "list ", "plan ", "run ", "study "}) {
    const Outcome help = run(std::string(verb) + "--help");
    EXPECT_EQ(help.status, 0) << verb;
    EXPECT_NE(help.out.find("Example"), std::string::npos) << verb;
    EXPECT_EQ(help.err, "") << verb;
    EXPECT_EQ(run(std::string("help ") + verb).out, help.out) << verb;
  }
  expect_misuse("help rnu", {"'rnu'", "did you mean 'run'"});
}

TEST_F(GeneralCommand, ANameThatIsNearlyKnownIsSuggested) {
  expect_misuse("stdy", {"unknown verb 'stdy'", "did you mean 'study'"});
  expect_misuse("run knife_edge --metod x", {"unknown option '--metod'", "did you mean '--method'"});
  expect_misuse("run knife_edge --metod=x", {"unknown option '--metod'", "did you mean '--method'"});
  expect_misuse("run knife_egde", {"unknown scene 'knife_egde'", "did you mean 'knife_edge'"});
  expect_misuse("run knife_edge --method type1/mdpoint", {"did you mean 'type1/midpoint'"});
  expect_misuse("run knife_edge --rule midpont", {"did you mean 'midpoint'"});
  expect_misuse("list methds", {"did you mean 'methods'"});
  EXPECT_EQ(run("plan zzzzzz").err.find("did you mean"), std::string::npos);
}

TEST_F(GeneralCommand, MisuseListsWhatIsAllowed) {
  expect_misuse("", {"list", "plan", "run", "study"});
  expect_misuse("walk", {"walk", "list", "plan", "run", "study"});
  expect_misuse("run knife_edge --stp 1", {"--stp", "--step", "--method"});
  expect_misuse("run", {"SCENE"});
  expect_misuse("list everything", {"everything", "scenes", "methods", "plugins"});
  expect_misuse("plan knife", {"knife", "knife_edge", "kepler_e06"});
  expect_misuse("plan knife_edge --method type7/x", {"type7/x", "type1/midpoint"});
}

TEST_F(GeneralCommand, ListNamesScenesMethodsAndPlugins) {
  const Outcome all = run("list");
  EXPECT_EQ(all.status, 0);
  for (const char* word : {"knife_edge", "nonholonomic", "type1/midpoint", "no plugin"})
    EXPECT_NE(all.out.find(word), std::string::npos) << word;
  EXPECT_EQ(run("list scenes").out.find("type1/midpoint"), std::string::npos);
}

TEST_F(GeneralCommand, ListsFitTheScreen) {
  for (const char* list : {"list scenes", "list methods", "list scenes --parameters"})
    for (const std::string& line : lines(run(list).out)) {
      const auto columns = std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; });
      EXPECT_LE(columns, 100) << line;
    }
  EXPECT_EQ(run("list scenes").out.find("g_sin_alpha="), std::string::npos);
  EXPECT_NE(run("list scenes --parameters").out.find("g_sin_alpha="), std::string::npos);
}

TEST_F(GeneralCommand, ListShowsTheOrdersOfThePublishedTable) {
  std::ifstream page(DIRACSTEP_SOURCE "/docs/orders.md");
  std::string row, wanted = "| `type1/gl:4` | 8 |";
  while (std::getline(page, row) && !row.starts_with(wanted)) {
  }
  ASSERT_TRUE(row.starts_with(wanted));
  const double first = std::stod(row.substr(wanted.size()));
  const Json methods = Json::parse(run("list methods --json").out)["methods"];
  int found = 0;
  for (const Json& method : methods) {
    if (method["name"] == "type1/gl:6") found += method["order"] == 12;
    if (method["name"] != "type1/gl:4") continue;
    ++found;
    ASSERT_EQ(method["measured_order"].size(), 7u) << method;
    EXPECT_EQ(method["measured_order"][0]["class"], "unconstrained");
    EXPECT_EQ(method["measured_order"][0]["slope"], first);
  }
  EXPECT_EQ(found, 2);
  EXPECT_EQ(run("list methods").out.find("--measure"), std::string::npos);
}

TEST_F(GeneralCommand, ListAsJson) {
  const Json all = Json::parse(run("list --json").out);
  EXPECT_TRUE(all["plugins"].is_array());
  EXPECT_TRUE(all["plugins"].empty());
  bool found = false;
  for (const Json& scene : all["scenes"]) {
    if (scene["name"] != "knife_edge") continue;
    found = true;
    EXPECT_EQ(scene["coordinates"], (Json{"x", "y", "ph"}));
    EXPECT_EQ(scene["rows"], Json::array({"blade"}));
  }
  EXPECT_TRUE(found);
  EXPECT_FALSE(Json::parse(run("list plugins --json").out).contains("scenes"));
}

TEST_F(GeneralCommand, ListMeasuresTheStatedOrder_slow) {
  const Json all = Json::parse(run("list methods --measure --json").out);
  for (const Json& method : all["methods"]) {
    if (method["name"] != "type1/midpoint") continue;
    EXPECT_FALSE(method["measured_order"].empty());
    for (const Json& measured : method["measured_order"])
      EXPECT_NEAR(measured["slope"].get<double>(), 2.0, 0.1) << measured;
  }
}

TEST_F(GeneralCommand, PlanSaysWhatIsDoneAndWhy) {
  const Outcome text = run("plan knife_edge");
  EXPECT_EQ(text.status, 0) << text.err;
  const Json json = Json::parse(run("plan knife_edge --order 4 --json").out);
  EXPECT_EQ(json["order"], 4);
  ASSERT_FALSE(json["plan"].empty());
  for (const Json& line : json["plan"])
    for (const char* key : {"item", "decision", "reason"}) EXPECT_TRUE(line[key].is_string()) << key;
}

TEST_F(GeneralCommand, FullStandardOutputIsAFailure) {
  EXPECT_EQ(run("list > /dev/full").status, 1);
  EXPECT_NE(contents(path("stderr")).find("standard output"), std::string::npos);
}

}  // namespace
}  // namespace diracstep::testing
