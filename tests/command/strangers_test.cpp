#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <thread>

#include "run_command.hpp"

/// Files from strangers, and outputs that must not meet anything else: each sentence of docs/safety.md.
namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;

#if defined(DIRACSTEP_ADDRESS_SANITIZER)  // takes terabytes of addresses
constexpr bool sanitized = true;
const std::string limited_memory = "DIRACSTEP_CC=none";
#else
constexpr bool sanitized = false;
const std::string limited_memory = "ulimit -v 4000000; DIRACSTEP_CC=none";
#endif

class Strangers : public Command {
 protected:
  void write(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }

  std::string scene(const std::string& name, const std::string& lagrangian = "v_x^2/2 - x^2/2",
                    const std::string& rest = "") const {
    write(name, "name = \"s\"\nlagrangian = \"" + lagrangian +
                    "\"\n[coordinates]\nx = { unit = \"m\" }\n[start]\nx = 1\n[span]\nend = 1\nstep = 0.1\n" +
                    rest);
    return "'" + path(name) + "'";
  }

  /// Expects a refusal within a second, the figure of the promise, or ten under load; sanitizers take four
  /// times as long.
  void expect_refused_at_once(const std::string& arguments, const std::vector<std::string>& words) const {
    const auto begin = std::chrono::steady_clock::now();
    expect_misuse(arguments, words);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(sanitized ? 40 : 10))
        << arguments;
  }

  static bool shows_control_characters(const std::string& text) {
    for (const char c : text)
      if ((static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == '\x7f') return true;
    return false;
  }
};

// Outputs.

TEST_F(Strangers, NoOutputMeetsAnInputOrAnotherOutput) {
  const std::string own = scene("s.toml"), text = contents(path("s.toml"));
  expect_misuse("run " + own + " --out '" + path("./s.toml") + "'", {"--out", "the scene"});
  expect_misuse("run " + own + " --checkpoint '" + path("s.toml") + "'", {"--checkpoint", "the scene"});
  expect_misuse("run knife_edge --out '" + path("x") + "' --checkpoint '" + path("./x") + "'",
                {"--checkpoint and --out are both"});
  ASSERT_EQ(run("run knife_edge --end 1 --checkpoint '" + path("c") + "'").status, 0);
  expect_misuse("run knife_edge --out '" + path("c") + "' --resume '" +
                    path("../" + fs::path(path("c")).parent_path().filename().string() + "/c") + "'",
                {"--out"});
  expect_misuse("study " + own + " --table '" + path("s.toml") + "'", {"--table", "the scene"});
  const std::string study = "study knife_edge --methods type1/midpoint --steps 0.2 --repeat 1 --out '";
  ASSERT_EQ(run(study + path("out") + "'").status, 0);
  const std::string json = path("out/study.json"), earlier = contents(json);
  expect_misuse(study + path("out/../out") + "' --compare '" + json + "'", {"--out", "over --compare"});
  expect_misuse(study + path("out") + "' --table '" + json + "'", {"--out", "over --table"});
  EXPECT_EQ(contents(json), earlier);
  fs::create_hard_link(path("s.toml"), path("hard"));
  expect_misuse("run " + own + " --out '" + path("hard") + "'", {"--out", "the scene"});
  EXPECT_EQ(contents(path("s.toml")), text);
}

TEST_F(Strangers, NoVerbWritesOverWhatItReads) {
  const std::string own = scene("s.toml", "m*v_x^2/2 - x^2/2", "[parameters]\nm = 1\n"),
                    text = contents(path("s.toml"));
  write("m.csv", "t,x\n0,1\n0.5,0.9\n1,0.5\n");
  expect_misuse("fit " + own + " '" + path("m.csv") + "' --parameters m --residuals '" + path("m.csv") + "'",
                {"--residuals", "the data"});
  expect_misuse("boundary " + own + " --to x=0.5 --out '" + path("s.toml") + "'", {"--out", "the scene"});
  fs::copy_file(DIRACSTEP_SOURCE "/scenes/toda_200.toml", path("t.toml"));
  const std::string parts = "parts '" + path("t.toml") + "' --end 0.1 --out '",
                    toda = contents(path("t.toml"));
  expect_misuse(parts + path("t.toml") + "'", {"--out", "the scene"});
  write("victim", "precious");
  fs::create_symlink("victim", path("p.npy.new"));
  expect_misuse(parts + path("p.npy") + "'", {"p.npy.new"});
  fs::remove(path("p.npy.new"));
  ASSERT_EQ(::mkfifo(path("f.npy.new").c_str(), 0600), 0);
  expect_misuse(parts + path("f.npy") + "'", {"f.npy.new"});
  expect_misuse(parts + "/dev/null'", {"--out", "/dev/null"});
  fs::create_symlink("victim", path("link.npy"));
  EXPECT_EQ(run(parts + path("link.npy") + "'").status, 0);
  EXPECT_TRUE(fs::is_symlink(path("link.npy"))) << "what it leads to is written";
  EXPECT_EQ(contents(path("s.toml")), text);
  EXPECT_EQ(contents(path("t.toml")), toda);
}

