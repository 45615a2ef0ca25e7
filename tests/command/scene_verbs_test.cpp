#include <nlohmann/json.hpp>
#include <set>

#include "run_command.hpp"

/// new, check, and scenes given by their files.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class SceneVerbs : public Command {
 protected:
  std::string made() const {
    EXPECT_EQ(run("new '" + path("bead") + "'").status, 0);
    return path("bead.toml");
  }
  void change(const std::string& from, const std::string& to) const {
    std::string text = contents(path("bead.toml"));
    ASSERT_NE(text.find(from), std::string::npos);
    std::ofstream(path("bead.toml")) << text.replace(text.find(from), from.size(), to);
  }
};

TEST_F(SceneVerbs, NewWritesASceneThatPassesAndRuns) {
  const std::string file = "'" + made() + "'";
  const Outcome check = run("check " + file);
  EXPECT_EQ(check.status, 0) << check.out << check.err;
  EXPECT_NE(check.out.find("rank 1 of 1"), std::string::npos);
  EXPECT_EQ(run("run " + file + " --end 0.5 --set omega=3").status, 0);
  expect_misuse("new '" + path("bead") + "'", {"bead.toml", "there already"});
  expect_misuse("new '" + path("no-name") + "'", {"no-name", "letters"});
}

TEST_F(SceneVerbs, CheckFailsForAStartOffTheRows) {
  const std::string file = "'" + made() + "'";
  change("x = \"r*sin(angle)\"", "x = 0.4");
  const Outcome outcome = run("check " + file + " --json");
  EXPECT_EQ(outcome.status, 1);
  const Json json = Json::parse(outcome.out);
  EXPECT_FALSE(json["passed"].get<bool>());
  for (const Json& finding : json["findings"]) {
    if (finding["what"] != "consistency of the start") continue;
    EXPECT_NE(finding["detail"].dump().find("hoop"), std::string::npos) << finding;
  }
}

TEST_F(SceneVerbs, CheckRunsEverySceneAgainstItsPublishedValues) {
  const Outcome outcome = run("check --scenes --json");
  EXPECT_EQ(outcome.status, 0) << outcome.out;
  const Json cases = Json::parse(outcome.out)["cases"];
  std::set<std::string> scenes;
  for (const Json& one : cases) {
    EXPECT_TRUE(one["passed"].get<bool>()) << one;
    EXPECT_FALSE(one["source"].get<std::string>().empty()) << one;
    scenes.insert(one["scene"].get<std::string>());
  }
  EXPECT_EQ(scenes.size(), 66U);
  expect_misuse("check --scenes knife_edge", {"--scenes"});
}

TEST_F(SceneVerbs, ExpandPrintsAPlainSceneThatRunsToTheSameBits) {
  const Outcome plain = run("expand spinning_top");
  EXPECT_EQ(plain.status, 0) << plain.err;
  EXPECT_EQ(plain.out.find("[[body]]"), std::string::npos);
  EXPECT_NE(plain.out.find("[[rows]]\nname = \"tip_x\""), std::string::npos) << plain.out;
  EXPECT_EQ(Json::parse(run("expand spinning_top --json").out)["text"], plain.out);
  std::ofstream(path("plain.toml")) << plain.out;
  const std::string of_bodies = path("bodies.csv"), of_rows = path("rows.csv");
  EXPECT_EQ(run("run spinning_top --end 0.05 --out '" + of_bodies + "'").status, 0);
  EXPECT_EQ(run("run '" + path("plain.toml") + "' --end 0.05 --out '" + of_rows + "'").status, 0);
  EXPECT_EQ(contents(of_bodies), contents(of_rows));
  EXPECT_TRUE(run("expand knife_edge").out.starts_with("name = \"knife_edge\""))
      << "as it is, without bodies";
  expect_misuse("expand no_such_scene", {"unknown scene 'no_such_scene'"});
}

TEST_F(SceneVerbs, CheckNamesRedundantRows) {
  const std::string file = "'" + made() + "'";
  change("class = ", "redundant = \"refuse\"\nclass = ");
  change("[start]", "[[rows]]\nname = \"twin\"\nequation = \"3*(x^2 + z^2) = 3*r^2\"\n\n[start]");
  const Outcome outcome = run("check " + file);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.out.find("rank 1 of 2"), std::string::npos) << outcome.out;
}

TEST_F(SceneVerbs, CheckOfASceneWithoutADescriptionBeginsWithItsName) {
  const Outcome outcome = run("check " + scene("plain",
                                               "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n"
                                               "[span]\nend = 1\nstep = 0.1\n"));
  EXPECT_TRUE(outcome.out.starts_with("plain\n\n")) << outcome.out;
}

TEST_F(SceneVerbs, CheckSaysWhyTheRecommendedMethodCannotStep) {
  const std::string file = "'" + made() + "'";
  change("order = 4", "order = 3");
  const Outcome outcome = run("check " + file);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.out.find("no composition of order 3"), std::string::npos) << outcome.out;
  EXPECT_EQ(outcome.out.find("degenerate"), std::string::npos) << outcome.out;
}

TEST_F(SceneVerbs, MistakesInAFileAreMisuse) {
  const std::string file = "'" + made() + "'";
  change("m*g*z", "m*gg*z");
  expect_misuse("check " + file, {"bead.toml:", "unknown name 'gg'", "'g'"});
  expect_misuse("run none.toml", {"none.toml", "cannot be read"});
}

TEST_F(SceneVerbs, SizesAreSetLikeParameters) {
  const Outcome outcome = run("check hanging_chain --set N=5");
  EXPECT_EQ(outcome.status, 0) << outcome.out;
  EXPECT_NE(outcome.out.find("10 coordinates, 5 rows"), std::string::npos);
  EXPECT_NE(outcome.out.find("compiled with the library"), std::string::npos);
  expect_misuse("run hanging_chain --set N=2.5", {"N", "whole number"});
}

}  // namespace
}  // namespace diracstep::testing
