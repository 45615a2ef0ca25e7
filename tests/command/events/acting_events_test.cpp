#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

/// Events of a scene that act, against closed forms: impacts, settings, rows that are switched, clocks.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

const std::string event_examples = DIRACSTEP_SOURCE "/scenes/";

class ActingEvents : public Command {
 protected:
  /// A scene file in the test's folder, quoted for the shell.
  std::string scene(const std::string& text) const {
    std::ofstream(path("scene.toml")) << text;
    return "'" + path("scene.toml") + "'";
  }
  Json result(const std::string& arguments) const {
    const Outcome outcome = run("run " + arguments + " --json");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(outcome.err.find("doubt"), std::string::npos) << outcome.err;
    return outcome.status == 0 ? Json::parse(outcome.out) : Json::object();
  }
};

const std::string ball = contents(event_examples + "bouncing_ball.toml");

/// Falls for t1 = √(2h/g), and after impact k for 2 t1 e^k; the impulses are m (1 + e) √(2gh) e^k.
TEST_F(ActingEvents, ABallBouncesByItsClosedForm) {
  const double g = 9.81, e = 0.8, falls = std::sqrt(2.0 / g), speed = std::sqrt(2.0 * g);
  for (const char* steps :
       {"--step 0.01", "--step 0.5", "--adaptive", "--method damped/radau:3 --adaptive --eps 1e-10"}) {
    const Json json = result(scene(ball) + " " + steps);
    ASSERT_EQ(json["events"].size(), 6U) << steps;
    double t = falls;
    for (int k = 0; k < 6; ++k, t += 2.0 * falls * std::pow(e, k)) {
      const Json& event = json["events"][static_cast<std::size_t>(k)];
      EXPECT_NEAR(event["t"].get<double>(), t, 2e-13) << steps;
      EXPECT_NEAR(event["v"]["y"].get<double>(), -speed * std::pow(e, k), 1e-12) << steps;
      EXPECT_NEAR(event["after"]["v"]["y"].get<double>(), speed * std::pow(e, k + 1), 1e-12) << steps;
      EXPECT_NEAR(event["impulse"].get<double>(), 2.0 * (1.0 + e) * speed * std::pow(e, k), 1e-11) << steps;
    }
    EXPECT_NEAR(json["end"]["energy"].get<double>(), 2.0 * g * std::pow(e, 12), 1e-11) << steps;
    EXPECT_EQ(json["outputs"]["count"].get<double>(), 6.0);
    EXPECT_NEAR(json["outputs"]["momentum"].get<double>(), 2.0 * json["end"]["v"]["y"].get<double>(), 1e-15);
  }
}

/// A free body passes x = 0, where a counter is set and nothing else.
TEST_F(ActingEvents, ASettingAtAPlaceThatIsPassedIsNoContact) {
  const Json json =
      result(scene("name = \"passing\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n"
                   "[states]\nn = {}\n[start]\nx = 1\nv_x = -1\n[[events]]\nname = \"cross\"\n"
                   "when = \"x\"\nset = { n = \"n + 1\" }\n[span]\nend = 3\nstep = 0.05\n"));
  EXPECT_EQ(json["end"]["q"]["n"], 1.0);
  EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), -2.0, 1e-13);
}

/// Newton's cradle: the middle body touches the last one, so that both impacts are of one time.
TEST_F(ActingEvents, ContactsThatAreClosedActToo) {
  const std::string contact =
      "restitution = 1\n[[events]]\nname = \"bc\"\nwhen = \"c - b\"\nrestitution = 1\n";
  const Json json =
      result(scene("name = \"cradle\"\nlagrangian = \"(v_a^2 + v_b^2 + v_c^2)/2\"\n[coordinates]\n"
                   "a = {}\nb = {}\nc = {}\n[start]\na = -1\nv_a = 1\n[[events]]\nname = \"ab\"\n"
                   "when = \"b - a\"\n" +
                   contact + "[span]\nend = 3\nstep = 0.07\n"));
  EXPECT_NEAR(json["end"]["q"]["b"].get<double>(), 0.0, 1e-12);
  EXPECT_NEAR(json["end"]["q"]["c"].get<double>(), 2.0, 1e-12);
  std::string thrown = ball;
  thrown.replace(thrown.find("y = 1"), 5, "y = 0\nv_y = -1");
  const Json up = result(scene(thrown) + " --set e=1 --end 0.1");
  EXPECT_NEAR(up["end"]["q"]["y"].get<double>(), 0.1 - 0.5 * 9.81 * 0.01, 1e-12);
  std::string resting = ball;
  resting.replace(resting.find("y = 1"), 5, "y = 0");
  EXPECT_EQ(run("run " + scene(resting)).status, 1) << "it would fall through the floor";
}