TEST_F(Strangers, AMissingFolderIsRefusedBeforeTheRun) {
  for (const char* line :
       {"run kepler_e06 --end 1e9 --out ", "run kepler_e06 --error 1e-13 --end 1e9 --out ",
        "run kepler_e06 --end 1e9 --checkpoint ", "study --table ", "orders --out ", "stability --write "})
    expect_refused_at_once(line + path("none/x"), {"none/x", "No such file"});
}

TEST_F(Strangers, TwoRunsDoNotWriteOneFile) {
  const std::string line = "run kepler_e06 --method type1/midpoint --step 0.001 --end 200 ";
  for (const std::string& option : {"--out '" + path("k.csv") + "'", "--checkpoint '" + path("c") + "'"}) {
    std::thread first([&] { EXPECT_EQ(run(line + option + " --json > /dev/null").status, 0); });
    const std::string lock = option[2] == 'o' ? path("k.csv") : path("c.lock");
    while (!fs::exists(lock)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const Outcome second = [&] {
      const std::string command =
          "'" DIRACSTEP_COMMAND "' " + line + option + " 2>'" + path("second") + "' >/dev/null";
      const int status = std::system(command.c_str());
      return Outcome{WEXITSTATUS(status), "", contents(path("second"))};
    }();
    first.join();
    EXPECT_EQ(second.status, 2) << option;
    EXPECT_NE(second.err.find(option[2] == 'o' ? "another run" : "under way"), std::string::npos)
        << second.err;
  }
  EXPECT_FALSE(fs::exists(path("c.lock")));
}

TEST_F(Strangers, LinksToACheckpointLeadToOneFileAndOneLock) {
  fs::create_directory(path("far"));
  for (const char* name : {"a", "b"}) fs::create_symlink("far/c", path(name));
  const std::string line = "run knife_edge --end 1 --checkpoint '";
  ASSERT_EQ(run(line + path("a") + "'").status, 0);
  EXPECT_TRUE(fs::is_symlink(path("a"))) << "the link was replaced, not what it leads to";
  EXPECT_TRUE(fs::is_regular_file(path("far/c")));
  const std::string held = "flock -x '" + path("far/c.lock") + "'";
  const Outcome outcome = run(line + path("b") + "'", held);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_NE(outcome.err.find("under way"), std::string::npos) << outcome.err;
}

TEST_F(Strangers, ALinkInTheWayOfACheckpointIsNotFollowed) {
  write("victim", "keep");
  for (const char* name : {"c.new", "c.lock"}) {
    fs::create_symlink(path("victim"), path(name));
    EXPECT_EQ(run("run knife_edge --end 1 --checkpoint '" + path("c") + "'").status, 2) << name;
    EXPECT_EQ(contents(path("victim")), "keep") << name;
    fs::remove(path(name));
  }
}

TEST_F(Strangers, ClosedAndFullStandardStreamsAreNoAbort) {
  const std::string line = "run knife_edge --end 1 --out '" + path("k.csv") + "'";
  ASSERT_EQ(run(line).status, 0);
  const std::string whole = contents(path("k.csv"));
  for (const char* ends : {"2>&-", "2>/dev/full", ">&-", "<&- >&- 2>&-"}) {
    fs::remove(path("k.csv"));
    const std::string command = "'" DIRACSTEP_COMMAND "' " + line + " " + ends;
    const int status = std::system(("{ " + command + "; } >/dev/null").c_str());
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << ends << ": " << status;
    EXPECT_EQ(contents(path("k.csv")), whole) << ends;
  }
  for (const char* ends : {">/dev/full", ">&-", "| true"}) {
    const std::string command = "set -o pipefail 2>/dev/null; '" DIRACSTEP_COMMAND
                                "' run knife_edge --end 1 2>'" +
                                path("err") + "' " + ends;
    const int status = std::system(("bash -c \"" + command + "\"").c_str());
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) <= 1) << ends << ": " << status;
  }
  EXPECT_NE(std::system(("'" DIRACSTEP_COMMAND "' list methods >/dev/full 2>'" + path("err") + "'").c_str()),
            0);
  EXPECT_NE(contents(path("err")).find("could not be written"), std::string::npos);
}

