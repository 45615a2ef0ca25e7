/// Motions at rest, coordinates that are zero, units that differ by far, and what happens at the very end of
/// a span: where nothing but round-off has a size.
#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Edges : public Command {
 protected:
  Json json(const std::string& text, const std::string& options = "") const {
    const Outcome outcome = run("run " + scene("edge", text) + ' ' + options + " --json");
    EXPECT_EQ(outcome.status, 0) << options << '\n' << text << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  static double number(const Json& json, const char* kind, const char* name) {
    return json["end"][kind][name].get<double>();
  }
};

TEST_F(Edges, ATableHasItsInnerSlopeAtItsEnds) {
  const std::string driven =
      "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[inputs]\nw = { times = [0, 1], values = [0, 1] }\n"
      "[[rows]]\nname = \"r\"\nequation = \"x - w = 0\"\n[start]\nv_x = 1\n[span]\nend = 1\nstep = 0.04\n";
  for (const char* options : {"", "--adaptive", "--error 1e-6", "--step 0.3"})
    EXPECT_NEAR(number(json(driven, options), "v", "x"), 1.0, 1e-9) << options;
}

TEST_F(Edges, AHitAtTheEndOfTheSpanIsTheLast) {
  const std::string wall =
      "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[[events]]\nname = \"w\"\n"
      "when = \"x\"\nrestitution = 0.5\n[start]\nx = 1\nv_x = -1\n"
      "[span]\nend = 1\nstep = 0.05\n";
  for (const char* options : {"", "--adaptive"})
    EXPECT_NEAR(number(json(wall, options), "v", "x"), 0.5, 1e-12) << options;
}

/// Four legs of a table whose top stays where all is zero: each holds a quarter of 9.81 N.
TEST_F(Edges, RedundantRowsOfCoordinatesThatAreZero) {
  std::string table =
      "lagrangian = \"(v_z^2 + v_a^2 + v_b^2)/2 - 9.81*z\"\n[coordinates]\nz = {}\na = {}\n"
      "b = {}\n[start]\nz = 0\n[span]\nend = 1\nstep = 0.05\n";
  int leg = 0;
  for (const char* equation : {"z + a + b", "z + a - b", "z - a + b", "z - a - b"})
    table += "[[rows]]\nname = \"leg" + std::to_string(++leg) + "\"\nequation = \"" + equation + " = 0\"\n";
  for (const char* options : {"", "--error 1e-6"})
    EXPECT_NEAR(number(json(table, options), "lambda", "leg4"), 9.81 / 4, 1e-12) << options;
  std::string lever =
      "lagrangian = \"5*v_y^2/2 + v_th^2/2 - 49.05*y\"\n[coordinates]\ny = {}\nth = {}\n"
      "[start]\ny = 0\n[span]\nend = 1\nstep = 0.05\n";
  int end = 0;
  for (const char* equation : {"y - th", "y", "y + th"})
    lever += "[[rows]]\nname = \"end" + std::to_string(++end) + "\"\nequation = \"" + equation + " = 0\"\n";
  EXPECT_NEAR(number(json(lever), "lambda", "end2"), 49.05 / 3, 1e-11);
}