TEST_F(ActingEvents, AStartBehindAContactAndANegativeRestitutionAreTold) {
  for (const auto& [what, told] : {std::pair("--set e=-0.5", "restitution is -0.5"),
                                   std::pair("y = -0.3", "at the start, behind the contact")}) {
    std::string text = ball;
    std::string options;
    if (what[0] == '-')
      options = std::string(" ") + what;
    else
      text.replace(text.find("y = 1"), 5, what);
    const Outcome outcome = run("run " + scene(text) + options);
    EXPECT_EQ(outcome.status, what[0] == '-' ? 1 : 2) << what;
    EXPECT_NE(outcome.err.find(told), std::string::npos) << what << outcome.err;
  }
}

TEST_F(ActingEvents, ABallThatComesToRestIsToldOrHeldByARow) {
  std::string text = ball;
  text.replace(text.find("e = 0.8"), 7, "e = 0.5");
  const Outcome zeno = run("run " + scene(text));
  EXPECT_EQ(zeno.status, 1);
  EXPECT_NE(zeno.err.find("infinitely often before t = 1.35457092"), std::string::npos) << zeno.err;

  text.replace(text.find("e = 0.5"), 7, "e = 0  ");
  const Outcome plastic = run("run " + scene(text));
  EXPECT_EQ(plastic.status, 1);
  EXPECT_NE(plastic.err.find("closes again at once"), std::string::npos) << plastic.err;

  text.replace(text.find("e = 0  "), 7, "e = 0.5");
  text +=
      "if = \"v_y < -1e-3\"\n[[rows]]\nname = \"ground\"\nequation = \"y = 0\"\non = false\n"
      "[[events]]\nname = \"rest\"\nwhen = \"y\"\ndirection = \"falling\"\nif = \"v_y > -1e-3\"\n"
      "on = \"ground\"\n[[events]]\nname = \"top\"\nwhen = \"v_y\"\n";
  for (const char* steps : {"--step 0.01", "--adaptive"}) {
    const Json json = result(scene(text) + " " + steps);
    EXPECT_EQ(json["events"].back()["name"], "rest") << steps;  // and no top in the round-off behind it
    EXPECT_NEAR(json["end"]["q"]["y"].get<double>(), 0.0, 1e-14) << steps;
    EXPECT_NEAR(json["end"]["v"]["y"].get<double>(), 0.0, 1e-14) << steps;
    EXPECT_NEAR(json["end"]["lambda"]["ground"].get<double>(), 2.0 * 9.81, 1e-12) << steps;
  }
}

/// A ray in an ellipse keeps its energy and L² − (a² − b²) v_y², the product of its angular momenta about the
/// two foci; 10⁴ reflections.  Times near 2e4 have a round-off of 4e-12, by which the points of reflection
/// are off.
TEST_F(ActingEvents, ABilliardInAnEllipseKeepsBothInvariants) {
  const std::string file = scene(contents(event_examples + "elliptic_billiard.toml"));
  const Json json = result(file + " --end 17200");
  EXPECT_GT(json["events"].size(), 10000U);
  EXPECT_NEAR(json["outputs"]["foci"].get<double>(), 0.01 * 0.01 - 3.0 * 0.49, 1e-8);
  EXPECT_NEAR(json["end"]["energy"].get<double>(), 0.745, 1e-11);
  for (const Json& event : json["events"]) {
    const double x = event["q"]["x"], y = event["q"]["y"];
    ASSERT_NEAR(x * x / 4.0 + y * y, 1.0, 1e-10);
  }
}