// Resuming.

TEST_F(Strangers, AnotherSystemIsNotResumed) {
  const std::string rest = "[parameters]\nc = 0.1\nw = 1\ntab = [1.0, 2.0]\n[force]\nx = \"-c*v_x*tab[1]\"\n";
  const std::string lagrangian = "v_x^2/2 - x^2/2 + 0.3*x*sin(w*t) - max(0, x - 5)^2";
  const std::string out = " --out '" + path("a.csv") + "'", resume = out + " --resume '" + path("c") + "'";
  const std::string own = scene("s.toml", lagrangian, rest), text = contents(path("s.toml"));
  const auto save = [&] {
    fs::remove(path("c"));
    ASSERT_EQ(run("run " + own + " --end 1" + out + " --checkpoint '" + path("c") + "'").status, 0);
  };
  struct Change {
    std::string from, to, told;
  };
  for (const Change& change :
       std::vector<Change>{{"-c*v_x*", "-5*c*v_x*", "force on x is -c*v_x*tab[1], here it is -5*c"},
                           {"[1.0, 2.0]", "[3.0, 2.0]", "array tab"},
                           {"sin(w*t)", "sin(2*w*t)", "lagrangian"},
                           {"x - 5", "x - 6", "lagrangian"},
                           {"[coordinates]", "dissipation = \"v_x^2\"\n[coordinates]", "dissipation"},
                           {"x = 1\n", "x = 1.5\n", "start of x is 1, here it is 1.5"},
                           {"w = 1", "w = 2", "parameter w is 1, here it is 2"},
                           {"[force]", "[[rows]]\nequation = \"x = 1\"\n[force]", "row row1"}}) {
    write("s.toml", text);
    save();
    std::string changed = text;
    changed.replace(changed.find(change.from), change.from.size(), change.to);
    write("s.toml", changed);
    expect_misuse("run " + own + " --end 2" + resume, {"is of another run", change.told});
  }
  write("s.toml", text);
  save();
  expect_misuse("run " + own + " --end 2 --order 4 --momentum plus" + resume,
                {"its order is", "its momentum is projected, here it is plus"});
  write("s.toml", "# a remark\n" + text);
  EXPECT_EQ(run("run " + own + " --end 2" + resume).status, 0) << "a remark changes nothing";
}

// Inputs without an end, and small inputs of large things.

TEST_F(Strangers, DevicesAndPipesAreRefusedAtOnce) {
  fs::create_symlink("/dev/zero", path("zero.toml"));
  ASSERT_EQ(mkfifo(path("pipe.toml").c_str(), 0600), 0);
  for (const char* name : {"zero.toml", "pipe.toml"}) {
    expect_refused_at_once("run '" + path(name) + "'", {"no regular file"});
    expect_refused_at_once("run knife_edge --resume '" + path(name) + "'", {"no regular file"});
    expect_refused_at_once("study knife_edge --compare '" + path(name) + "'", {"no regular file"});
    expect_refused_at_once("stability --write '" + path(name) + "'", {"no regular file"});
    expect_refused_at_once("--plugin '" + path(name) + "' list", {name});
  }
}

