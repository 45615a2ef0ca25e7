#include <complex>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// The verb equilibrium.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

const std::string examples = DIRACSTEP_SOURCE "/examples/scenes/";

/// Eigenvalues with imaginary parts 0 or above, as the verb orders them.
std::vector<std::complex<double>> eigenvalues_in(const Json& json) {
  std::vector<std::complex<double>> all;
  for (const Json& mode : json["modes"])
    all.emplace_back(mode["eigenvalue"][0].get<double>(), mode["eigenvalue"][1].get<double>());
  return all;
}

class EquilibriumVerb : public Command {
 protected:
  Json found(const std::string& arguments) const {
    const Outcome outcome = run("equilibrium " + arguments + " --json");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return Json::parse(outcome.out);
  }
  /// Whether Spectra was there when the command was built.
  bool has_sparse_modes() const {
    return run("equilibrium hanging_chain --set N=9 --modes 1").err.find("Spectra") == std::string::npos;
  }
  void expect_eigenvalues(const Json& json, const std::vector<std::complex<double>>& published) const {
    const auto all = eigenvalues_in(json);
    ASSERT_EQ(all.size(), published.size()) << json["modes"];
    for (std::size_t k = 0; k < all.size(); ++k)
      EXPECT_LT(std::abs(all[k] - published[k]), 1e-10 * std::abs(published[k])) << all[k] << published[k];
  }
};

/// Meijaard, Papadopoulos, Ruina, Schwab 2007, table 2: castering, capsize and weave at 5 m/s; at rest two
/// pairs of real ones.
const std::vector<std::complex<double>> at_5 = {
    -14.07838969279822, -0.32286642900409, {-0.77534188219585, 4.46486771378823}};
const std::vector<std::complex<double>> at_0 = {-5.53094371765393, -3.13164324790656, 3.13164324790656,
                                                5.53094371765393};
const std::vector<std::complex<double>> at_10 = {
    -24.62459635017404, 0.16105338653172, {-3.72016840437287, 10.90681139476287}};

/// a' = 5a + b, b' = a - 3b: 1 ± √17.
TEST_F(EquilibriumVerb, StatesAloneHaveTheirEigenvalues) {
  std::ofstream(path("states.toml"))
      << "name = \"states\"\nlagrangian = \"0\"\n[coordinates]\n[states]\na = { rate = \"5*a + b\" }\n"
         "b = { rate = \"a - 3*b\" }\n[span]\nend = 1\nstep = 0.1\n";
  const Json json = found("'" + path("states.toml") + "'");
  expect_eigenvalues(json, {1.0 - std::sqrt(17.0), 1.0 + std::sqrt(17.0)});
  EXPECT_EQ(json["stability"].get<std::string>().substr(0, 8), "unstable");
}

/// Nothing in it depends on the time; round-off of th = 1 is no change, although the start is at 0.
TEST_F(EquilibriumVerb, ARestFarFromAStartAtZeroIsNotDoubted) {
  std::ofstream(path("servo.toml"))
      << "name = \"servo\"\nlagrangian = \"0.01*v_th^2/2\"\n[coordinates]\nth = {}\n[states]\n"
         "total = { rate = \"1 - th\" }\nlag = { rate = \"(th - lag)/0.01\" }\n[force]\n"
         "th = \"20*(1 - th) + 10*total - 2*(th - lag)/0.01 - 0.35*v_th\"\n[span]\nend = 3\nstep = 0.01\n";
  const Outcome outcome = run("equilibrium '" + path("servo.toml") + "'");
  EXPECT_EQ(outcome.status, 0) << outcome.err << outcome.out;
}

TEST_F(EquilibriumVerb, RowsThatMoveAreTold) {
  for (const char* row : {"v_x = 1", "x = 0.1*sin(3*t)"}) {
    std::ofstream(path("belt.toml"))
        << "name = \"belt\"\nlagrangian = \"(v_x^2 + v_y^2 - y^2)/2\"\n[coordinates]\n"
           "x = {}\ny = {}\n[[rows]]\nequation = \""
        << row << "\"\n[span]\nend = 1\nstep = 0.1\n";
    const Outcome outcome = run("equilibrium '" + path("belt.toml") + "'");
    EXPECT_NE(outcome.status, 0) << row << outcome.out;
  }
}