/// Housner (1963): a block of half width b and half height h that rocks from corner to corner keeps
/// 1 − 3/2 sin²α of its angular velocity, tan α = b/h: the plastic impact onto the rows of the new corner.
TEST_F(ActingEvents, ARockingBlockLosesWhatItsNewCornerTakes) {
  const std::string file = scene(contents(event_examples + "rocking_block.toml"));
  const double sine = 0.25 / std::hypot(0.25, 1.0), kept = 1.0 - 1.5 * sine * sine;
  for (const char* steps : {"--step 0.01", "--adaptive"}) {
    const Json json = result(file + " " + steps);
    ASSERT_GE(json["events"].size(), 4U) << steps;
    std::string last = "to_left";
    for (const Json& event : json["events"]) {
      const double before = event["v"]["th"], after = event["after"]["v"]["th"];
      EXPECT_NEAR(after / before, kept, 1e-12) << steps;
      EXPECT_NEAR(event["q"]["th"].get<double>(), 0.0, 1e-12) << steps;
      EXPECT_NE(event["name"], last) << steps;
      last = event["name"];
    }
    EXPECT_LT(json["constraint"].get<double>(), 1e-12);
    EXPECT_GT(json["outputs"]["carried"].get<double>(), 5.0);
  }
}

/// A block on a belt: sticks until k x = f_s, slips by x = f_k/k + …, and sticks again after
/// 2 (π − atan((f_s − f_k) ω/(k w)))/ω, ω = √(k/m).
const std::string stick_slip = contents(event_examples + "stick_slip.toml");

TEST_F(ActingEvents, ABlockOnABeltSticksAndSlips) {
  const double slip = M_PI - std::atan(1.0), stick = 1.0;  // from x = 0 to 2/4 with 0.5
  for (const auto& [steps, error] : {std::pair{"--step 0.01", 1e-11}, {"--adaptive --eps 0.02", 1e-9}}) {
    const Json json = result(scene(stick_slip) + " " + steps);
    ASSERT_GE(json["events"].size(), 6U);
    double t = stick;
    for (std::size_t k = 0; k < 6; ++k) {
      EXPECT_EQ(json["events"][k]["name"], k % 2 == 0 ? "break" : "stick") << steps;
      EXPECT_NEAR(json["events"][k]["t"].get<double>(), t, error) << steps << ' ' << k;
      t += k % 2 == 0 ? slip : stick;  // the slip ends where it began, mirrored: x = 0
    }
  }
}

/// A wheel that may turn forward only: held where it would turn back, let go where the torque turns.
TEST_F(ActingEvents, ARatchetHoldsAndLetsGo) {
  const Json json = result(scene(contents(event_examples + "ratchet.toml")));
  ASSERT_EQ(json["events"].size(), 2U);
  double low = 2.0, high = 3.0;  // sin t = 0.2 t
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (std::sin(middle) > 0.2 * middle ? low : high) = middle;
  }
  const double holds = low, frees = 2.0 * M_PI - std::acos(0.2);
  EXPECT_NEAR(json["events"][0]["t"].get<double>(), holds, 1e-11);
  EXPECT_NEAR(json["events"][1]["t"].get<double>(), frees, 1e-11);
  const double way = 1.0 - std::cos(holds) - 0.1 * holds * holds, s = 6.0 - frees;
  const double after = std::cos(frees) - std::cos(6.0) - std::sin(frees) * s - 0.1 * s * s;
  EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), way + after, 1e-10);
}