TEST_F(Strangers, SmallFilesOfLargeSystemsAreRefusedAtOnce) {
  // Each definition sums the one before it twice, over loops of its own: d16 has 2^16 terms.
  std::string definitions = "[definitions]\nd0 = \"x\"\n";
  for (int k = 1; k <= 40; ++k) {
    const std::string i = "i" + std::to_string(k),
                      sum = "sum(" + i + " = 1..2, " + i + "*d" + std::to_string(k - 1) + ")";
    definitions += "d" + std::to_string(k) + " = \"" + sum + " + " + sum + "\"\n";
  }
  expect_refused_at_once("run " + scene("sums.toml", "v_x^2/2 - d16", definitions), {" parts, the limit"});
  const Outcome terms =
      run("run " + scene("sums.toml", "v_x^2/2 - d8", definitions), "DIRACSTEP_LIMITS=sum_terms=100");
  EXPECT_EQ(terms.status, 2);
  EXPECT_NE(terms.err.find("100 terms"), std::string::npos) << terms.err;
  expect_refused_at_once("run " + scene("parts.toml", "v_x^2/2 - d40", definitions), {" parts, the limit"});

  std::string dotted = "name = \"m\"\na";
  for (int k = 0; k < 100000; ++k) dotted += ".a";
  write("dotted.toml", dotted + " = 1\n");
  expect_refused_at_once("run '" + path("dotted.toml") + "'", {"dotted.toml:2", "nested too deep"});
  write("header.toml", "name = \"m\"\n[" + dotted.substr(11) + "]\n");
  expect_refused_at_once("run '" + path("header.toml") + "'", {"nested too deep"});

  expect_refused_at_once("run " + scene("inner.toml", "v_x^2/2 - sum(i = 1..1000000000, sum(j = 1..0, x))"),
                         {"repeated elements"});
  expect_refused_at_once(
      "run " + scene("outer.toml", "v_x^2/2 - sum(i = 1..100000, j = 1..100000, k = 1..0, x)"),
      {"repeated elements"});

  std::string large;
  large.resize(17'000'000, '#');
  write("large.toml", large);
  expect_refused_at_once("run '" + path("large.toml") + "'", {"16000000 bytes"});
}

TEST_F(Strangers, LimitsCanBeSet) {
  const std::string own = scene("s.toml", "v_x^2/2 - sum(i = 1..1000, x^2*i/500500)");
  EXPECT_EQ(run("run " + own).status, 0);
  const Outcome refused = run("run " + own, "DIRACSTEP_LIMITS=repeated=999");
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("999 repeated elements"), std::string::npos) << refused.err;
  EXPECT_EQ(run("run " + own, "DIRACSTEP_LIMITS=file_bytes=10").status, 2);
  for (const char* wrong : {"DIRACSTEP_LIMITS=none=1", "DIRACSTEP_LIMITS=repeated=-1",
                            "DIRACSTEP_LIMITS=repeated", "DIRACSTEP_LIMITS=repeated=1.5"}) {
    const Outcome outcome = run("run " + own, wrong);
    EXPECT_EQ(outcome.status, 2) << wrong;
    EXPECT_NE(outcome.err.find("DIRACSTEP_LIMITS"), std::string::npos) << outcome.err;
  }
}

