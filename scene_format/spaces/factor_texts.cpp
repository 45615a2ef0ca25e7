#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/spaces/factor_texts.hpp>

namespace diracstep::spaces {

namespace {

bool is_flat(const std::string& kind) {
  return kind.size() == 2 && kind[0] == 'R' && kind[1] >= '1' && kind[1] <= '9';
}

std::size_t flat_size(const std::string& kind) { return static_cast<std::size_t>(kind[1] - '0'); }

/// Puts {0}, {1} … of a pattern to names.
class Patterns {
 public:
  explicit Patterns(const std::vector<std::string>& stored, const std::vector<std::string>& components)
      : stored_(stored), components_(components) {}

  /// q0, q1 … are stored numbers, v1, v2 … components of the velocity.
  std::string operator()(const std::string& pattern) const {
    std::string text;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
      const bool name = (pattern[i] == 'q' || pattern[i] == 'v') && i + 1 < pattern.size();
      if (!name) {
        text += pattern[i];
        continue;
      }
      const auto number = static_cast<std::size_t>(pattern[i + 1] - '0');
      text += pattern[i] == 'q' ? stored_[number] : "v_" + components_[number - 1];
      ++i;
    }
    return text;
  }

 private:
  const std::vector<std::string>&stored_, &components_;
};

constexpr std::array<std::array<const char*, 3>, 3> rotation{
    {{"(q0^2 + q1^2 - q2^2 - q3^2)", "2*(q1*q2 - q0*q3)", "2*(q1*q3 + q0*q2)"},
     {"2*(q1*q2 + q0*q3)", "(q0^2 - q1^2 + q2^2 - q3^2)", "2*(q2*q3 - q0*q1)"},
     {"2*(q1*q3 - q0*q2)", "2*(q2*q3 + q0*q1)", "(q0^2 - q1^2 - q2^2 + q3^2)"}}};

/// q' = q (0, ω)/2.
const std::vector<std::string> turning{"0.5*(-q1*v1 - q2*v2 - q3*v3)", "0.5*(q0*v1 + q2*v3 - q3*v2)",
                                       "0.5*(q0*v2 + q3*v1 - q1*v3)", "0.5*(q0*v3 + q1*v2 - q2*v1)"};
const std::vector<std::string> turning_frame{
    // of a sphere, which has no third rate
    "0.5*(-q1*v1 - q2*v2)", "0.5*(q0*v1 - q3*v2)", "0.5*(q0*v2 + q3*v1)", "0.5*(q1*v2 - q2*v1)"};

/// What a factor is, in patterns.
struct Form {
  std::vector<std::string> suffixes;  ///< of the stored numbers
  std::size_t components = 0;
  std::vector<std::string> rates;
  std::vector<std::vector<std::string>> matrix = {};  ///< NAME[i,j]
  std::vector<std::string> vector = {};               ///< NAME[i]
  std::vector<std::string> vector_rate = {};          ///< v_NAME[i]
};

std::vector<std::vector<std::string>> rotation_rows() {
  std::vector<std::vector<std::string>> rows;
  for (const auto& row : rotation) rows.emplace_back(row.begin(), row.end());
  return rows;
}

Form rotation_form() { return {{"w", "x", "y", "z"}, 3, turning, rotation_rows()}; }

Form sphere_form() {
  Form form{{"w", "x", "y", "z"}, 2, turning_frame};
  for (const auto& row : rotation) {
    form.vector.emplace_back(row[2]);
    form.vector_rate.push_back(fmt::format("({}*v2 - {}*v1)", row[0], row[1]));
  }
  return form;
}

Form motion_form() {
  Form form{{"w", "x", "y", "z", "px", "py", "pz"}, 6, turning, rotation_rows()};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& row = rotation[i];
    form.rates.push_back(fmt::format("{}*v4 + {}*v5 + {}*v6", row[0], row[1], row[2]));
    form.matrix[i].push_back(fmt::format("q{}", 4 + i));
  }
  form.matrix.push_back({"0", "0", "0", "1"});
  return form;
}

Form form_of(const std::string& kind) {
  if (kind == "SO3") return rotation_form();
  if (kind == "S2") return sphere_form();
  if (kind == "SE3") return motion_form();
  if (kind == "S1") return {{"cos", "sin"}, 1, {"-q1*v1", "q0*v1"}, {}, {"q0", "q1"}, {"-q1*v1", "q0*v1"}};
  if (kind == "SE2")
    return {{"cos", "sin", "x", "y"},
            3,
            {"-q1*v1", "q0*v1", "q0*v2 - q1*v3", "q1*v2 + q0*v3"},
            {{"q0", "-q1", "q2"}, {"q1", "q0", "q3"}, {"0", "0", "1"}}};
  Form form{{}, flat_size(kind), {}};
  for (std::size_t i = 0; i < form.components; ++i) {
    form.suffixes.push_back(fmt::format("{}", i + 1));
    form.rates.push_back(fmt::format("v{}", i + 1));
    form.vector.push_back(fmt::format("q{}", i));
  }
  form.vector_rate = form.rates;
  return form;
}

}  // namespace

