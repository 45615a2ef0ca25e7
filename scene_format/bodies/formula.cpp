#include <fmt/format.h>

#include <cmath>
#include <diracstep/scene_format/bodies/formula.hpp>
#include <limits>

namespace diracstep::bodies {

namespace {

constexpr double depends_on_the_motion = std::numeric_limits<double>::quiet_NaN();

/// In as few digits as give the same double.
std::string number_text(double value) { return fmt::format("{}", value); }

}  // namespace

Formula::Formula(double number)
    : text_(number_text(number)),
      value_(number),
      level_(std::signbit(number) ? Level::product : Level::atom),
      number_(true) {}

Formula Formula::name(std::string name, double value) { return {std::move(name), value, Level::atom}; }
Formula Formula::name(std::string name) { return {std::move(name), depends_on_the_motion, Level::atom}; }

Formula Formula::call(const char* function, const Formula& argument, double value) {
  if (argument.number_) return value;
  return {fmt::format("{}({})", function, argument.text_), value, Level::atom};
}

std::string Formula::within(Level level) const { return level_ < level ? '(' + text_ + ')' : text_; }

Formula operator-(const Formula& a) {
  if (a.number_) return a.value_ == 0.0 ? 0.0 : -a.value_;
  if (a.negative()) return {a.text_.substr(1), -a.value_, Formula::Level::product};
  return {'-' + a.within(Formula::Level::product), -a.value_, Formula::Level::product};
}

Formula operator+(const Formula& a, const Formula& b) {
  if (a.is(0.0)) return b;
  if (b.is(0.0)) return a;
  const double value = a.value_ + b.value_;
  if (a.number_ && b.number_) return value;
  if (a.negative() && !b.negative()) return b + a;
  return {a.text_ + (b.negative() ? " - " + b.text_.substr(1) : " + " + b.text_), value, Formula::Level::sum};
}

Formula operator-(const Formula& a, const Formula& b) { return a + -b; }

Formula operator*(const Formula& a, const Formula& b) {
  using Level = Formula::Level;
  if (a.is(0.0) || b.is(0.0)) return 0.0;
  if (a.number_ && b.number_) return a.value_ * b.value_;
  if (a.is(1.0)) return b;
  if (b.is(1.0)) return a;
  if (a.negative()) return -(-a * b);
  if (b.negative()) return -(a * -b);
  if (b.number_) return b * a;
  return {a.within(Level::product) + '*' + b.within(Level::product), a.value_ * b.value_, Level::product};
}

Formula operator/(const Formula& a, const Formula& b) {
  using Level = Formula::Level;
  if (a.is(0.0) || b.is(1.0)) return a;
  if (a.number_ && b.number_) return a.value_ / b.value_;
  if (a.negative()) return -(-a / b);
  return {a.within(Level::product) + '/' + b.within(Level::power), a.value_ / b.value_, Level::product};
}

Formula square(const Formula& a) {
  if (a.is_number()) return a.value() * a.value();
  return {a.within(Formula::Level::atom) + "^2", a.value() * a.value(), Formula::Level::power};
}

Formula root(const Formula& a) { return Formula::call("sqrt", a, std::sqrt(a.value())); }

Formula rate_of(const Formula& a) {
  if (a.is_number()) return 0.0;
  return {fmt::format("rate({})", a.text()), depends_on_the_motion, Formula::Level::atom};
}

Vec operator+(const Vec& a, const Vec& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vec operator-(const Vec& a, const Vec& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec operator*(const Formula& a, const Vec& b) { return {a * b[0], a * b[1], a * b[2]}; }
Vec operator*(const Matrix& a, const Vec& b) { return {dot(a[0], b), dot(a[1], b), dot(a[2], b)}; }

Matrix operator*(const Matrix& a, const Matrix& b) {
  const Matrix columns = transposed(b);
  return transposed({a * columns[0], a * columns[1], a * columns[2]});
}

Matrix transposed(const Matrix& a) {
  return {{{a[0][0], a[1][0], a[2][0]}, {a[0][1], a[1][1], a[2][1]}, {a[0][2], a[1][2], a[2][2]}}};
}

Formula dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Formula norm(const Vec& a) {
  const Formula squares = square(a[0]) + square(a[1]) + square(a[2]);
  return root(squares);
}

Vec unit(const Vec& a) {
  const Formula length = norm(a);
  return {a[0] / length, a[1] / length, a[2] / length};
}

Vec rate_of(const Vec& a) { return {rate_of(a[0]), rate_of(a[1]), rate_of(a[2])}; }

Vec zero_vector() { return {0.0, 0.0, 0.0}; }

Matrix unit_matrix() { return {{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}}; }

std::array<Vec, 2> across(const Vec& a) {
  std::size_t least = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (std::abs(a[k].value()) < std::abs(a[least].value())) least = k;
  const Vec second = unit(cross(a, unit_matrix()[least]));
  return {cross(second, a), second};
}

}  // namespace diracstep::bodies