TEST_F(Strangers, ManyRowsLoadInATimeThatGrowsWithTheirNumber) {
  const auto seconds = [&](int rows) {
    std::string text;
    for (int k = 0; k < rows; ++k) text += "[[rows]]\nequation = \"v_x = " + std::to_string(k) + "*v_y\"\n";
    write("rows.toml",
          "name = \"m\"\nlagrangian = \"v_x^2/2 + v_y^2/2\"\n[coordinates]\nx = {}\ny = {}\n"
          "[span]\nend = 1\nstep = 0.1\n" +
              text);
    const auto begin = std::chrono::steady_clock::now();
    // refused once it is loaded: there is no such parameter
    EXPECT_EQ(run("run '" + path("rows.toml") + "' --set none=1", "DIRACSTEP_CC=none").status, 2);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const double few = seconds(5000), many = seconds(40000);
  EXPECT_LT(many, 8.0 * 4.0 * few) << "quadratic: 64 times";
}

TEST_F(Strangers, ManyRowsOfOneCoordinateAreLeftOutAtOnce) {
  const auto seconds = [&](int count) {
    std::string rows;
    for (int k = 0; k < count; ++k) rows += "[[rows]]\nequation = \"x = 1\"\n";
    const std::string own = scene("rows.toml", "v_x^2/2", rows);
    const auto begin = std::chrono::steady_clock::now();
    const Outcome noted = run("run " + own, limited_memory);
    EXPECT_EQ(noted.status, 0);
    EXPECT_NE(noted.err.find("and " + std::to_string(count - 51) + " more; forces"), std::string::npos)
        << noted.err.substr(0, 500);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const double few = seconds(3000), many = seconds(30000);
  EXPECT_LT(many, 10.0 * 4.0 * few) << "quadratic: 100 times";
}

TEST_F(Strangers, ALargeStartIsNotProjected) {
  std::string rows;
  for (int k = 0; k < 10001; ++k) rows += "[[rows]]\nequation = \"x = 1\"\n";
  write("guessed.toml",
        "name = \"s\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[start]\nx = 2\nguess = [\"x\"]\n"
        "[span]\nend = 1\nstep = 0.1\n" +
            rows);
  const Outcome refused = run("run '" + path("guessed.toml") + "'", limited_memory);
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("at most 10000 together"), std::string::npos) << refused.err.substr(0, 500);
}

// Strangers' text.

TEST_F(Strangers, ControlCharactersAreShownEscaped) {
  const std::string escape = "\\u001B]0;owned\\u0007\\u001B[2J";
  const std::string own = scene("s.toml", "v_x^2/2 - x^2/2",
                                "[[reference]]\nkind = \"exact\"\nhow = \"a" + escape +
                                    "\"\ndigits = 12\nx = \"cos(t)\"\nv_x = \"-sin(t)\"\n");
  std::string text = contents(path("s.toml"));
  text.insert(text.find("lagrangian"), "description = \"d" + escape + "\"\nclass = \"c" + escape + "\"\n");
  write("s.toml", text);
  for (const std::string& line :
       {"run " + own, "check " + own, "plan " + own, "run " + own + " --json",
        "study " + own + " --methods type1/midpoint --steps 0.1 --without-ida --repeat 1"}) {
    const Outcome outcome = run(line);
    EXPECT_NE(outcome.status, 2) << line << outcome.err;
    EXPECT_FALSE(shows_control_characters(outcome.out + outcome.err)) << line;
  }
  EXPECT_NE(run("check " + own).out.find("\\u001b]0;owned\\u0007"), std::string::npos);
  write("key.toml", "\"a\\u001Bb\" = 1\n");
  const Outcome outcome = run("run '" + path("key.toml") + "'");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_FALSE(shows_control_characters(outcome.err)) << outcome.err;
  EXPECT_FALSE(shows_control_characters(run("run \"$(printf 'a\\033b')\"").err));
}

TEST_F(Strangers, ATextBecomesNoCommandOfGnuplotAndNoElementOfThePage) {
  if (std::system("command -v gnuplot >/dev/null 2>&1") != 0) GTEST_SKIP() << "no gnuplot here";
  const std::string mark = path("owned");
  const std::string evil = "s\\nsystem(\\\"touch " + mark + "\\\")\\n<script>alert(1)</script>";
  write("s.toml",
        "name = \"s\"\ndescription = \"" + evil + "\"\nsource = \"" + evil + "\"\nclass = \"" + evil +
            "\"\nlagrangian = \"v_x^2/2 - k*x^2/2\"\n[coordinates]\nx = { unit = \"" + evil +
            "\", meaning = \"" + evil + "\" }\n[parameters]\nk = { value = 1, unit = \"1/" + evil +
            "\", meaning = \"t" + evil +
            "\" }\n[start]\nx = 1\n[span]\nend = 1\nstep = 0.1\n[[reference]]\nkind = \"exact\"\nhow = \"" +
            evil + "\"\ndigits = 12\nx = \"cos(t)\"\nv_x = \"-sin(t)\"\n");
  const Outcome outcome = run("study '" + path("s.toml") +
                              "' --methods type1/midpoint --steps 0.1,0.05 --without-ida "
                              "--without-erk --repeat 1 --out '" +
                              path("out") + "'");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_FALSE(fs::exists(mark)) << "a command of the scene file was run";
  EXPECT_EQ(contents(path("out/report.html")).find("<script>alert(1)"), std::string::npos);
  EXPECT_NE(contents(path("out/report.html")).find("&lt;script&gt;alert(1)"), std::string::npos);
}

TEST_F(Strangers, NoTextOfAFileReachesTheCompiler) {
  const std::string source = path("seen.c");
  write("cc", "#!/bin/sh\nfor a in \"$@\"; do case \"$a\" in *.c) cp \"$a\" '" + source +
                  "';; esac; done\nexit 1\n");
  fs::permissions(path("cc"), fs::perms::owner_all);
  std::string text = contents(path("s.toml"));
  const std::string own = scene("s.toml", "v_evil^2/2 - magic*evil^2/2", "[parameters]\nmagic = 1.5\n");
  text = contents(path("s.toml"));
  text.replace(text.find("x = {"), 5, "evil = {");
  text.replace(text.find("x = 1"), 5, "evil = 1");
  write("s.toml", text);
  const Outcome outcome =
      run("run " + own, "DIRACSTEP_CC='" + path("cc") + "' DIRACSTEP_CACHE='" + path("cache") + "'");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const std::string seen = contents(source);
  ASSERT_NE(seen.find("diracstep_kernels_"), std::string::npos);
  for (const char* word : {"evil", "magic", "s.toml"}) EXPECT_EQ(seen.find(word), std::string::npos) << word;
}

}  // namespace
}  // namespace diracstep::testing
