#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <diracstep/scene_format/scene_file.hpp>
#include <functional>
#include <random>

/// Formulas keep their value: what a scene computes is what its formulas say, over the whole range of
/// doubles.
namespace diracstep {
namespace {

constexpr double unit = 0x1p-53;

/// A formula as a text, and as a function of the variables that gives its value.
struct Value {
  long double exact = 0.0L;  ///< in extended precision and range
  long double error = 0.0L;  ///< that arithmetic in doubles may have, to first order
  double plain = 0.0;        ///< in doubles, operation by operation as written
  bool in_range = true;      ///< no operation over- or underflowed there
};
using Formula = std::function<Value(const std::vector<double>&)>;
struct Written {
  std::string text;
  Formula value;
};

Value made(long double exact, long double error, double plain, bool in_range) {
  const bool kept = std::isnormal(plain) || (plain == 0.0 && exact == 0.0L);
  return {exact, error + 4.0L * unit * std::abs(exact), plain, in_range && kept};
}

class Formulas {
 public:
  static constexpr int variables = 6;  // x, y, z, then the parameters a, b, c
  explicit Formulas(unsigned seed) : random_(seed) {}

  double number() {
    const int kind = pick(4);
    if (kind == 0) return 1.0 + pick(4);
    const double exponent = kind == 1 ? 300.0 : 3.0;
    const double size = std::pow(10.0, std::uniform_real_distribution(-exponent, exponent)(random_));
    return pick(2) == 0 ? size : -size;
  }

  Written any(int depth) {
    if (depth == 0) return pick(3) == 0 ? literal() : variable();
    switch (pick(9)) {
      case 0:
        return sum(any(depth - 1), any(depth - 1), 1.0);
      case 1:
        return sum(any(depth - 1), any(depth - 1), -1.0);
      case 2:
      case 3:
      case 4:
        return product(any(depth - 1), any(depth - 1));
      case 5:
        return quotient(any(depth - 1), any(depth - 1));
      case 6:
        return extreme(any(depth - 1), any(depth - 1), pick(2) == 0);
      case 7:
        return power(any(depth - 1), pick(7) - 3);
      default:
        return root(any(depth - 1));
    }
  }

 private:
  int pick(int n) { return std::uniform_int_distribution(0, n - 1)(random_); }

  Written literal() {
    const double x = number();
    return {fmt::format("({:.17g})", x), [x](const auto&) { return Value{x, 0.0L, x, true}; }};
  }
  Written variable() {
    const auto i = static_cast<std::size_t>(pick(variables));
    return {std::string(1, "xyzabc"[i]), [i](const auto& at) { return Value{at[i], 0.0L, at[i], true}; }};
  }
  static Written sum(const Written& a, const Written& b, double sign) {
    return {"(" + a.text + (sign > 0.0 ? " + " : " - ") + b.text + ")", [=](const auto& at) {
              const Value x = a.value(at), y = b.value(at);
              return made(x.exact + sign * y.exact, x.error + y.error, x.plain + sign * y.plain,
                          x.in_range && y.in_range);
            }};
  }
  static Written product(const Written& a, const Written& b) {
    return {"(" + a.text + "*" + b.text + ")", [=](const auto& at) {
              const Value x = a.value(at), y = b.value(at);
              return made(x.exact * y.exact,
                          std::abs(x.exact) * y.error + std::abs(y.exact) * x.error + x.error * y.error,
                          x.plain * y.plain, x.in_range && y.in_range);
            }};
  }
  static Written quotient(const Written& a, const Written& b) {
    return {"(" + a.text + "/" + b.text + ")", [=](const auto& at) {
              const Value x = a.value(at), y = b.value(at);
              const long double least = std::abs(y.exact) - y.error;
              return made(x.exact / y.exact, (x.error + std::abs(x.exact / y.exact) * y.error) / least,
                          x.plain / y.plain, x.in_range && y.in_range && least > 0.0L);
            }};
  }
  static Written extreme(const Written& a, const Written& b, bool largest) {
    return {(largest ? "max(" : "min(") + a.text + ", " + b.text + ")", [=](const auto& at) {
              const Value x = a.value(at), y = b.value(at);
              const bool first = largest ? x.exact > y.exact : x.exact < y.exact;
              const bool sure = std::abs(x.exact - y.exact) > x.error + y.error;
              Value chosen = first ? x : y;
              if (!sure) chosen.error = std::max(x.error, y.error);
              chosen.in_range = x.in_range && y.in_range;
              return chosen;
            }};
  }
  static Written power(const Written& a, int n) {
    return {"(" + a.text + ")^" + (n < 0 ? "(" + std::to_string(n) + ")" : std::to_string(n)),
            [=](const auto& at) {
              const Value x = a.value(at);
              const long double exact = std::pow(x.exact, static_cast<long double>(n));
              const long double off = x.exact == 0.0L ? 0.0L : x.error / std::abs(x.exact) + 2.0L * unit;
              return made(exact, std::abs(exact) * std::expm1(std::abs(n) * off * 1.1L), std::pow(x.plain, n),
                          x.in_range && off < 0.01L);
            }};
  }
  static Written root(const Written& a) {
    return {"sqrt(abs(" + a.text + "))", [=](const auto& at) {
              const Value x = a.value(at);
              const long double exact = std::sqrt(std::abs(x.exact));
              return made(exact, exact == 0.0L ? 0.0L : x.error / exact, std::sqrt(std::abs(x.plain)),
                          x.in_range);
            }};
  }

