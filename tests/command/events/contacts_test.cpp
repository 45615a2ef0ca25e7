/// Runs over contacts that are as short as their steps, against closed forms.
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

class HardContacts : public Command {
 protected:
  static double end_of(const Outcome& outcome) {
    return nlohmann::json::parse(outcome.out)["end"]["q"]["x"].get<double>();
  }
};

/// A ball that falls from 1 m with g = 9.81 on what pushes it back with `force` below 0, until t = 3.
std::string falling_on(const std::string& force) {
  return "lagrangian = \"v_x^2/2 - 9.81*x\"\n[coordinates]\nx = {}\n[force]\nx = \"" + force +
         "\"\n[start]\nx = 1\n[span]\nend = 3\nstep = 0.01\n";
}

/// Forces of contacts of 1 to 48 ms, and x at t = 3 with 40 digits by mpmath: linear springs and the damped
/// one, which only pushes, by their closed forms; the others by the energy, the time of a contact being
/// 2 ∫ dy/√(v² + 2gy − 2c y^(p+1)/(p+1)).
struct FallOnContact {
  const char* force;
  double end;
};
constexpr FallOnContact falls_on_contacts[] = {
    {"if(x < 0, -1e5*x, 0)", 0.66606743634570760},
    {"if(x < 0, -1e6*x, 0)", 0.61153741114979047},
    {"if(x < 0, -1e7*x, 0)", 0.59350867193903054},
    {"1e5*max(0, -x)^1.5", 0.76541338846290786},
    {"if(x < 0, 1000*sqrt(-x), 0)", 0.89558563542177282},
    {"max(0, -1e5*x - 20*v_x)*if(x < 0, 1, 0)", 0.45084713932053971}};

/// The way to a kink, the contact behind it and the way on are each judged by their own local error.
TEST_F(HardContacts, AreAsExactAsTheLocalErrorAskedFor) {
  for (const FallOnContact& it : falls_on_contacts)
    for (const double eps : {1e-6, 1e-8, 1e-10}) {
      std::ostringstream how;
      how << " --json --method damped/radau:3 --adaptive --eps " << eps;
      const Outcome outcome = run("run " + scene("fall", falling_on(it.force)) + how.str());
      ASSERT_EQ(outcome.status, 0) << it.force << outcome.err;
      EXPECT_NEAR(end_of(outcome), it.end, 50.0 * eps) << it.force << how.str();
    }
}

/// Fixed steps of about the length of the contacts, doubted above 1e-3 of the motion.
TEST_F(HardContacts, OfAFewStepsAreRightOrDoubted) {
  for (const FallOnContact& it : falls_on_contacts)
    for (const char* how : {"", " --step 0.005", " --step 0.02", " --method type1/midpoint --step 0.001",
                            " --method damped/radau:3"}) {
      const Outcome outcome = run("run " + scene("fall", falling_on(it.force)) + " --json" + how);
      ASSERT_TRUE(outcome.status == 0 || outcome.status == 3) << it.force << how << outcome.err;
      EXPECT_TRUE(outcome.status == 3 || std::abs(end_of(outcome) - it.end) < 1e-3)
          << it.force << how << outcome.out;
    }
  const Outcome fine =
      run("run " + scene("fall", falling_on("if(x < 0, -1e5*x, 0)")) + " --json --step 0.001");
  EXPECT_EQ(fine.status, 0) << fine.err;
  EXPECT_NEAR(end_of(fine), falls_on_contacts[0].end, 1e-6);
}

/// At rest behind a landing all velocities are round-off, smaller from step to step; nothing of that ends the
/// run or is told as lost energy.
TEST_F(HardContacts, LeaveAtRestWhatHasLanded) {
  for (const auto& [height, restitution, spans, steps] :
       {std::array{3.0, 0.0, 5.0, 50.0}, std::array{1.0, 0.0, 1.0, 300.0}, std::array{0.01, 0.1, 5.0, 50.0},
        std::array{100.0, 0.3, 5.0, 50.0}, std::array{1e4, 0.3, 5.0, 50.0}}) {
    const double end = spans * (2.0 / (1.0 - restitution) + 1.0) * std::sqrt(2.0 * 9.81 * height) / 9.81;
    std::ostringstream text;
    text.precision(17);
    text << "lagrangian = \"v_x^2/2 - 9.81*x\"\n[coordinates]\nx = {}\n[start]\nx = " << height
         << "\n[[rows]]\nname = \"floor\"\nequation = \"x = 0\"\non = false\n"
            "[[events]]\nname = \"lands\"\nwhen = \"x\"\ndirection = \"falling\"\non = \"floor\"\n";
    if (restitution > 0.0)
      text << "if = \"v_x > -0.01\"\n[[events]]\nname = \"bounces\"\nwhen = \"x\"\nif = \"v_x < "
              "-0.01\"\nrestitution = "
           << restitution;
    text << "\n[span]\nend = " << end << "\nstep = " << end / steps << "\n";
    const Outcome outcome = run("run " + scene("rests", text.str()) + " --json");
    ASSERT_EQ(outcome.status, 0) << height << " " << restitution << outcome.err;
    EXPECT_NEAR(end_of(outcome), 0.0, 1e-15 * height) << height << " " << restitution;
    EXPECT_EQ(nlohmann::json::parse(outcome.out)["events"].back()["name"], "lands") << height;
  }
}