/// A mass under a sampled controller with limits and an integrator that unwinds: the zero-order hold has the
/// motion x + T v + T² u/2m, v + T u/m from sample to sample.
TEST_F(ActingEvents, ASampledControllerIsItsDifferenceEquation) {
  const std::string file = scene(contents(event_examples + "sampled_controller.toml"));
  double x = 0.0, v = 0.0, i = 0.0, u = 0.0;
  for (int k = 0; k < 80; ++k) {
    const double wanted = 40.0 * (1.0 - x) + 20.0 * i - 12.0 * v;
    u = std::min(15.0, std::max(-15.0, wanted));
    i += 0.05 * (1.0 - x + (u - wanted) / 20.0);
    x += 0.05 * v + 0.05 * 0.05 * u / 4.0;
    v += 0.05 * u / 2.0;
  }
  for (const char* steps : {"--step 0.02", "--step 0.2", "--adaptive"}) {
    const Json json = result(file + " " + steps);
    EXPECT_EQ(json["events"].size(), 81U) << steps;
    EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), x, 1e-11) << steps;
    EXPECT_NEAR(json["end"]["v"]["x"].get<double>(), v, 1e-11) << steps;
  }
}

TEST_F(ActingEvents, AResumedRunHasTheBytesOfTheWhole) {
  for (const std::string& text : {stick_slip, ball}) {
    const std::string what = "run " + scene(text) + " --step 0.01";
    ASSERT_EQ(run(what + " --end 2 --out '" + path("whole.csv") + "'").status, 0);
    ASSERT_EQ(run(what + " --end 1.2 --out '" + path("k.csv") + "' --checkpoint '" + path("c") + "'").status,
              0);
    const Outcome rest = run(what + " --end 2 --out '" + path("k.csv") + "' --resume '" + path("c") + "'");
    ASSERT_EQ(rest.status, 0) << rest.err;
    EXPECT_EQ(contents(path("k.csv")), contents(path("whole.csv")));
  }
}

/// Where forces of rows and momenta stand in outputs they are those of the columns beside them.
TEST_F(ActingEvents, OutputsReadForcesAndMomenta) {
  const std::string file = scene(R"toml(name = "pendulum"
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*y"
[coordinates]
x = {}
y = {}
[[rows]]
name = "rod"
equation = "x^2 + y^2 = 1"
[start]
x = 1
[span]
end = 1
step = 0.05
[outputs]
pull = "2*lambda_rod"
momentum = "p_x + v_x"
)toml");
  ASSERT_EQ(run("run " + file + " --out '" + path("p.csv") + "'").status, 0);
  const auto all = lines(contents(path("p.csv")));
  ASSERT_EQ(all.front(), "t,x,y,v_x,v_y,p_x,p_y,lambda_rod,energy,pull,momentum");
  const auto last = fields(all.back());
  EXPECT_EQ(std::stod(last[9]), 2.0 * std::stod(last[7]));
  EXPECT_NE(std::stod(last[7]), 0.0);
  EXPECT_EQ(std::stod(last[10]), std::stod(last[5]) + std::stod(last[3]));
}

TEST_F(ActingEvents, ATableFromAFileIsTheSameAsOneInTheScene) {
  const auto text = [](const std::string& input) {
    return "name = \"pushed\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[inputs]\npush = " + input +
           "\n[force]\nx = \"push\"\n[span]\nend = 2\nstep = 0.1\n";
  };
  std::ofstream(path("push.csv")) << "# measured\nt, other, wind\n0, 9, 1\n1, 9, 3\r\n\n2, 9, -1\n";
  std::ofstream(path("bad.csv")) << "t,wind\n0,1\n1,x\n";
  const Json inlined = result(scene(text("{ times = [0, 1, 2], values = [1, 3, -1] }")));
  const Json read = result(scene(text("{ file = \"push.csv\", column = \"wind\" }")));
  EXPECT_EQ(read["end"], inlined["end"]);
  expect_misuse("run " + scene(text("{ file = \"push.csv\", column = \"rain\" }")),
                {"scene.toml:6", "'rain'", "wind"});
  expect_misuse("run " + scene(text("{ file = \"bad.csv\" }")), {"scene.toml:6", "line 3", "numbers"});
  expect_misuse("run " + scene(text("{ file = \"../push.csv\" }")), {"scene.toml:6", "'..'"});
  expect_misuse("run " + scene(text("{ file = \"none.csv\" }")), {"scene.toml:6", "No such file"});
}