/// A governor driven at a constant rate by a row: cos θ = g/(W² l), as where it turns by itself.
TEST_F(EquilibriumVerb, ARowThatDrivesKeepsItsVelocityAlongAMotion) {
  std::ofstream(path("governor.toml"))
      << "name = \"governor\"\nlagrangian = \"l^2*(v_th^2 + v_ph^2*sin(th)^2) + 2*9.81*l*cos(th)\"\n"
         "[coordinates]\nph = {}\nth = {}\n[parameters]\nl = 0.4\n[[rows]]\nname = \"motor\"\n"
         "equation = \"v_ph = 7\"\n[start]\nth = 0.8\nv_ph = 7\n[span]\nend = 1\nstep = 0.01\n";
  const Json json = found("'" + path("governor.toml") + "' --along");
  EXPECT_EQ(json["v"]["ph"].get<double>(), 7.0);
  EXPECT_NEAR(json["q"]["th"].get<double>(), std::acos(9.81 / (49.0 * 0.4)), 1e-12);
}

/// Along a stiff valley the forces stay as large as they are until its end.
TEST_F(EquilibriumVerb, AStiffSpringPendulumHangs) {
  for (const std::string k : {"1e2", "1e4", "1e6"}) {
    const Json json = found("stiff_spring_pendulum --set k=" + k);
    EXPECT_NEAR(json["q"]["x"].get<double>(), 0.0, 1e-10) << k;
    EXPECT_NEAR(json["q"]["y"].get<double>(), -1.0 - 9.81 / std::stod(k), 1e-10) << k;
  }
}

TEST_F(EquilibriumVerb, LinearBicycleHasThePublishedEigenvalues) {
  const Json json = found(examples + "bicycle_linear.toml");
  expect_eigenvalues(json, at_5);
  EXPECT_EQ(json["stability"].get<std::string>().substr(0, 21), "asymptotically stable");
  expect_eigenvalues(found(examples + "bicycle_linear.toml --set speed=0"), at_0);
  expect_eigenvalues(found(examples + "bicycle_linear.toml --set speed=10"), at_10);
}

TEST_F(EquilibriumVerb, RollingBicycleWithItsRowsHasThePublishedEigenvalues) {
  const Json json = found(examples + "bicycle.toml --along");
  expect_eigenvalues(json, at_5);
  EXPECT_EQ(json["zero_eigenvalues"], 6);  // x, y, yaw, both wheels, and the speed
  EXPECT_EQ(json["mass"].size(), 3U);
  EXPECT_EQ(json["stiffness"][0].size(), 7U);
  EXPECT_LT(json["variation"].get<double>(), 1e-10);
  expect_eigenvalues(found(examples + "bicycle.toml --along --set speed=10"), at_10);
  expect_eigenvalues(found(examples + "bicycle.toml"), at_0);
}