bool is_factor(const std::string& kind) {
  constexpr std::array kinds{"SO3", "SE3", "SE2", "S2", "S1"};
  return is_flat(kind) || std::ranges::find(kinds, kind) != kinds.end();
}

std::string factor_kinds() { return "SO3, SE3, SE2, S2, S1 and R1 to R9"; }

std::array<std::size_t, 2> factor_sizes(const std::string& kind) {
  const Form form = form_of(kind);
  return {form.suffixes.size(), form.components};
}

FactorTexts factor_texts(const std::string& kind, const std::string& name) {
  const Form form = form_of(kind);
  FactorTexts texts;
  for (const std::string& suffix : form.suffixes) texts.stored.push_back(name + '_' + suffix);
  for (std::size_t i = 1; i <= form.components; ++i)
    texts.components.push_back(fmt::format("{}_{}", name, i));
  const Patterns named(texts.stored, texts.components);
  for (const std::string& rate : form.rates) texts.rates.push_back(named(rate));
  for (std::size_t i = 0; i < form.matrix.size(); ++i)
    for (std::size_t j = 0; j < form.matrix[i].size(); ++j)
      texts.entries[fmt::format("{}[{},{}]", name, i + 1, j + 1)] = named(form.matrix[i][j]);
  for (std::size_t i = 0; i < form.vector.size(); ++i) {
    texts.entries[fmt::format("{}[{}]", name, i + 1)] = named(form.vector[i]);
    texts.entries[fmt::format("v_{}[{}]", name, i + 1)] = named(form.vector_rate[i]);
  }
  if (is_flat(kind)) return texts;
  if (kind == "S1" || kind == "SE2")
    texts.definitions[name + "_angle"] = fmt::format("atan2({}, {})", texts.stored[1], texts.stored[0]);
  for (std::size_t i = 0; i < form.components; ++i)
    texts.entries[fmt::format("w_{}[{}]", name, i + 1)] = "v_" + texts.components[i];
  return texts;
}

std::vector<std::string> turn_about(const std::array<std::string, 3>& axis, const std::string& angle) {
  const std::string length = fmt::format("sqrt(({})^2 + ({})^2 + ({})^2)", axis[0], axis[1], axis[2]);
  std::vector<std::string> q{fmt::format("cos(({})/2)", angle)};
  for (const std::string& part : axis) q.push_back(fmt::format("({})*sin(({})/2)/{}", part, angle, length));
  return q;
}

std::vector<std::string> frame_of(const std::array<std::string, 3>& q) {
  const std::string length = fmt::format("sqrt(({})^2 + ({})^2 + ({})^2)", q[0], q[1], q[2]);
  std::array<std::string, 3> unit;
  for (std::size_t i = 0; i < 3; ++i) unit[i] = fmt::format("(({})/{})", q[i], length);
  const std::string &x = unit[0], &y = unit[1], &z = unit[2];
  // The shortest turn from e3, and on the lower half that from −e3 behind a half turn about e1.  The edge is
  // at a number that nobody states, since if(…) is the mean of both sides there.
  const auto either = [&](const std::string& upper, const std::string& lower) {
    return fmt::format("if({} > -0.0123456789, ({})/sqrt(2*(1 + abs({}))), ({})/sqrt(2*(1 + abs({}))))", z,
                       upper, z, lower, z);
  };
  return {either("1 + " + z, "-" + y), either("-" + y, "1 - " + z), either(x, "0"), either("0", x)};
}

std::optional<std::array<double, 4>> quaternion_of(const std::array<std::array<double, 3>, 3>& m) {
  constexpr double off = 1e-6;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double product = m[i][0] * m[j][0] + m[i][1] * m[j][1] + m[i][2] * m[j][2];
      if (!(std::abs(product - (i == j ? 1.0 : 0.0)) < off)) return std::nullopt;
    }
  const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  if (determinant < 0.0) return std::nullopt;
  // 4 q qᵀ, whose column with the largest diagonal entry gives all digits: Shepperd, J. Guidance Control 1
  // (1978), 223.
  const double trace = m[0][0] + m[1][1] + m[2][2];
  std::array<std::array<double, 4>, 4> outer{};
  outer[0][0] = 1.0 + trace;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    outer[i + 1][i + 1] = 1.0 + 2.0 * m[i][i] - trace;
    outer[0][i + 1] = outer[i + 1][0] = m[k][j] - m[j][k];
    outer[j + 1][k + 1] = outer[k + 1][j + 1] = m[j][k] + m[k][j];
  }
  std::size_t largest = 0;
  for (std::size_t i = 1; i < 4; ++i)
    if (outer[i][i] > outer[largest][largest]) largest = i;
  std::array<double, 4> q = outer[largest];
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& one : q) one /= length;
  return q;
}

}  // namespace diracstep::spaces