TEST_F(ActingEvents, ATableAtAnotherArgumentNeedNotCoverTheTime) {
  const std::string file = scene(
      "name = \"motor\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[inputs]\ntorque = { times = "
      "[0, 10], values = [2, 0] }\n[force]\nx = \"torque(v_x)\"\n[span]\nend = 30\nstep = 0.1\n");
  EXPECT_NEAR(result(file)["end"]["v"]["x"].get<double>(), 10.0 * (1.0 - std::exp(-6.0)), 1e-9);
}

TEST_F(ActingEvents, BadOnesAreToldWithTheirPlace) {
  const std::string head =
      "name = \"a\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[span]\nend = 1\nstep = 0.1\n"
      "[[events]]\nname = \"e\"\n";
  const auto refused = [&](const std::string& event, const std::vector<std::string>& words) {
    expect_misuse("run " + scene(head + event), words);
  };
  refused("when = \"x\"\non = \"row\"\n", {"scene.toml:11", "no row 'row'"});
  refused("when = \"x\"\nevery = 1\n", {"scene.toml:8", "'every'"});
  refused("every = 0\n", {"scene.toml:10", "above 0"});
  refused("when = \"v_x\"\nrestitution = 1\n", {"scene.toml:10", "without velocities"});
  refused("when = \"x\"\nrestitution = 1\ndirection = \"both\"\n", {"scene.toml:12", "free side"});
  refused("when = \"x\"\nset = { z = \"1\" }\n", {"scene.toml:11", "'z'"});
  refused("when = \"x\"\nset = { p_x = \"1\" }\n", {"scene.toml:11", "velocities v_"});
  refused("when = \"x\"\nif = \"x\"\n", {"scene.toml:11:", "comparison"});
  refused("when = \"lambda_rod\"\n", {"scene.toml:10", "lambda_rod"});
  refused("when = \"sqrt(x - 1)\"\n", {"scene.toml:10", "event 'e' is not a number"});
  const Outcome undefined = run("run " + scene(head + "when = \"sqrt(0.5 - t)\"\n"));
  EXPECT_EQ(undefined.status, 1);
  EXPECT_NE(undefined.err.find("event 'e' is not a number"), std::string::npos) << undefined.err;
}

/// A landing is found to the round-off of its time, which is more than that of the place x = 0.
TEST_F(ActingEvents, ARowIsMetWhereItsEventIsFound) {
  const std::string lands =
      "[[rows]]\nname = \"floor\"\nequation = \"x = 0\"\non = false\n"
      "[[events]]\nname = \"b\"\nwhen = \"x\"\nrestitution = 0.3\nif = \"v_x < -0.5\"\n"
      "[[events]]\nname = \"lands\"\nwhen = \"x\"\ndirection = \"falling\"\nif = \"v_x > -0.5\"\non = "
      "\"floor\"\n";
  for (const char* steps : {"", " --adaptive"}) {
    const Json json = result(scene("name = \"lands\"\nlagrangian = \"v_x^2/2 - 9.81*x\"\n[coordinates]\nx = "
                                   "{}\n[start]\nx = 50\n[span]\nend = 28.284\nstep = 0.05\n" +
                                   lands) +
                             steps);
    EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), 0.0, 1e-25) << steps;
    EXPECT_EQ(json["events"].back()["name"], "lands") << steps;
  }
}

/// A free body starts on the zero of its event; a row holds one until the force on it turns.
TEST_F(ActingEvents, AZeroAtTheStartAndARowWithoutADirectionAreNoted) {
  const std::string head =
      "name = \"a\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[span]\nend = 1.5\nstep = 0.1\n";
  const auto noted = [&](const std::string& text) {
    const Outcome outcome = run("run " + scene(head + text));
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return outcome.err;
  };
  const std::string passes = "[start]\nv_x = 1\n[[events]]\nname = \"e\"\nwhen = \"x\"\n",
                    counts = "set = { v_x = \"1\" }\n", note = "event 'e': its function is 0 at the start";
  EXPECT_NE(noted(passes + counts).find(note), std::string::npos);
  EXPECT_NE(noted(passes + "direction = \"rising\"\n" + counts).find(note), std::string::npos);
  EXPECT_EQ(noted(passes + "direction = \"falling\"\n" + counts).find(note), std::string::npos);
  EXPECT_EQ(noted(passes).find(note), std::string::npos) << "nothing depends on it";

  const std::string held =
      "[force]\nx = \"t - 1\"\n[[rows]]\nname = \"hold\"\nequation = \"x = 0\"\n[[events]]\nname = \"e\"\n"
      "when = \"lambda_hold\"\noff = \"hold\"\n";
  const std::string off = noted(held);
  EXPECT_NE(off.find("row 'hold' stays on until it changes its sign; direction = \"falling\""),
            std::string::npos)
      << off;
  EXPECT_EQ(noted(held + "direction = \"falling\"\n").find("stays on"), std::string::npos);
}