/// The row that the landing switches on holds what its restitution asks for, or something else.
TEST_F(HardContacts, ARestitutionBesideARowOfTheSameContactIsMetOrRefused) {
  const auto landing = [&](const char* restitution) {
    return run("run " +
               scene("landing", std::string(R"toml(
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*y"
coordinates = { x = {}, y = {} }
start = { y = 1, v_x = 1 }
span = { end = 2, step = 0.01 }
rows = [{ name = "floor", equation = "y = 0", on = false }]
events = [{ name = "lands", when = "y", on = "floor", restitution = )toml") +
                                    restitution + " }]\n") +
               " --json");
  };
  const Outcome plastic = landing("0");
  ASSERT_EQ(plastic.status, 0) << plastic.err;
  const auto end = nlohmann::json::parse(plastic.out)["end"];
  EXPECT_NEAR(end["q"]["x"].get<double>(), 2.0, 1e-13);
  EXPECT_NEAR(end["q"]["y"].get<double>(), 0.0, 1e-13);
  EXPECT_NEAR(end["v"]["y"].get<double>(), 0.0, 1e-13);
  const Outcome elastic = landing("0.5");
  EXPECT_EQ(elastic.status, 1);
  EXPECT_NE(elastic.err.find("hold the contact at a speed of"), std::string::npos) << elastic.err;
}

/// Falls from rest at x = 0 onto y + x/2 = 0 and slides down it: no size of x tells what the time is known
/// to.
TEST_F(HardContacts, ALandingOnASlopeIsMetToTheRoundOffOfItsTime) {
  for (const double height : {10.0, 1e4}) {
    const double flight = std::sqrt(2.0 * height / 9.81), end = 1.2 * flight;
    std::ostringstream text;
    text.precision(17);
    text
        << "lagrangian = \"(v_x^2 + v_y^2)/2 - 9.81*y\"\ncoordinates = { x = {}, y = {} }\nstart = { y = "
        << height << " }\nspan = { end = " << end << ", step = " << end / 33.0 << " }\n"
        << "rows = [{ name = \"floor\", equation = \"y + 0.5*x = 0\", on = false }]\n"
           "events = [{ name = \"lands\", when = \"y + 0.5*x\", direction = \"falling\", on = \"floor\" }]\n";
    const double fall = end - flight, along = 0.5 / 1.25;  // of what points down, in x
    const double x = along * (9.81 * flight * fall + 0.5 * 9.81 * fall * fall);
    for (const char* how : {"", " --adaptive"}) {
      const Outcome outcome = run("run " + scene("slope", text.str()) + " --json" + how);
      ASSERT_EQ(outcome.status, 0) << height << how << outcome.err;
      EXPECT_NEAR(end_of(outcome), x, 1e-11 * x) << height << how;
    }
  }
}

/// Floor and ball move at 5e4, and meet at 1e-3: what the impact leaves is the round-off of the former.
TEST_F(HardContacts, ARestitutionOfZeroBesideAFastRowIsMetToItsRoundOff) {
  const Outcome outcome = run("run " + scene("meets", R"toml(
lagrangian = "v_x^2/2"
coordinates = { x = {} }
parameters = { u = 54321.1234567 }
start = { x = 1e-3, v_x = 54321.1224567 }
span = { end = 2, step = 0.1 }
rows = [{ name = "floor", equation = "x - u*t = 0", on = false }]
events = [{ name = "meets", when = "x/3 - u/3*t", on = "floor", restitution = 0 }]
)toml") + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(end_of(outcome), 2 * 54321.1234567, 1e-9);
}

}  // namespace
}  // namespace diracstep::testing