TEST_F(EquilibriumVerb, NamesCoordinatesRowsAndModes) {
  const Outcome outcome = run("equilibrium pendulum_cartesian");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  for (const char* part :
       {"at rest", "force of row rod", "1 of position, 1 of velocity", "eigenvalue", "x 1"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << '\n' << outcome.out;
}

TEST_F(EquilibriumVerb, AHangingChainVibratesAsAChainOfLinksDoes) {
  // Small swings of a hanging chain of N equal links of length l/N with masses at their ends: the squares of
  // the rates are g N/l times the zeros of Laguerre's polynomial of degree N.  Degree 2: 2 ± sqrt 2.
  const Json json = found("hanging_chain --set N=2");
  const auto all = eigenvalues_in(json);
  ASSERT_EQ(all.size(), 2U);
  const double g = json["parameters"]["g"];
  EXPECT_NEAR(all[0].imag(), std::sqrt(2.0 * g * (2.0 - std::sqrt(2.0))), 1e-10);
  EXPECT_NEAR(all[1].imag(), std::sqrt(2.0 * g * (2.0 + std::sqrt(2.0))), 1e-10);
}

/// L_n(x) of Laguerre and its derivative.
std::pair<double, double> laguerre(int n, double x) {
  double last = 1.0, value = 1.0 - x;
  for (int k = 1; k < n; ++k) {
    const double next = ((2.0 * k + 1.0 - x) * value - k * last) / (k + 1.0);
    last = value;
    value = next;
  }
  return {value, n * (value - last) / x};
}

/// N equal links with masses at their ends: ω² N = x g/length with L_N(x) = 0 (Laguerre).
TEST_F(EquilibriumVerb, SparseModesOfAChainBeyondFullMatricesAreZerosOfLaguerre) {
  if (!has_sparse_modes()) GTEST_SKIP() << "built without Spectra";
  constexpr int links = 1200;  // 2400 coordinates
  const Json json = found("hanging_chain --set N=1200 --modes 4");
  const auto all = eigenvalues_in(json);
  ASSERT_GE(all.size(), 4U);
  const std::vector<double> bessel_zeros{2.404825557695773, 5.520078110286311, 8.653727912911013,
                                         11.79153443901428};  // of J_0, near which those of L_N begin
  for (std::size_t k = 0; k < 4; ++k) {
    double x = bessel_zeros[k] * bessel_zeros[k] / (4.0 * links + 2.0);
    for (int i = 0; i < 8; ++i) {
      const auto [value, slope] = laguerre(links, x);
      x -= value / slope;
    }
    EXPECT_NEAR(all[k].imag(), std::sqrt(9.81 * x * links), 1e-8 * all[k].imag());
    EXPECT_EQ(all[k].real(), 0.0);
  }
}

TEST_F(EquilibriumVerb, AFewModesBySparseMatricesAreThoseOfFullOnes) {
  if (!has_sparse_modes()) GTEST_SKIP() << "built without Spectra";
  std::ofstream(path("damped.toml"))
      << "name = \"damped\"\nlagrangian = \"sum(i = 1..N, v_x[i]^2/2) - sum(i = 2..N, (x[i] - x[i-1])^2/2) - "
         "x[1]^2/2\"\ndissipation = \"sum(i = 2..N, 0.05*(v_x[i] - v_x[i-1])^2) + 0.3*v_x[N]^2\"\n"
         "[sizes]\nN = 30\n[coordinates]\nx = { for = \"i = 1..N\" }\n[span]\nend = 1\nstep = 0.1\n";
  for (const std::string& scene :
       {std::string("hanging_chain --set N=20"), "'" + path("damped.toml") + "'"}) {
    const auto full = eigenvalues_in(found(scene)), sparse = eigenvalues_in(found(scene + " --modes 5"));
    ASSERT_GE(sparse.size(), 4U) << scene;
    for (const std::complex<double> value : sparse) {
      double nearest = 1e300;
      for (const std::complex<double> known : full) nearest = std::min(nearest, std::abs(value - known));
      EXPECT_LT(nearest, 1e-9 * std::abs(value)) << scene << value;
    }
    EXPECT_LT(std::abs(sparse.front() - full.front()), 1e-9 * std::abs(full.front())) << scene;
  }
}

/// At u = 0, found from sin(2πx), forces are round-off of what was moved: no change with the time.
TEST_F(EquilibriumVerb, SparseModesLeaveOutRedundantRows) {
  if (!has_sparse_modes()) GTEST_SKIP() << "built without Spectra";
  const auto pendulums = [&](const std::string& name, const std::string& rows) {
    return nlohmann::json::parse(
        run("equilibrium '" +
            scene(name,
                  "lagrangian = \"sum(j = 1..3, (v_x[j]^2 + v_y[j]^2)/2 - j*y[j])\"\n[coordinates]\n"
                  "x = { for = \"j = 1..3\" }\ny = { for = \"j = 1..3\" }\n" +
                      rows + "[start]\nx = 0.6\ny = -0.8\n[span]\nend = 1\nstep = 0.1\n") +
            "' --modes 2 --json")
            .out);
  };
  const std::string a = "[[rows]]\nname = \"a\"\nfor = \"j = 1..3\"\nequation = \"x[j]^2 + y[j]^2 = 1\"\n";
  const auto twice = pendulums("twice", a + "[[rows]]\nname = \"b\"\nfor = \"j = 1..3\"\n"
                                            "equation = \"2*(x[j]^2 + y[j]^2) = 2\"\n");
  ASSERT_EQ(twice["modes"].size(), 2u) << twice;
  EXPECT_NEAR(twice["modes"][0]["eigenvalue"][1].get<double>(), 1.0, 1e-9);
  EXPECT_NEAR(twice["modes"][1]["eigenvalue"][1].get<double>(), std::sqrt(2.0), 1e-9);
  // The weight j is carried by Λ_a 2 + Λ_b 4.
  EXPECT_NEAR(std::abs(twice["lambda"]["a_3"].get<double>()), 3.0 / 10.0, 1e-10);
  EXPECT_NEAR(std::abs(twice["lambda"]["b_3"].get<double>()), 6.0 / 10.0, 1e-10);
}

TEST_F(EquilibriumVerb, SparseModesOfAFieldWithoutTimeAreNotDoubted) {
  if (!has_sparse_modes()) GTEST_SKIP() << "built without Spectra";
  std::ofstream(path("string.toml"))
      << "name = \"string\"\ndissipation = \"integral(0.2*u_t^2/2)\"\n[field]\n"
         "density = \"u_t^2/2 - u_x^2/2\"\nspace = \"lobatto:3\"\ncells = 10\nlength = 1\n"
         "boundary = \"periodic\"\n[coordinates]\nu = {}\n[start]\nu = \"sin(2*pi*x)\"\n"
         "[span]\nend = 1\nstep = 0.02\n";
  const auto all = eigenvalues_in(found("'" + path("string.toml") + "' --modes 4"));  // status 0
  ASSERT_FALSE(all.empty());
}

/// With nonholonomic rows, along a motion, near a negative number: capsize of the bicycle at 5 m/s.
TEST_F(EquilibriumVerb, SparseModesKnowNonholonomicRows) {
  if (!has_sparse_modes()) GTEST_SKIP() << "built without Spectra";
  const auto all = eigenvalues_in(found("'" + examples + "bicycle.toml' --along --modes 2 --near=-0.3"));
  double nearest = 1e300;
  for (const std::complex<double> value : all) nearest = std::min(nearest, std::abs(value - at_5[1]));
  EXPECT_LT(nearest, 1e-10);
}

TEST_F(EquilibriumVerb, APictureShowsEigenvaluesAndModes) {
  const std::string stem = path("modes");
  ASSERT_EQ(run("equilibrium hanging_chain --set N=4 --picture '" + stem + "'").status, 0);
  const std::string svg = contents(stem + ".svg");
  EXPECT_NE(svg.find("eigenvalues of hanging_chain"), std::string::npos);
  EXPECT_NE(svg.find("x_4"), std::string::npos);
  EXPECT_FALSE(contents(stem + ".png").empty());
}

TEST_F(EquilibriumVerb, FailuresDoubtsAndMisuseHaveTheirStatus) {
  const Outcome none = run("equilibrium knife_edge --json");
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.err.find("0.717356 is left on 'x'"), std::string::npos) << none.err;
  EXPECT_NE(Json::parse(none.out)["status"].get<std::string>(), "ok");
  const Outcome moved = run("equilibrium car_axis --json");  // the road moves
  EXPECT_EQ(moved.status, 3) << moved.err;
  EXPECT_NEAR(Json::parse(moved.out)["q"]["yl"].get<double>(), 0.4995, 1e-12);  // L0 − eps² M/2 · 1
  expect_misuse("equilibrium no_such_scene", {"no_such_scene"});
}

/// A state without a rate keeps its start, whatever the forces ask of it.
TEST_F(EquilibriumVerb, StatesThatNothingMovesStayAtTheStart) {
  const Json thermostat = found("thermostat");
  EXPECT_EQ(thermostat["q"]["u"].get<double>(), 0.0);
  EXPECT_NEAR(thermostat["q"]["T"].get<double>(), 0.0, 1e-12);
  const Outcome clutch = run("equilibrium clutch --json");
  EXPECT_EQ(clutch.status, 1);
  EXPECT_EQ(Json::parse(clutch.out)["q"]["slips"].get<double>(), 1.0);
  EXPECT_NE(clutch.err.find("no equilibrium"), std::string::npos) << clutch.err;
}

TEST_F(EquilibriumVerb, AKinkAtTheEquilibriumIsDoubted) {
  const auto outcome_of =
      [&](const std::string& force) {
        std::ofstream(path("kink.toml"))
            << "name = \"kink\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n"
            << "[force]\nx = \"" << force << "\"\n[start]\nx = 0.5\n[span]\nend = 1\nstep = 0.1\n";
        return run("equilibrium '" + path("kink.toml") + "'");
      };
  const Outcome there = outcome_of("if(x > 0, -3*x, 0)");
  EXPECT_EQ(there.status, 3);
  EXPECT_NE(there.err.find("have a kink there"), std::string::npos) << there.err;
  EXPECT_EQ(outcome_of("if(x > 0.1, -3*x, 0)").status, 0);  // elsewhere
}

/// Bodies above their supports, which nothing but their weight acts on at the start: m g = 19.62.
TEST_F(EquilibriumVerb, BodiesFallOntoOneSidedSupports) {
  const std::string weight = "\nparameters = { m = 2, k = 1e6 }\nspan = { end = 1, step = 0.01 }\n";
  const double depth = 19.62e-6;
  const auto rests = [&](const std::string& potential, const std::string& start, const char* name,
                         double expected) {
    const Json json =
        found(scene("falls", "lagrangian = \"m*(v_x^2 + v_y^2)/2 - m*9.81*" + potential +
                                 "\"\ncoordinates = { x = {}, y = {} }\nstart = " + start + weight));
    EXPECT_NEAR(json["q"][name].get<double>(), expected, 1e-9 * depth + 1e-13 * std::abs(expected))
        << potential;
  };
  rests("y - k*max(0, -y)^2/2 - 50*(x - 1)^2/2", "{ y = 2 }", "y", -depth);
  rests("y - k*max(0, -100 - y)^2/2 - x^2/2", "{}", "y", -100.0 - depth);
  // One upon the other.
  rests("(x + y) - k*max(0, -x)^2/2 - k*max(0, 1 - (y - x))^2/2", "{ x = 3, y = 7 }", "y", 1.0 - 3.0 * depth);
  // Between two slopes: two thirds and one third of the weight.
  rests("y - k*max(0, -(y + 0.5*x))^2/2 - k*max(0, x - y)^2/2", "{ x = 0.3, y = 2 }", "x", -depth / 4.5);
  for (const char* slides : {"y - k*max(0, -(y + 0.5*x))^2/2", "y"}) {
    const Outcome none =
        run("equilibrium " +
            scene("falls", "lagrangian = \"m*(v_x^2 + v_y^2)/2 - m*9.81*" + std::string(slides) +
                               "\"\ncoordinates = { x = {}, y = {} }\nstart = { y = 2 }" + weight));
    EXPECT_EQ(none.status, 1) << slides;
    EXPECT_NE(none.err.find("no equilibrium found"), std::string::npos) << none.err;
    EXPECT_NE(none.err.find("a force of"), std::string::npos) << none.err;
  }
}

/// Springs between three masses that nothing holds: round-off of a double zero is no growth.
TEST_F(EquilibriumVerb, SparseModesOfAFamilyNameIt) {
  const std::string chain = scene("chain", R"toml(
lagrangian = "(v_x^2 + v_y^2 + v_z^2)/2 - (x - y)^2/2 - 3*(y - z)^2/2"
coordinates = { x = {}, y = {}, z = {} }
start = { x = 0.1 }
span = { end = 1, step = 0.01 }
)toml");
  const Outcome at_zero = run("equilibrium " + chain + " --modes 1 --near 0");
  if (!has_sparse_modes()) GTEST_SKIP() << "built without Spectra";
  EXPECT_EQ(at_zero.status, 2);
  for (const char* name : {"direction", "x 1", "y 1", "z 1", "--near"})
    EXPECT_NE(at_zero.err.find(name), std::string::npos) << at_zero.err;
  const Json beside = found(chain + " --modes 1");
  EXPECT_EQ(beside["zero_eigenvalues"], 2);
  EXPECT_EQ(beside["stability"].get<std::string>().substr(0, 7), "neutral");
}

}  // namespace
}  // namespace diracstep::testing