/// A chain that hangs still, two masses on springs, and a disc of half a nanometre that rolls.
TEST_F(Edges, TheErrorAskedForIsReached) {
  const Json chain = json(
      "lagrangian = \"sum(j=1..3, (v_x[j]^2 + v_y[j]^2)/2 - 9.81*y[j])\"\n[coordinates]\n"
      "x = { for = \"j=1..3\" }\ny = { for = \"j=1..3\" }\n[[rows]]\nname = \"hook\"\n"
      "equation = \"x[1]^2 + y[1]^2 - 1 = 0\"\n[[rows]]\nname = \"link\"\nfor = \"j=2..3\"\n"
      "equation = \"(x[j]-x[j-1])^2 + (y[j]-y[j-1])^2 - 1 = 0\"\n[start]\ny = \"-j\"\n"
      "[span]\nend = 3\nstep = 0.02\n",
      "--error 1e-6");
  EXPECT_NEAR(number(chain, "q", "y_3"), -3.0, 1e-14);
  const std::string springs =
      "lagrangian = \"(v_x^2 + v_y^2)/2 - 9.81*(x + y) - 50*x^2 - 50*(y - x)^2\"\n[coordinates]\nx = {}\n"
      "y = {}\n[start]\nx = \"-19.62/100\"\ny = \"-29.43/100\"\n[span]\nend = 3\nstep = 0.02\n";
  for (const char* options : {"--error 1e-6", "--adaptive"})
    EXPECT_NEAR(number(json(springs, options), "q", "y"), -0.2943, 1e-14) << options;
  const Json disc = json(
      "lagrangian = \"(v_x^2 + v_y^2) + R^2*(v_th^2/2 + v_ph^2/4)\"\n[coordinates]\nx = {}\ny = {}\nth = {}\n"
      "ph = {}\n[parameters]\nR = 5e-10\n[[rows]]\nname = \"rx\"\nequation = \"v_x - R*cos(ph)*v_th = 0\"\n"
      "[[rows]]\nname = \"ry\"\nequation = \"v_y - R*sin(ph)*v_th = 0\"\n[start]\nv_th = 3\nv_ph = 0.7\n"
      "v_x = \"3*R\"\n[span]\nend = 4\nstep = 0.05\n",
      "--error 1e-6");
  EXPECT_NEAR(number(disc, "q", "x") / 5e-10, 3.0 / 0.7 * std::sin(2.8), 1e-6);
}

/// A steady turn has no acceleration, and steps still stay within what the retraction reaches.
TEST_F(Edges, ASteadyTurnByVariableSteps) {
  const Json spin = json(
      "lagrangian = \"(w_R[1]^2 + 2*w_R[2]^2 + 3*w_R[3]^2)/2\"\n[coordinates]\nR = \"SO3\"\n"
      "[start]\nw_R = [0, 0, 3]\n[span]\nend = 5\nstep = 0.05\n[outputs]\nr = \"R[1,1]\"\n",
      "--adaptive");
  EXPECT_NEAR(spin["outputs"]["r"].get<double>(), std::cos(15.0), 1e-12);
}

/// Friction by a steep tanh: a body that stops, v = 3 - 0.3 g t, and one on a belt, whose end is right
/// although its steps pass over the ramp.
TEST_F(Edges, SteepFriction) {
  const std::string stops =
      "lagrangian = \"v_x^2\"\n[coordinates]\nx = {}\n[force]\n"
      "x = \"-0.3*2*9.81*tanh(v_x/1e-3)\"\n[start]\nv_x = 3\n[span]\nend = 2\nstep = 0.05\n";
  const double g = 0.3 * 9.81, eps = 1e-3;
  // x = ∫ v dt with dv/dt = -g tanh(v/eps): ∫_0^3 v / (g tanh(v/eps)) dv = (3²/2 + eps² π²/12)/g
  EXPECT_NEAR(number(json(stops, "--error 1e-6"), "q", "x"), (4.5 + eps * eps * M_PI * M_PI / 12) / g, 1e-6);
  const Json belt = json(
      "lagrangian = \"v_x^2/2 - 2*x^2\"\n[coordinates]\nx = {}\n[force]\n"
      "x = \"3*(1 + 0.5*exp(-abs(0.5 - v_x)/0.2))*tanh((0.5 - v_x)/0.01)\"\n"
      "[span]\nend = 6\nstep = 0.02\n");
  EXPECT_NEAR(number(belt, "q", "x"), 1.0270649, 1e-5);  // by Runge-Kutta with steps of 1e-5
}

/// Where a motion sticks at a jump no method follows it: none is recommended.
TEST_F(Edges, DryFrictionAtRestIsNoCaseForDampedMethods) {
  const Outcome outcome =
      run("run " + scene("sticks",
                         "lagrangian = \"v_x^2\"\n[coordinates]\nx = {}\n[force]\n"
                         "x = \"-5.886*sign(v_x)\"\n[start]\nv_x = 3\n[span]\nend = 2\nstep = 0.05\n"));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("points back from both sides"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.err.find("damped/radau"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace diracstep::testing