/// Multiples of 0.1 and 0.3 differ by their round-off where they are equal.
TEST_F(ActingEvents, ClocksThatFallTogetherActInTheOrderOfTheScene) {
  const std::string file = scene(
      "name = \"clocks\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[states]\nn = {}\nm = {}\n"
      "[[events]]\nname = \"fast\"\nevery = 0.1\nset = { n = \"n + 1\" }\n[[events]]\nname = \"slow\"\n"
      "every = 0.3\nset = { m = \"n\" }\n[span]\nend = 3\nstep = 0.07\n");
  for (const char* step : {"0.07", "0.05", "0.1", "0.3", "0.15", "0.01", "1"}) {
    const Json json = result(file + " --step " + step);
    ASSERT_EQ(json["events"].size(), 42U) << step;
    int n = 0;
    for (const Json& event : json["events"]) {
      if (event["name"] == "fast")
        ++n;
      else
        EXPECT_EQ(event["after"]["q"]["m"], n) << "step " << step << ", t = " << event["t"];
    }
  }
}

/// Rows that the new point does not fulfil cannot be switched on.
TEST_F(ActingEvents, ARowThatDoesNotFitIsTold) {
  const Outcome outcome = run("run " + scene("name = \"a\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n"
                                             "[start]\nv_x = 1\n[[rows]]\nname = \"stop\"\nequation = \"x = "
                                             "1\"\non = false\n[span]\nend = 1\nstep = 0.1\n[[events]]\n"
                                             "name = \"early\"\nwhen = \"x - 0.5\"\non = \"stop\"\n"));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("event 'early' at t = 0.5"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("stop"), std::string::npos) << outcome.err;
}

/// A point that is set back a length: again and again within a step, whatever its size.
TEST_F(ActingEvents, AreFoundBehindOneThatJumpsInTheSameStep) {
  const std::string head = "name = \"t\"\n[coordinates]\nx = {}\n[states]\nn = {}\n";
  const auto wraps = [&](const std::string& direction) {
    return scene(
        "lagrangian = \"v_x^2/2\"\n" + head +
        "[start]\nv_x = 1\n[span]\nend = 5.5\nstep = 0.1\n[[events]]\nname = \"wrap\"\nwhen = \"x - 1\"\n" +
        direction + "set = { x = \"x - 1\", n = \"n + 1\" }\n");
  };
  const auto expect = [](const Json& json, double x, double n) {
    EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), x, 1e-9);
    EXPECT_NEAR(json["end"]["q"]["n"].get<double>(), n, 1e-9);
  };
  for (const char* steps : {"", " --step 1.7", " --adaptive"}) {
    expect(result(wraps("direction = \"rising\"\n") + steps), 0.5, 5.0);
    expect(result(wraps("") + steps), 0.5, 5.0);
  }
  // x = 1 + n/2 − 9.81 t²/2 lies in (1/2, 1].
  expect(result(scene(
             "lagrangian = \"v_x^2/2 - 9.81*x\"\n" + head +
             "[start]\nx = 1\n[span]\nend = 2\nstep = 0.05\n[[events]]\nname = \"back\"\nwhen = \"x - 0.5\"\n"
             "direction = \"falling\"\nset = { x = \"1\", n = \"n + 1\" }\n")),
         1.0 - 19.62 + 19.5, 39.0);
}

}  // namespace
}  // namespace diracstep::testing