  std::mt19937 random_;
};

std::string scene_with(const std::vector<Written>& formulas, const std::vector<double>& parameters) {
  std::string forces, coordinates = "x = {}\ny = {}\nz = {}\n", masses = "v_x^2 + v_y^2 + v_z^2";
  for (std::size_t i = 0; i < formulas.size(); ++i) {
    forces += fmt::format("f{} = \"{}\"\n", i, formulas[i].text);
    coordinates += fmt::format("f{} = {{}}\n", i);
    masses += fmt::format(" + v_f{}^2", i);
  }
  return fmt::format(
      "name = \"formulas\"\nlagrangian = \"{}\"\n[coordinates]\n{}[parameters]\na = {:.17g}\nb = {:.17g}\n"
      "c = {:.17g}\n[force]\n{}[start]\nx = 1.5\ny = 1.25\nz = 1.75\n[span]\nend = 1\nstep = 0.1\n",
      masses, coordinates, parameters[0], parameters[1], parameters[2], forces);
}

/// The force on each coordinate after x, y, z.
Vector values(const CatalogueScene& entry, const std::vector<double>& at) {
  const int n = entry.scene->dimension();
  Vector q = Vector::Zero(n), f(n);
  for (int i = 0; i < 3; ++i) q[i] = at[static_cast<std::size_t>(i)];
  entry.scene->force->value(0.0, q, Vector::Zero(n), f);
  return f.tail(n - 3);
}

/// With the kernels interpreted.
CatalogueScene interpreted(const std::string& text) {
  setenv("DIRACSTEP_CC", "none", 1);
  CatalogueScene entry = scene_from_text("formulas.toml", text);
  unsetenv("DIRACSTEP_CC");
  return entry;
}

TEST(FormulaValues, AreWhatTheFormulasSayOverTheWholeRangeOfDoubles) {
  long compared = 0, beyond_unity = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Formulas formulas(seed);
    std::vector<double> parameters;
    for (int i = 0; i < 3; ++i) parameters.push_back(formulas.number());
    std::vector<Written> written;
    while (written.size() < 40) {  // those that are defined at the start, as a scene must be
      Written one = formulas.any(3);
      std::vector<double> start{1.5, 1.25, 1.75};
      start.insert(start.end(), parameters.begin(), parameters.end());
      if (one.value(start).in_range) written.push_back(std::move(one));
    }
    const std::string text = scene_with(written, parameters);
    const CatalogueScene compiled = scene_from_text("formulas.toml", text), slow = interpreted(text);
    ASSERT_TRUE(compiled.code.starts_with("compiled")) << compiled.code;
    for (int point = 0; point < 60; ++point) {
      std::vector<double> at{formulas.number(), formulas.number(), formulas.number()};
      at.insert(at.end(), parameters.begin(), parameters.end());
      const Vector fast = values(compiled, at), same = values(slow, at);
      for (std::size_t i = 0; i < written.size(); ++i) {
        const double got = fast[static_cast<Eigen::Index>(i)];
        EXPECT_TRUE(got == same[static_cast<Eigen::Index>(i)] || std::isnan(got)) << written[i].text;
        const Value value = written[i].value(at);
        if (!value.in_range) continue;
        ++compared;
        if (std::abs(value.exact) > 1e100L || std::abs(value.exact) < 1e-100L) ++beyond_unity;
        EXPECT_LE(std::abs(got - value.exact), value.error)
            << written[i].text << " = " << got << ", exactly " << static_cast<double>(value.exact) << " at "
            << fmt::format("{}, {}, {}, {}, {}, {}", at[0], at[1], at[2], at[3], at[4], at[5]);
      }
    }
  }
  EXPECT_GT(compared, 5000);
  EXPECT_GT(beyond_unity, 500);
}

/// A force that saturates far away pulls like a spring near the origin: x = cos t.
TEST(FormulaValues, MinKeepsTheSmallOne) {
  const CatalogueScene entry = scene_from_text("min.toml", R"toml(
name = "saturating"
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[parameters]
big = 1e20
[force]
x = "-min(big, x) + 0*max(-big, x)"
[start]
x = 1
[span]
end = 1.0
step = 0.1
)toml");
  Vector f(1), q = Vector::Constant(1, 0.3), fq(1), fv(1);
  entry.scene->force->value(0.0, q, q, f);
  EXPECT_EQ(f[0], -0.3);
  entry.scene->force->derivatives(0.0, q, q, fq, fv);
  EXPECT_EQ(fq[0], -1.0);
}

TEST(FormulaValues, SignIsThatOfItsArgument) {
  const CatalogueScene entry = scene_from_text("sign.toml", R"toml(
name = "sign"
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[force]
x = "x*sign(x - 1)"
[span]
end = 1.0
step = 0.1
)toml");
  Vector f(1), q(1), fq(1), fv(1);
  for (const auto& [x, sign] : {std::pair{0.5, -1.0}, {1.0, 0.0}, {3.0, 1.0}}) {
    q[0] = x;
    entry.scene->force->value(0.0, q, q, f);
    EXPECT_EQ(f[0], x * sign);
    entry.scene->force->derivatives(0.0, q, q, fq, fv);
    EXPECT_EQ(fq[0], sign);
  }
}

/// Beside an infinite slope that is not chosen the other one holds.
TEST(FormulaValues, DerivativeOfAChoiceIsThatOfTheChosen) {
  const CatalogueScene entry = scene_from_text("choice.toml", R"toml(
name = "choice"
lagrangian = "v_x^2/2 + v_y^2/2"
[coordinates]
x = {}
y = {}
[force]
x = "max(3*y, sqrt(x)) + min(2*y, 7) + max(y, 1)"
[start]
y = 1
[span]
end = 1.0
step = 0.1
)toml");
  Vector q(2), v = Vector::Zero(2), fq(entry.scene->force->pattern().nonzeros()), fv = fq;
  q << 0.0, 1.0;
  entry.scene->force->derivatives(0.0, q, v, fq, fv);
  const auto full = entry.scene->force->pattern().full(fq);
  EXPECT_EQ(full(0, 0), 0.0);
  EXPECT_EQ(full(0, 1), 3.0 + 2.0 + 0.5);  // on a kink the mean of both sides
}

/// Derivatives whose values are ordinary numbers although the squares of their arguments are not.
TEST(FormulaValues, DerivativesOfInverseFunctionsReachFar) {
  const CatalogueScene entry = scene_from_text("far.toml", R"toml(
name = "far"
lagrangian = "v_x^2/2 + v_y^2/2"
[coordinates]
x = {}
y = {}
[force]
x = "asinh(x) + acosh(x)"
y = "atan2(y, x)"
[start]
x = 2
y = 1
[span]
end = 1.0
step = 0.1
)toml");
  Vector q(2), v = Vector::Zero(2), fq(entry.scene->force->pattern().nonzeros()), fv = fq;
  q << 1e200, 1e200;
  entry.scene->force->derivatives(0.0, q, v, fq, fv);
  const auto full = entry.scene->force->pattern().full(fq);
  EXPECT_NEAR(full(0, 0), 2e-200, 2e-214);   // 1/x each
  EXPECT_NEAR(full(1, 1), 5e-201, 1e-214);   // x/(x² + y²)
  EXPECT_NEAR(full(1, 0), -5e-201, 1e-214);  // −y/(x² + y²)
}

/// Forty definitions, each with the one before twice: 2^40 addends, were they written out.
TEST(FormulaValues, SumsThatAreUsedOftenAreTakenApartOnce) {
  std::string definitions = "d0 = \"sum(i = 1..2, x*i)\"\n";
  for (int k = 1; k <= 40; ++k) definitions += fmt::format("d{} = \"d{} + x*d{}\"\n", k, k - 1, k - 1);
  const CatalogueScene entry = scene_from_text(
      "often.toml",
      "name = \"often\"\nlagrangian = \"v_x^2/2 - d40\"\n[coordinates]\nx = {}\n[definitions]\n" +
          definitions + "[start]\nx = 1\n[span]\nend = 0.2\nstep = 0.1\n");
  const Vector x = Vector::Constant(1, 1.0);  // d40 = 3 x (1 + x)^40
  EXPECT_NEAR(entry.scene->lagrangian->value(0.0, x, x), 0.5 - 3.0 * std::pow(2.0, 40), 1e-2);
}

}  // namespace
}  // namespace diracstep
